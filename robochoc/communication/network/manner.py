"""How a robot takes part in a run across machines, as its owner wants it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from robochoc.solver.compiled_team import CompileRobot
from robochoc.solver.domain import compile_domain


def _nothing(*_told: object) -> None:
    """Who is told things that nobody wants to know."""


@dataclass(frozen=True)
class Manner:
    """How a robot takes part.

    `patience_s` is how long the master may be gone. `sniffed`: the master's observers are to be told of all that the
    robot does, even if they do not ask for it. `place` is told the robot's place in the priority order, and how many
    robots there are, before each search; `stage` in a few words how far it is. `compiled` compiles the robot's domain
    again, should others have to see more of its variables than it knew.
    """

    patience_s: float = 10.0
    sniffed: bool = False
    place: Callable[[int, int], None] = _nothing
    stage: Callable[[str], None] = _nothing
    compiled: CompileRobot = compile_domain


AS_USUAL = Manner()
