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
from robochoc.journal.given import TeamReader
from robochoc.journal.recorder import interfaces_given
from robochoc.model.outcome import Outcome
from robochoc.model.problem import INFINITE, Team
from robochoc.robots.sink import Fields
from robochoc.run.options import Options
from robochoc.run.orchestrator import solve
from robochoc.run.recording import objective_to_record
from robochoc.system.stopping import request_stop, stop_heard
from robochoc.verification.objective import Objective

PERIOD_S = 0.5
"""The shortest time between two messages of feedback, in seconds."""
FEEDBACK_CHARACTERS_MAX = 128 * 1024
"""An assignment that makes feedback longer is left out."""

Tell = Callable[[str], None]
"""Takes feedback, as JSON on one line."""


class CancellableDecision:
    """Solves teams' problems, one at a time. Any thread may cancel the current search.

    Args:
        tell: Called with feedback during a search (None: no feedback, and events are ignored).
    """

    def __init__(self, tell: Tell | None = None) -> None:
        self._tell = tell
        self._lock = threading.Lock()
        self._team = ""

    def __call__(self, team: Team, options: Options) -> Outcome:
        """Return the outcome. Raises the errors of `solve`."""
        feedback = None if self._tell is None else _Feedback(team, options, self._tell)
        with stop_heard():
            self._is_now(team.name)
            try:
                if feedback is None:
                    return solve(team, options)
                outcome = solve(team, options, observer=feedback.observe, progress=feedback.progress)
                feedback.end(outcome.verdict.value)
                return outcome
            finally:
                self._is_now("")

    def cancel(self, _: Fields) -> dict[str, Any]:
        """Return the answer to a request `std_srvs/Trigger_Request` to decide no longer.

        The decision ends with the best that is known, as at the end of its time, and is then answered.
        """
        with self._lock:
            if not self._team:
                return {"success": False, "message": "no team is deciding"}
            request_stop()
            return {"success": True, "message": f"{self._team} decides no longer"}

    def _is_now(self, team: str) -> None:
        with self._lock:
            self._team = team


class _Feedback:
    """Follows one decision: how long it takes, how many messages it took, and the cheapest assignment so far."""

    def __init__(self, team: Team, options: Options, tell: Tell) -> None:
        self._team, self._tell = team, tell
        self._began = time.monotonic()
        self._told = self._began
        self._lock = threading.Lock()
        self._events: list[AnyEvent] = []
        self._messages = 0
        self._own: dict[str, Mapping[str, int]] = {}
        self._best: float = INFINITE
        self._assignment: dict[str, int] = {}
        self._objective: Objective | None = None
        self._reader = TeamReader()
        with suppress(Exception):  # `solve` says what is wrong with the team
            objective = objective_to_record(team, options)
            self._objective = objective and objective()

    def observe(self, event: AnyEvent) -> None:
        """Take an event, in any thread."""
        if isinstance(event, Decided | Heard | Given):
            with self._lock:
                self._events.append(event)

    def progress(self, progress: Progress) -> None:
        """Tell how far it is, not too often."""
        self._messages = max(self._messages, progress.messages)
        now = time.monotonic()
        if now - self._told >= PERIOD_S:
            self._told = now
            self._say({"state": "deciding"})

    def end(self, verdict: str) -> None:
        """Tell that it is over."""
        self._say({"state": "decided", "verdict": verdict})

    def _say(self, first: Mapping[str, object]) -> None:
        self._follow()
        told: dict[str, object] = {
            "team": self._team.name,
            **first,
            "elapsed_s": round(time.monotonic() - self._began, 3),
            "messages": self._messages,
            "robots": len(self._team.robots),
            "decided": sum(map(bool, self._own.values())),
        }
        if self._objective is not None and self._best < INFINITE:
            best = {"cost": str(self._objective.told(self._best)), "assignment": self._assignment}
            if len(msgspec.json.encode(best)) <= FEEDBACK_CHARACTERS_MAX:
                told |= best
        self._tell(msgspec.json.encode(told).decode())

    def _follow(self) -> None:
        """Go through the events since the last time."""
        with self._lock:
            events, self._events = self._events, []
        for event in events:
            match event:
                case Given() if self._objective is not None:
                    self._objective.interfaces = interfaces_given(self._reader, event)
                case Decided():
                    self._own[event.robot] = event.assignment
                    if self._objective is not None:
                        self._objective.change({event.robot: event.assignment})
                        self._weigh(self._objective.cost, self._own)
                case Heard() if self._objective is not None:
                    shown = self._objective.shown(event.values)
                    if shown is not None:
                        self._weigh(float(event.cost), shown)
                case _:
                    pass

    def _weigh(self, cost: float, own: Mapping[str, Mapping[str, int]]) -> None:
        """Keep `own` if it is cheaper than all before."""
        if cost < self._best:
            self._best = cost
            self._assignment = {name: value for robot in sorted(own) for name, value in own[robot].items()}
