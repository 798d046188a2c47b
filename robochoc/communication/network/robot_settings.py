"""The settings of a robot in a run across machines, chosen by its owner."""

from __future__ import annotations

from collections.abc import Callable, Mapping

from robochoc.solver.compiled_domain import compile_domain
from robochoc.solver.compiled_team import CompileRobot
from robochoc.system.lazy_dataclass import dataclass


def _ignore(*_arguments: object) -> None:
    """Do nothing."""


@dataclass(frozen=True)
class RobotSettings:
    """The settings of a robot.

    Attributes:
        patience_s: The seconds for which the master may be absent.
        sniffed: True if the master's observers always receive all events of the robot.
        set_rank: Called before each search with the robot's index in the priority order, and the number of robots.
        stage: Called with a short text on the robot's progress.
        decided: Called with the verdict in words and the robot's values when the team has a decision but continues.
        lost_master: Called with the address of a master, and the reason why the robot looks for another one.
        compiled: Compiles the robot's domain again if the robot must disclose more variables than expected.
    """

    patience_s: float = 10.0
    sniffed: bool = False
    set_rank: Callable[[int, int], None] = _ignore
    stage: Callable[[str], None] = _ignore
    decided: Callable[[str, Mapping[str, int]], None] = _ignore
    lost_master: Callable[[str, str], None] = _ignore
    compiled: CompileRobot = compile_domain


DEFAULT_SETTINGS = RobotSettings()
