"""The settings of a robot in a run across machines, as its owner chooses them."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

from robochoc.solver.compiled_team import CompileRobot
from robochoc.solver.domain import compile_domain


def _ignore(*_arguments: object) -> None:
    """Do nothing."""


@dataclass(frozen=True)
class RobotSettings:
    """The settings of a robot.

    Attributes:
        patience_s: How long the master may be gone.
        sniffed: The master's observers receive all events of the robot, even if they do not ask for them.
        set_rank: Called before each search with the robot's place in the priority order, and the number of robots.
        stage: Called with a short text on how far the robot is.
        decided: Called with the verdict in words, and the robot's values, when the team has a decision and searches on.
        compiled: Compiles the robot's domain again, should others have to see more of its variables than it knew.
    """

    patience_s: float = 10.0
    sniffed: bool = False
    set_rank: Callable[[int, int], None] = _ignore
    stage: Callable[[str], None] = _ignore
    decided: Callable[[str, Mapping[str, int]], None] = _ignore
    compiled: CompileRobot = compile_domain


DEFAULT_SETTINGS = RobotSettings()
