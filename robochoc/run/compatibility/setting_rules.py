"""Settings that a protocol does not have, or does not accept."""

from __future__ import annotations

from collections.abc import Mapping
from typing import get_args

from robochoc.protocols.protocol import Protocol
from robochoc.protocols.settings import SettingsError, read_settings
from robochoc.protocols.shared.anytime import AnytimeMessage
from robochoc.protocols.shared.cycles import CycleSettings
from robochoc.solver.errors import UnsupportedError
from robochoc.system.pydcop_words import SETTINGS


def refuse_settings(name: str, protocol: type[Protocol], settings: Mapping[str, str]) -> None:
    """Raise `UnsupportedError` for `settings` that the protocol called `name` does not have, or does not accept."""
    try:
        known = read_settings(protocol, settings)
    except SettingsError as wrong:
        for name_of_pydcop, ours in SETTINGS.items():
            if name_of_pydcop in settings and ours in protocol.settings.__struct_fields__:
                instead = f"instead of pyDCOP's {name_of_pydcop}, set {ours}"
                raise UnsupportedError(f"--set: {instead} (protocol {name})") from None
        raise UnsupportedError(f"--set: {wrong} (protocol {name})") from None
    if isinstance(known, CycleSettings) and known.anytime == "yes" and not _finds_best_cycle(protocol):
        raise UnsupportedError(f"--set: anytime=yes needs `AnytimeMessage` among the `messages` of protocol {name}")


def _finds_best_cycle(protocol: type[Protocol]) -> bool:
    """Return whether robots can receive the messages about the best cycle."""
    return {*get_args(AnytimeMessage)} <= {*get_args(protocol.messages)}
