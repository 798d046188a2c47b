"""Topics of the whole team besides waypoints: frames for tf2 (`--tf`), and how the run stands (`--diagnostics`)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType

from robochoc.flight.layout import Point
from robochoc.flight.mission import Leg
from robochoc.formats.diagnostics import on_one_line
from robochoc.model.outcome import Verdict
from robochoc.robots.sink import Fields
from robochoc.ros.names import TEAM_TOPICS
from robochoc.ros.waypoint_types import UPRIGHT, point

GOAL, BODY = "goal", "base_link"
"""The last part of the frame where a drone is to be, and of the frame of the drone itself."""
_LEVELS: Mapping[Verdict, int] = MappingProxyType(
    {Verdict.SOLUTION: 0, Verdict.OPTIMAL: 0, Verdict.UNKNOWN: 1, Verdict.NO_SOLUTION: 2}
)
"""OK, WARN and ERROR of `diagnostic_msgs/DiagnosticStatus`."""


@dataclass(frozen=True)
class PublishOptions:
    """What is published besides the waypoints, and as what type these are."""

    kind: str = ""
    """The ROS type of all waypoints; empty: those that the robots' files name."""
    frames: bool = False
    """True: goals are frames on `/tf_static`, and drones that fly are frames on `/tf`."""
    diagnostics: bool = False
    """True: each decision is a status on `/diagnostics`."""

    @property
    def topics(self) -> dict[str, str]:
        """The topics of the team, and their types."""
        wanted = {"/tf": self.frames, "/tf_static": self.frames, "/diagnostics": self.diagnostics}
        return {topic: kind for topic, kind in TEAM_TOPICS.items() if wanted[topic]}


WAYPOINTS_ONLY = PublishOptions()
"""Nothing else, and as the files have it."""


def transform(header: Fields, child: str, at: Point, rotation: Fields = UPRIGHT) -> Fields:
    """Return the fields of a `geometry_msgs/TransformStamped`. A frame's name begins with no slash in tf2."""
    return {
        "header": header,
        "child_frame_id": child.removeprefix("/"),
        "transform": {"translation": point(at), "rotation": rotation},
    }


def transforms(found: Sequence[Fields]) -> Fields:
    """Return the fields of a `tf2_msgs/TFMessage`."""
    return {"transforms": [*found]}


def status(team: str, leg: Leg, epoch: int, header: Fields) -> Fields:
    """Return the fields of a `diagnostic_msgs/DiagnosticArray`: the decision of the epoch with that number, from 1."""
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
