"""The action `decide`: a goal is a request to decide, its feedback the best assignment so far, its result the decision.

Its definition is `robochoc_msgs/action/Decide` (docs/ros2). A cancelled goal ends with the best assignment so far.
"""

from __future__ import annotations

from typing import Any

import msgspec

from robochoc.robots.decision import CancellableDecision, SendFeedback
from robochoc.robots.sink import Fields
from robochoc.ros.decide_service import DecideService
from robochoc.ros.live.action_goals import ActionGoals
from robochoc.ros.live.services import ServiceRequest

_BEST = ("cost", "variables", "values")


class DecideAction:
    """Decides the goals of an action, one at a time.

    Args:
        decider: Answers requests.
        decision: The decision that `decider` uses.
        goals: The goals.
        also: Receives the feedback of all decisions, as JSON; may be None.
    """

    def __init__(
        self, decider: DecideService, decision: CancellableDecision, goals: ActionGoals, also: SendFeedback | None
    ) -> None:
        self._decider, self._decision, self._goals, self._also = decider, decision, goals, also
        self._best: dict[str, Any] = {}

    def run(self, request: ServiceRequest) -> str:
        """Decide a goal from the queue; return its message."""
        if not self._goals.begin(request.client):
            return "cancelled"
        self._best = {}
        self._decision.send_feedback_to(self._receive)
        try:
            answer = self._decider.decide(request.fields)
        finally:
            self._decision.send_feedback_to(self._also)
        if not answer["success"] and self._best:
            answer |= self._best
            answer["message"] += "; the assignment is the best so far"
        self._goals.finish(answer)
        return str(answer["message"])

    def _receive(self, text: str) -> None:
        """Send feedback on the goal."""
        if self._also is not None:
            self._also(text)
        fields = feedback_fields(msgspec.json.decode(text))
        if fields["variables"]:
            self._best = {name: fields[name] for name in _BEST}
        self._goals.feedback(fields)


def feedback_fields(found: Fields) -> dict[str, Any]:
    """Return the fields of `robochoc_msgs/Decide_Feedback` for feedback on a decision."""
    assignment = found.get("assignment", {})
    return {
        "team": found["team"],
        "state": found["state"],
        "elapsed": found["elapsed_s"],
        "messages": found["messages"],
        "robots": found["robots"],
        "decided": found["decided"],
        "cost": found.get("cost", ""),
        "variables": [*assignment],
        "values": [*assignment.values()],
    }
