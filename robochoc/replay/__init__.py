"""Playing a recorded run again: the same protocol objects, the same packets, and what comes of them."""

from robochoc.replay.ending import Contradiction
from robochoc.replay.insight import Choice, State, states_of
from robochoc.replay.rebuild import CannotReplayError, Means
from robochoc.replay.replay import Difference, Replayed, Stopped, replay

__all__ = [
    "CannotReplayError",
    "Choice",
    "Contradiction",
    "Difference",
    "Means",
    "Replayed",
    "State",
    "Stopped",
    "replay",
    "states_of",
]
