"""The stages of a run with a deadline: several protocols search in turn, each from the best assignment known so far.

A local search finds a good assignment early; a complete search then looks for cheaper ones only, and proves a bound.
`run/choice_stages.py` chooses the stages.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

from robochoc.communication.search_result import SearchResult
from robochoc.model.outcome import Metrics
from robochoc.model.problem import INFINITE
from robochoc.protocols.chance import Chance
from robochoc.run.incumbent import known_assignments
from robochoc.run.phases import RunPhase
from robochoc.run.starts import robots_values
from robochoc.solver.agent_problem import RunParameters
from robochoc.solver.compiled_team import CompiledTeam
from robochoc.verification.objective import Objective

Own = Mapping[str, Mapping[str, int]]
"""The values of each robot's variables."""


class Restarts:
    """The restarts of a local search: each search begins from the best assignment, except for a few robots.

    Args:
        compiled: The team.
        phase: The phase of the searches, with the start of the first one.
    """

    def __init__(self, compiled: CompiledTeam, phase: RunPhase) -> None:
        self._compiled = compiled
        self._phase = phase
        self._objective = Objective(compiled.team, phase.parameters.withdrawal_cost)
        self._least = INFINITE if phase.start_cost is None else phase.start_cost
        self._best: Own | None = robots_values(compiled.team, phase.parameters.start)
        self._spent = Metrics()
        self.searches = 0
        """The number of searches so far."""

    def add(self, result: SearchResult) -> None:
        """Process the result of a search."""
        self.searches += 1
        self._spent += result.metrics
        found = known_assignments(self._compiled, result, self._objective)
        for own in [result.best_cycle] if result.best_cycle else found:
            cost = min(result.cycle_costs) if own is result.best_cycle else self._cost(own)
            if cost <= self._least and cost < INFINITE:
                self._least, self._best = cost, own

    def _cost(self, own: Own) -> float:
        self._objective.reset()
        self._objective.change(own)
        return self._objective.cost

    @property
    def next_parameters(self) -> RunParameters:
        """The parameters of the next search. Robots that do not keep their values choose random ones."""
        parameters, kept = self._phase.parameters, self._phase.kept or 0
        seed = parameters.seed + self.searches
        keeping = [own for name, own in (self._best or {}).items() if Chance(seed, f"restart {name}")() < kept]
        start = {variable: value for own in keeping for variable, value in own.items()}
        return parameters._replace(seed=seed, start=start)

    def result(self, last: SearchResult) -> SearchResult:
        """Return the result of all searches: `last`, with the best assignment as the robots' values."""
        best = None if self._best is None or self._least == INFINITE else self._best
        values = last.assignments if best is None else {name: dict(own) for name, own in best.items()}
        return replace(last, assignments=values, metrics=replace(self._spent, memory=last.metrics.memory))
