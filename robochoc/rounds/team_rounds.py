"""The state of a team whose robots choose values in synchronous rounds.

Each robot knows only its own problem: every constraint in whose scope it is (of a partially known constraint, its own
part), and the values that its neighbours announced in the previous round.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from robochoc.formats import check_team
from robochoc.model.cost_units import Cost
from robochoc.model.costs import normalized
from robochoc.model.problem import Team, Value
from robochoc.solver.agent_problem import agent_problems
from robochoc.solver.compile import Compiler
from robochoc.solver.compiled_team import CompiledTeam
from robochoc.solver.errors import UnsupportedError
from robochoc.solver.local_problem import LexicographicCost, LocalProblem
from robochoc.verification.objective import Objective, withdrawal_cost


class TeamRounds:
    """The robots' local problems, their present values, and the values that they have announced.

    Args:
        team: The team. A scenario is not supported.
        violation_cost: The cost of a violated hard constraint in `weighed`. None: one more than the sum of the largest
            costs of all constraints, so that fewer violations are always better.

    Attributes:
        team: The team with normalised costs: non-negative integers, of which the sum is minimised (`model/costs.py`).
        compiled: The team with the compiled domain of each robot.
        problems: The local problem of each robot, in priority order. Values are indices of `LocalProblem.values`.
        values: The present value of each robot; empty before `choose`.
        announced: The value that each robot has announced to its neighbours.
        violation_cost: See above.

    Raises:
        InvalidInputError: if the team is not valid.
        UnsupportedError: if the team has a scenario, or a robot has no possible value.
        CompileError: if the domain of a robot cannot be compiled.
    """

    def __init__(self, team: Team, violation_cost: float | None = None) -> None:
        check_team(team)
        if team.dynamic:
            raise UnsupportedError(f"{team.name} has a scenario: rounds need a problem that does not change")
        self.team = normalized(team)
        with Compiler() as compiler:
            self.compiled = CompiledTeam(self.team, lambda robot: compiler.compile(robot).domain)
        parts = agent_problems(self.compiled, shared_scopes=True)
        self.problems = {name: LocalProblem(part) for name, part in parts.items()}
        for name, problem in self.problems.items():
            if not problem.values:
                raise UnsupportedError(
                    f"{name} has no possible value: relax its private constraints, which exclude all of them"
                )
        self.violation_cost = withdrawal_cost(self.team) if violation_cost is None else violation_cost
        self._objective = Objective(self.team)
        self.values: dict[str, int] = {}
        self.announced: dict[str, Value] = {}

    def choose(self, values: Mapping[str, int], announced: Mapping[str, int] | None = None) -> None:
        """Set the values of robots, which announce them to their neighbours.

        Args:
            values: The index of the value of each robot that changes its value.
            announced: The indices that robots announce instead of their values, if these differ.
        """
        self.values.update(values)
        for name, index in {**values, **(announced or {})}.items():
            self.announced[name] = self.problems[name].values[index]
        self._objective.change({name: self.problems[name].solution(index) for name, index in values.items()})

    def view(self, robot: str) -> dict[str, Value]:
        """Return the announced values of the neighbours of `robot`."""
        return {name: self.announced[name] for name in self.problems[robot].neighbours if name in self.announced}

    def costs(self, robot: str) -> list[LexicographicCost]:
        """Return the cost of each value of `robot` if its neighbours have the values that they announced."""
        return self.problems[robot].lexicographic_costs(self.view(robot))

    def weighed(self, cost: LexicographicCost) -> float:
        """Return `cost` as a number, in which a violation costs `violation_cost`."""
        return cost[0] * self.violation_cost + cost[1]

    @property
    def team_cost(self) -> LexicographicCost:
        """The cost of the present values in all constraints, in normalised costs."""
        return self._objective.shortfall

    @property
    def user_cost(self) -> Cost | None:
        """The cost of the present values in the user's units; None if a hard constraint is violated."""
        broken, cost = self.team_cost
        return None if broken else self._objective.in_user_units(cost)

    def assignment(self, values: Mapping[str, int] | None = None) -> dict[str, int]:
        """Return the values of all variables for the robots' `values` (None: the present ones)."""
        chosen = self.values if values is None else values
        parts = [self.problems[robot].solution(index) for robot, index in chosen.items()]
        return {name: value for part in parts for name, value in part.items()}

    def index_of(self, robot: str, assignment: Mapping[str, int]) -> int | None:
        """Return the index of the value of `robot` in `assignment`; None if `robot` cannot have this value."""
        shown: Sequence[str] = self.team[robot].interface
        if not all(name in assignment for name in shown):
            return None
        value = tuple(assignment[name] for name in shown)
        values = self.problems[robot].values
        return values.index(value) if value in values else None
