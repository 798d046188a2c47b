"""The settings of Synchronous Forward Bounding (see `sfb.py`)."""

from __future__ import annotations

from robochoc.protocols.settings_base import Settings

MIB = 1 << 20


class SFBSettings(Settings, frozen=True):
    """Limits on the CPAs that are extended and sent at once.

    `batch`: the maximum number of CPAs that are extended at once. `window`: the maximum number of CPA messages of each
    robot that are sent and not yet explored. `memory`: the bytes that the CPAs in all these messages of all robots may
    take together.

    Each message has the same share of the memory: memory / (robots * window), 4 MiB at most. Only a message with a
    single CPA may take more. CPAs that do not fit are not extended yet, or wait at the robot that has extended them (at
    most one share, or the extensions of a single CPA). With less memory there are more messages, and the verdict is the
    same. The total traffic is not bounded: it is as large as the search. The first waves are not bounded either: their
    messages grow with the number of different domains and charges.
    """

    batch: int = 4096
    window: int = 1
    memory: int = 64 * MIB

    def __post_init__(self) -> None:
        if self.batch < 1 or self.window < 1 or self.memory < 1:
            raise ValueError("batch, window and memory are 1 or more")
