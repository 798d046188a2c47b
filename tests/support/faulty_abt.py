"""ABT with planted faults, which appear in some orders of messages only."""

from __future__ import annotations

from robochoc.protocols.satisfaction.abt import ABT
from robochoc.protocols.satisfaction.nogood_messages import Nogood


class AnyNogood(ABT):
    """Believes every nogood, also obsolete ones."""

    def _coherent(self, nogood: Nogood) -> bool:
        del nogood
        return True


class NoAnswer(ABT):
    """Does not repeat its value for robots that have forgotten it."""

    def _resolve_conflict(self, sender: str, nogood: Nogood) -> None:
        if self._coherent(nogood):
            super()._resolve_conflict(sender, nogood)
