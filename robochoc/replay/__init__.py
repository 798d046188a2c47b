"""Replay of a recorded run: the same protocol objects with the same packets, and the results compared."""

from robochoc.replay.claims import Contradiction
from robochoc.replay.comparison import Difference
from robochoc.replay.rebuild import CannotReplayError, ReplayOptions
from robochoc.replay.replay import ReplayResult, StoppedRobot, replay
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
