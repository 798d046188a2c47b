"""The master across machines, as in Figure 3: it "launches its communication interface listening on the network".

The master runs the router and is a participant like the robots. It registers robots (without access to their files),
closes the team when all robots are present, sends each robot its task, orders the start, detects quiescence by four
counters, collects the decision, lets every robot check its constraints against the decision, and ends the run.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Mapping
from contextlib import suppress
from functools import partial

from robochoc.communication.control import Pause
from robochoc.communication.network.audited_state import AuditedSearchState
from robochoc.communication.network.checked_snapshots import CheckedSnapshots
from robochoc.communication.network.control_messages import (
    Adopt,
    CheckRequest,
    DomainRequest,
    Leave,
    StartSearch,
    TeamDecision,
)
from robochoc.communication.network.framing import MASTER
from robochoc.communication.network.master_control import HELD_S, MasterControl
from robochoc.communication.network.master_votes import NoMajorityError, SupersededError
from robochoc.communication.search_result import RobotsLostError, SearchResult
from robochoc.communication.session import is_past
from robochoc.protocols.traits import Traits
from robochoc.solver.agent_problem import RunParameters
from robochoc.solver.errors import UnsupportedError

REPORTS_S, FAREWELL_S, AGAIN_S = 10.0, 5.0, 0.5
COMING_S = 45.0
"""The longest wait for the first robot after a takeover, in seconds. Robots look for a master for 30 s by default."""


class Master(MasterControl):
    """The master, listening at `endpoint` (`HOST:PORT`); a context manager. See `MasterControl` for the arguments.

    This class contains the course of a run, from the registration of the robots to its end.
    """

    def gather(self, deadline: float | None = None) -> bool:
        """Wait until all robots are registered. Return False if the deadline (on the monotonic clock) passes first.

        Raises `UnsupportedError` for a constraint over a variable that belongs to no neighbour of the constraint's
        robot.
        """
        until = math.inf if deadline is None else deadline  # people start the robots
        self._listens_since = time.monotonic()
        self._serve_until(lambda: self.members.complete or self._is_gathered(), until)
        if self._is_to_step_down:
            raise SupersededError("a master with a higher priority leads")
        unseen = self.members.unseen()
        while unseen and not is_past(deadline):
            for name, variables in unseen.items():
                self._send(name, DomainRequest(variables))
            self._serve_until(lambda before=unseen: self.members.unseen() != before, until)  # type: ignore[misc]
            unseen = self.members.unseen()
        self.members.closed = self._standbys.closed = self.members.complete and not unseen
        invalid = next(self.members.invalid_scopes(), None) if self.members.closed else None
        if invalid:
            raise UnsupportedError(invalid)
        return self.members.closed

    def _is_gathered(self) -> bool:
        """Return whether to wait no longer for robots, because another master leads, or has led the missing robots.

        Raises:
            RobotsLostError: if robots of another master's team do not come, and the run does not survive that.
            NoMajorityError: if fewer than a majority of this team has come, or no robot.
        """
        if self._is_to_step_down:
            return True
        missing = sorted(set(self.votes.team) - self.members.robots.keys())
        last = max((member.since for member in self.members.robots.values()), default=None)
        if last is None and self.takes_over and is_past(self._listens_since + COMING_S):
            raise NoMajorityError(f"no robot has come to this master for {COMING_S:g} s: its run has ended elsewhere")
        if not missing or last is None or not is_past(last + self._settings.patience_s):
            return False
        self.votes.check_team(self.members.robots)
        why = "it did not come to this master after the previous one was gone"
        if not self._settings.survive:
            raise RobotsLostError(dict.fromkeys(missing, why))
        for name in missing:
            self.events.lost(name, why)
        self.absent |= dict.fromkeys(missing, why)
        self.members.give_up(missing)
        return self.members.complete

    @property
    def _is_to_step_down(self) -> bool:
        """True if a master with a higher priority leads, and no robot here has left its run."""
        return not self.votes.mission and self.is_superseded()

    def elect(self) -> TeamDecision | None:
        """Obtain the votes of a majority of the team, if robots know several masters.

        Returns:
            The decision that this master must confirm instead of a search, because an earlier one may have published
            it, or None.

        Raises:
            NoMajorityError: if a majority does not vote for this master.
            RobotsLostError: if a robot is lost, and the run does not survive that.
        """
        if not self.votes.is_needed:
            return None
        self._send_all(self.votes.start(self.members.order))
        self._wait_for_votes(lambda: self.votes.promised)
        self.votes.check_promises()
        self.events.leads(self.votes.name, self.votes.term or 0, self.votes.reason)
        return self.votes.inherited

    def confirm(self, decision: TeamDecision) -> None:
        """Let a majority of the team accept the decision, if robots know several masters. Raises `NoMajorityError`."""
        if not self.votes.is_needed:
            return
        self._send_all(self.votes.propose(decision))
        self._wait_for_votes(lambda: self.votes.accepted)
        self.votes.check_acceptances()

    def _wait_for_votes(self, votes: Callable[[], frozenset[str]]) -> None:
        """Wait for the votes of all present robots, for a limited time."""
        away_s = self._settings.patience_s + self._settings.lease_ms / 1000
        self._serve_until(
            lambda: votes() >= set(self.members.listening) - set(self.state.lost), time.monotonic() + away_s
        )

    def search(
        self,
        protocol: str,
        traits: Traits,
        parameters: RunParameters,
        timeout: float | None = None,
        messages: int | None = None,
        *,
        checked: bool = False,
    ) -> SearchResult:
        """Let all registered robots start a search by `protocol`, for at most `timeout` seconds.

        If there is a `watch`, it receives snapshots. If `checked`, it receives only snapshots that all robots have
        checked (`snapshots`).

        Raises:
            RobotsLostError: if robots are lost and the run does not survive that, or messages are permanently lost.
            UnsupportedError: if a robot's problem is too large, or not supported by the protocol.
        """
        began = time.monotonic()
        self.events.start_search()
        deadline = None if timeout is None else began + timeout
        self._policy.open_ways(self.members.reach(writes_to_non_neighbours=traits.writes_to_non_neighbours))
        epoch, declared = self.state.epoch + 1, self.members.declared(traits)
        state = self.state = AuditedSearchState(epoch, self.members.order, messages, declared)
        state.drops = parameters.message_loss > 0
        state.lossy = state.drops and traits.bears_loss
        self.snapshots = CheckedSnapshots(state, self.members, self._send) if checked else None
        for name, task in self.members.tasks(epoch, protocol, traits, parameters).items():
            self._send(name, task)
        self._search_until(deadline)
        if self.snapshots and self.watch and not state.lost:
            self.watch.wants_snapshot(time.monotonic())  # do due work without waiting for the reports
        state.note_end(time.monotonic() - began, in_time=not (is_past(deadline) or self.is_to_stop))
        self._collect()
        return state.result(state.duration_s)

    def _ask_for_snapshot(self, number: int) -> None:
        if self.snapshots:
            self.snapshots.ask(number)
        else:
            super()._ask_for_snapshot(number)

    def _snapshot(self) -> SearchResult | None:
        return self.snapshots.advance() if self.snapshots else super()._snapshot()

    def adopt(self, number: int, why: str = "") -> None:
        """Order all robots to keep their values in a snapshot, or (with a `why`) to decide on them. See `Adopt`."""
        self._send_all(Adopt(self.state.epoch, number, why))

    def _order_start(self) -> None:
        self._send_all(StartSearch(self.state.epoch))
        self.events.start_search()

    def _collect(self) -> None:
        """End the search, and collect all reports. Raises `RobotsLostError` if the search was stuck."""
        state = self.state
        self._send_all(Pause())
        patience_s = REPORTS_S if state.verdict is None else REPORTS_S + HELD_S
        self._serve_until(lambda: not state.pending_reports, time.monotonic() + patience_s)
        for name in state.pending_reports if state.verdict is not None else ():
            self._lose(name, "it did not report at the end")
        doubts = self.events.doubted(state.doubts_about_counts)
        if state.stuck:
            raise RobotsLostError({MASTER: state.stuck + doubts})

    def checked(self, assignments: Mapping[str, Mapping[str, int]]) -> tuple[bool, float]:
        """Let every robot check its constraints against `assignments`. Not available in private runs.

        Returns:
            True if all constraints are satisfied, and the sum of their costs.

        Raises:
            RobotsLostError: if robots are lost, or do not finish the check in time.
        """
        state = self.state
        for name in self.members.order:
            self._send(name, CheckRequest(state.epoch, self.members.neighbourhood(name, assignments)))
        away_s = REPORTS_S + self._settings.patience_s + self._settings.lease_ms / 1000
        self._serve_until(lambda: not state.unchecked, time.monotonic() + away_s)
        if state.unchecked or state.lost:
            raise RobotsLostError(state.lost or {MASTER: "robots have not checked their constraints in time"})
        return state.held, state.cost

    def leave(self, why: str, *, failed: bool = False, elsewhere: bool = False, farewell_s: float = FAREWELL_S) -> None:
        """Announce the end of the run until all robots confirm it, even those that have just joined or returned.

        `elsewhere`: another master may complete the run, if robots know one.
        """
        leave, until = Leave(why, failed, elsewhere and self.votes.is_needed), time.monotonic() + farewell_s
        if elsewhere:
            self._standbys.resign()
        else:
            self._standbys.end(why, failed=failed)
        self._has_ended = True
        staying = partial(self.members.staying, FAREWELL_S, besides=self.state.lost)
        with suppress(RobotsLostError, UnsupportedError):
            # A run may end before the next check of the directory.
            self._notify_subscribers()
            self._send_all(leave)
            while (staying() or self._standbys.waiting) and not is_past(until):
                self._serve_until(lambda: not (staying() or self._standbys.waiting), time.monotonic() + AGAIN_S)
                self._send_all(leave)
            self._serve_until(lambda: not self._journal_server.lagging, time.monotonic() + FAREWELL_S)

    def lose(self, name: str, why: str) -> None:
        """Record that the process of the robot `name` has ended. May be called from any thread."""
        self._dead[name] = why
        self._connection.wake()
