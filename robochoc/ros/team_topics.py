"""Topics of the whole team besides waypoints: frames for tf2 (`--tf`), and the run's state (`--diagnostics`)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from types import MappingProxyType

from robochoc.flight.layout import Point
from robochoc.flight.mission import Leg
from robochoc.formats.diagnostics import on_one_line
from robochoc.model.outcome import Verdict
from robochoc.robots.sink import Fields
from robochoc.ros.names import TEAM_TOPICS
from robochoc.ros.waypoint_types import UPRIGHT, point
from robochoc.system.lazy_dataclass import dataclass

GOAL, BODY = "goal", "base_link"
"""The last parts of the names of a drone's frames: its goal, and the drone itself."""
_LEVELS: Mapping[Verdict, int] = MappingProxyType(
    {Verdict.SOLUTION: 0, Verdict.OPTIMAL: 0, Verdict.UNKNOWN: 1, Verdict.NO_SOLUTION: 2}
)
"""The levels OK, WARN and ERROR of `diagnostic_msgs/DiagnosticStatus`."""


@dataclass(frozen=True)
class PublishOptions:
    """The type of waypoints, and the other messages to publish."""

    kind: str = ""
    """The ROS type of all waypoints; if empty, the types in the robots' files are used."""
    frames: bool = False
    """True: publish goals as frames on `/tf_static`, and flying drones as frames on `/tf`."""
    diagnostics: bool = False
    """True: publish each decision as a status on `/diagnostics`."""

    @property
    def topics(self) -> dict[str, str]:
        """The topics for the whole team, and their types."""
        used = {"/tf": self.frames, "/tf_static": self.frames, "/diagnostics": self.diagnostics}
        return {topic: kind for topic, kind in TEAM_TOPICS.items() if used[topic]}


WAYPOINTS_ONLY = PublishOptions()
"""Waypoints with the types in the robots' files, and no other messages."""


def transform(header: Fields, child: str, at: Point, rotation: Fields = UPRIGHT) -> Fields:
    """Return the fields of a `geometry_msgs/TransformStamped`. In tf2, frame names have no leading slash."""
    return {
        "header": header,
        "child_frame_id": child.removeprefix("/"),
        "transform": {"translation": point(at), "rotation": rotation},
    }


def transforms(found: Sequence[Fields]) -> Fields:
    """Return the fields of a `tf2_msgs/TFMessage`."""
    return {"transforms": [*found]}


def status(team: str, leg: Leg, epoch: int, header: Fields) -> Fields:
    """Return the fields of a `diagnostic_msgs/DiagnosticArray`: the decision of an epoch, numbered from 1."""
    landings = sum(goal.lands for goal in leg.goals.values())
    values = {
        "verdict": leg.verdict.value,
        "epoch": epoch,
        "opened by": on_one_line(leg.opened_by),
        "cost": "" if leg.cost is None else leg.cost,
        "waypoints": len(leg.goals) - landings,
        "landings": landings,
    }
    described = {
        "level": _LEVELS[leg.verdict],
        "name": on_one_line(f"robochoc: {team}" if team else "robochoc"),
        "message": f"{leg.verdict.value}, epoch {epoch}",
        "hardware_id": on_one_line(team),
        "values": [{"key": name, "value": str(value)} for name, value in values.items()],
    }
    return {"header": {**header, "frame_id": ""}, "status": [described]}
