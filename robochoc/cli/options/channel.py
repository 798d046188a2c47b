"""`--channel`: a channel model by name, or the TOML file of one's own."""

from __future__ import annotations

import os
from pathlib import Path
from typing import TYPE_CHECKING

import click

from robochoc.cli.options.paths import PathLike

if TYPE_CHECKING:
    from robochoc.communication.simulator.channel import ChannelModel

NAMES = ("wlan", "wpan", "wman", "wwan")


class ChannelName(click.Path):
    """A name in `NAMES`, or else the path of a file that is there."""

    def convert(self, value: PathLike, param: click.Parameter | None, ctx: click.Context | None) -> str | Path:
        """The name, or the path. Fails, as wrong usage, where it is neither."""
        word = os.fsdecode(value)
        if word in NAMES:
            return word
        if not word or not os.path.lexists(word):
            import difflib

            near = difflib.get_close_matches(word, NAMES, 1)
            hint = f"did you mean '{near[0]}'?" if near else f"channels: {', '.join(NAMES)}"
            self.fail(f"'{word}' is no channel and no file; {hint}", param, ctx)
        return Path(word)


def channel_for(channel: str | Path | None) -> ChannelModel | None:
    """The model that was asked for. Raises `InvalidInputError` where a file is none."""
    if channel is None:
        return None
    from robochoc.communication.simulator.channel import CHANNELS, read_channel

    return read_channel(channel) if isinstance(channel, Path) else CHANNELS[channel]
