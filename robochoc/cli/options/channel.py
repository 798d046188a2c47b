"""`--channel`: a channel model by name, or the TOML file of one's own."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from robochoc.cli.options.names import NameOrFile

if TYPE_CHECKING:
    from robochoc.communication.simulator.channel import ChannelModel

NAMES = ("wlan", "wpan", "wman", "wwan")
CHANNEL_NAME = NameOrFile("channel", NAMES)


def channel_for(channel: str | Path | None) -> ChannelModel | None:
    """Return the model that was asked for.

    Raises:
        InvalidInputError: the file is no channel model.
    """
    if channel is None:
        return None
    from robochoc.communication.simulator.channel import CHANNELS, read_channel

    return read_channel(channel) if isinstance(channel, Path) else CHANNELS[channel]
