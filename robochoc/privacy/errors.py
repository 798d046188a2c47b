"""Errors of the privacy measures."""

from __future__ import annotations

from robochoc.system.errors import RobochocError


class PrivacyError(RobochocError):
    """The privacy loss cannot be measured. `broken`: the journal is damaged, or a message's rule is wrong."""

    def __init__(self, why: str, *, broken: bool = False) -> None:
        super().__init__(why)
        self.broken = broken
