"""The best cost of a team, computed once by a complete protocol or a central solver."""

from __future__ import annotations

import math
from collections.abc import Mapping
from decimal import Decimal

from robochoc.model.cost_units import Cost
from robochoc.model.outcome import Verdict
from robochoc.model.problem import ProblemKind, Team
from robochoc.model.symbols import on_grids, real_places
from robochoc.run.defaults import AUTO, CENTRAL
from robochoc.run.options import Options, Runtime
from robochoc.run.orchestrator import solve
from robochoc.run.registry import protocol_named
from robochoc.solver.errors import UnsupportedError
from robochoc.system.lazy_dataclass import dataclass
from robochoc.system.plain_text import listed

TIMEOUT_S = 60.0
"""The time limit for the computation of an optimum, in seconds."""


@dataclass(frozen=True)
class Optimum:
    """The best cost of a team, and how it was certified.

    Attributes:
        verdict: `optimal` (with costs) or `solution` (without) if the optimum is known, `no-solution` if the hard
            constraints have no solution, `unknown` if the time limit was reached.
        cost: The optimum in the user's units; None if there is none or it is unknown.
        assignment: An assignment with this cost; empty if there is none.
        certified_by: The protocol or the solvers that proved it, and those that confirmed it, as text. Empty if the
            optimum is unknown.
    """

    verdict: Verdict
    cost: Cost | None
    assignment: Mapping[str, int]
    certified_by: str

    def regret(self, cost: Cost | None) -> float | None:
        """Return by how much `cost`, in the user's units, is worse than the optimum.

        Infinite if `cost` is None, since a hard constraint is violated; None if there is no known optimum.
        """
        if self.cost is None:
            return None
        return math.inf if cost is None else abs(float(Decimal(cost) - Decimal(self.cost)))


def certified_optimum(team: Team, protocol: str = CENTRAL, timeout_s: float = TIMEOUT_S) -> Optimum:
    """Return the best cost of `team`. Real variables have the values on the grids of the files.

    Args:
        team: The team.
        protocol: A complete protocol, which runs in the simulator, or `central`: the central solver.
        timeout_s: The time limit, in seconds.

    Raises:
        UnknownProtocolError: if the protocol is not installed.
        UnsupportedError: if the protocol is incomplete, or does not accept the team.
    """
    if protocol not in {AUTO, CENTRAL} and not protocol_named(protocol).traits.complete:
        raise UnsupportedError(f"{protocol} is incomplete and cannot prove an optimum: choose a complete protocol")
    runtime = Runtime.PROCESSES if protocol == CENTRAL else Runtime.SIMULATOR
    team = on_grids(team) if real_places(team) else team
    outcome = solve(team, Options(protocol=protocol, runtime=runtime, timeout=timeout_s))
    proven = Verdict.SOLUTION if team.kind == ProblemKind.DISCSP else Verdict.OPTIMAL
    if outcome.verdict != proven:
        known = outcome.verdict == Verdict.NO_SOLUTION
        verdict = Verdict.NO_SOLUTION if known else Verdict.UNKNOWN
        return Optimum(verdict, None, {}, outcome.protocol if known else "")
    solvers = f" ({listed(outcome.solved_by)})" if outcome.solved_by else ""
    cost = 0 if outcome.cost is None else outcome.cost
    return Optimum(outcome.verdict, cost, outcome.assignment, f"{outcome.protocol}{solvers}")
