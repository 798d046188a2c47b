"""The events at the start of a search: which protocol begins, and what the robots are given."""

from __future__ import annotations

from typing import Any

from robochoc.communication.session import Session
from robochoc.journal.events import Began, Observer
from robochoc.journal.given import TeamWriter
from robochoc.protocols.protocol import Protocol
from robochoc.run.scenario import EpochStart


class StartEvents:
    """Reports to `observer`, if there is one, the start of each search, and of each epoch."""

    def __init__(self, observer: Observer | None) -> None:
        self._observer = observer
        self._writer = TeamWriter()

    def report(self, protocol: type[Protocol], start: EpochStart, session: Session | None = None) -> None:
        """Report that a search begins.

        Args:
            protocol: the protocol that searches.
            start: the epoch that begins.
            session: the session in which it is searched; None if that is opened later.
        """
        if self._observer is None:
            return
        epoch, number, opened_by = start
        detail: dict[str, Any] = {"epoch": number, "opened_by": opened_by} if number else {}
        if protocol.traits.costs:
            detail["minimises"] = True
        self._observer(Began(t=0, protocol=protocol.__name__, **detail))
        fresh = epoch.team.order if session and session.starts_fresh else epoch.restarted
        lossless = session is None or session.lossless
        self._observer(self._writer.given(epoch.team, epoch.parameters, epoch.invalidated, fresh=fresh, quiet=lossless))
