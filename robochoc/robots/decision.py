"""A decision with feedback on its progress, which can be cancelled."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Mapping
from contextlib import suppress
from typing import Any

import msgspec

from robochoc.communication.search_result import Progress
from robochoc.journal.events import AnyEvent, Decided, Given, Heard
from robochoc.journal.recorder import interfaces_given
from robochoc.journal.team_events import TeamReader
from robochoc.model.outcome import Outcome
from robochoc.model.problem import INFINITE, Team
from robochoc.run.options import Options
from robochoc.run.orchestrator import solve
from robochoc.run.recording import objective_to_record
from robochoc.system.stopping import request_stop, stop_handled
from robochoc.verification.objective import Objective

PERIOD_S = 0.5
"""The shortest time between two messages of feedback, in seconds."""
FEEDBACK_CHARACTERS_MAX = 128 * 1024
"""The maximum length of feedback, in characters. Assignments that would exceed it are left out."""

SendFeedback = Callable[[str], None]
"""Sends feedback, as JSON on one line."""


class CancellableDecision:
    """Solves the problems of teams, one at a time. Any thread may cancel the current search.

    Args:
        send: Called with feedback during a search. None: no feedback, and events are ignored.
    """

    def __init__(self, send: SendFeedback | None = None) -> None:
        self._send_text = send
        self._lock = threading.Lock()
        self._team = ""

    def __call__(self, team: Team, options: Options) -> Outcome:
        """Return the outcome. Raises the errors of `solve`."""
        feedback = None if self._send_text is None else _Feedback(team, options, self._send_text)
        with stop_handled():
            self._set_team(team.name)
            try:
                if feedback is None:
                    return solve(team, options)
                outcome = solve(team, options, observer=feedback.observe, progress=feedback.progress)
                feedback.end(outcome.verdict.value)
                return outcome
            finally:
                self._set_team("")

    def send_feedback_to(self, send: SendFeedback | None) -> None:
        """Send the feedback on later decisions to `send`; None: send no feedback."""
        self._send_text = send

    def cancel(self, _: object = None) -> dict[str, Any]:
        """Cancel the current decision; return the answer to the request `std_srvs/Trigger_Request`.

        The decision ends with the best known assignment, as if its time were over, and its request is then answered.
        """
        with self._lock:
            if not self._team:
                return {"success": False, "message": "no team is deciding"}
            request_stop()
            return {"success": True, "message": f"the decision of {self._team} is cancelled"}

    def _set_team(self, team: str) -> None:
        with self._lock:
            self._team = team


class _Feedback:
    """Feedback on one decision: its duration, its number of messages, and the cheapest assignment so far."""

    def __init__(self, team: Team, options: Options, send: SendFeedback) -> None:
        self._team, self._send_text = team, send
        self._started_s = time.monotonic()
        self._sent_s = self._started_s
        self._lock = threading.Lock()
        self._events: list[AnyEvent] = []
        self._messages = 0
        self._own: dict[str, Mapping[str, int]] = {}
        self._last_t: float | None = None
        self._best: float = INFINITE
        self._assignment: dict[str, int] = {}
        self._objective: Objective | None = None
        self._reader = TeamReader()
        with suppress(Exception):  # `solve` reports errors in the team
            objective = objective_to_record(team, options)
            self._objective = objective and objective()

    def observe(self, event: AnyEvent) -> None:
        """Store an event, in any thread."""
        if isinstance(event, Decided | Heard | Given):
            with self._lock:
                self._events.append(event)

    def progress(self, progress: Progress) -> None:
        """Send the progress, at most once in `PERIOD_S`."""
        self._messages = max(self._messages, progress.messages)
        now = time.monotonic()
        if now - self._sent_s >= PERIOD_S:
            self._sent_s = now
            self._send({"state": "deciding"})

    def end(self, verdict: str) -> None:
        """Send the verdict."""
        self._send({"state": "decided", "verdict": verdict})

    def _send(self, first: Mapping[str, object]) -> None:
        self._apply_events()
        report: dict[str, object] = {
            "team": self._team.name,
            **first,
            "elapsed_s": round(time.monotonic() - self._started_s, 3),
            "messages": self._messages,
            "robots": len(self._team.robots),
            "decided": sum(map(bool, self._own.values())),
        }
        if self._objective is not None and self._best < INFINITE:
            best = {"cost": str(self._objective.in_user_units(self._best)), "assignment": self._assignment}
            if len(msgspec.json.encode(best)) <= FEEDBACK_CHARACTERS_MAX:
                report |= best
        self._send_text(msgspec.json.encode(report).decode())

    def _apply_events(self) -> None:
        """Apply the events since the last call."""
        with self._lock:
            events, self._events = self._events, []
        for event in events:
            match event:
                case Given() if self._objective is not None:
                    self._objective.interfaces = interfaces_given(self._reader, event)
                case Decided():
                    self._decided(event)
                case Heard() if self._objective is not None:
                    shown = self._objective.shown(event.values)
                    if shown is not None:
                        self._update_best(float(event.cost), shown)
                case _:
                    pass

    def _decided(self, event: Decided) -> None:
        """Apply a robot's decision. States between simultaneous decisions do not count."""
        objective = self._objective
        if objective is not None and objective.in_step and self._last_t not in {None, event.t}:
            self._update_best(objective.cost, self._own)
        self._last_t = event.t
        self._own[event.robot] = event.assignment
        if objective is not None:
            objective.change({event.robot: event.assignment})
            if not objective.in_step:
                self._update_best(objective.cost, self._own)

    def _update_best(self, cost: float, own: Mapping[str, Mapping[str, int]]) -> None:
        """Store `own` if it is cheaper than the best assignment so far."""
        if cost < self._best:
            self._best = cost
            self._assignment = {name: value for robot in sorted(own) for name, value in own[robot].items()}
