"""Replay of a recorded run: its protocol objects process the same packets again, and the results are compared."""

from robochoc.replay.claims import Contradiction
from robochoc.replay.comparison import StepDifference
from robochoc.replay.rebuild import CannotReplayError, ReplayOptions
from robochoc.replay.replay import ReplayResult, StoppedRobot, replay
from robochoc.replay.robot_states import RobotState, TeamStates, ValueState, states_of

__all__ = [
    "CannotReplayError",
    "Contradiction",
    "ReplayOptions",
    "ReplayResult",
    "RobotState",
    "StepDifference",
    "StoppedRobot",
    "TeamStates",
    "ValueState",
    "replay",
    "states_of",
]
