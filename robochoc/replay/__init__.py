"""Playing a recorded run again: the same protocol objects, the same packets, and what comes of them."""

from robochoc.replay.claims import Contradiction
from robochoc.replay.rebuild import CannotReplayError, ReplayOptions
from robochoc.replay.replay import Difference, ReplayResult, StoppedRobot, replay
from robochoc.replay.robot_states import Choice, RobotState, states_of

__all__ = [
    "CannotReplayError",
    "Choice",
    "Contradiction",
    "Difference",
    "ReplayOptions",
    "ReplayResult",
    "RobotState",
    "StoppedRobot",
    "replay",
    "states_of",
]
