"""The secrets of a team: the parts of the robots' problems that are initially unknown to other robots.

Besides the robots' values there are two kinds of secrets. First, the cost of each declared value of a robot in its
private constraints (`INFINITE` for an impossible value), which no other robot knows. Second, the cost of each
combination of declared values in a shared constraint, which the robots in its scope know; in a partially known
constraint, each robot knows only its part.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator, Mapping, Sequence
from typing import NamedTuple

from robochoc.model.absence import may_count_when_absent, restated
from robochoc.model.problem import INFINITE, Constraint, ConstraintModel, Robot
from robochoc.privacy.possible import PossibleCosts, Secret, Terms
from robochoc.protocols.disclosure import View
from robochoc.protocols.message import Value
from robochoc.protocols.wording import is_withdrawn
from robochoc.solver.agent_problem import RunParameters
from robochoc.solver.compiled_team import CompiledTeam
from robochoc.solver.explanation import constraints_above, parts_below
from robochoc.system.errors import RobochocError

MOST_SECRETS = 200_000
"""The maximum number of secrets: robots' values and entries of constraints."""


class TooManySecretsError(RobochocError, ValueError):
    """The team has too many values, or too large constraints."""


class _ConstraintSecrets(NamedTuple):
    """The secrets in a shared constraint, one for each combination of values.

    `places` contains, for each variable of the constraint, its robot and its index; `knowing` are the robots that know
    the constraint.
    """

    places: tuple[tuple[str, int], ...]
    owners: frozenset[str]
    knowing: frozenset[str]
    secrets: Mapping[Value, Secret]


class TeamSecrets:
    """The numbered secrets of a team. `truths` are the true costs.

    Attributes:
        declared: For each robot, all combinations of declared values of its interface variables, in ascending order,
            and the withdrawn value if robots may withdraw.
        charges: The secret costs of values in private constraints, by robot and value.
        entries: For each robot, the secrets in its shared constraints.
        most: The largest finite cost.
        neighbours: For each robot, the robots that share a constraint with it, or are linked with it in a file.
    """

    def __init__(self, team: CompiledTeam, parameters: RunParameters) -> None:
        self.truths: list[float] = []
        self.declared: dict[str, tuple[Value, ...]] = {}
        self.charges: dict[str, dict[Value, Secret]] = {}
        self.entries: dict[str, dict[Secret, frozenset[str]]] = {}
        """Each secret with the robots that know it initially."""
        self.neighbours: dict[str, set[str]] = {robot.name: set() for robot in team.team.robots}
        self.withdrawing: set[Secret] = set()
        """The costs of withdrawing, and of values that look like withdrawal: not counted, and never narrowed."""
        self._shared: dict[str, list[_ConstraintSecrets]] = {robot.name: [] for robot in team.team.robots}
        self._team = team.team
        self._may_withdraw = parameters.withdrawal_cost is not None
        self._places = {
            name: (robot.name, place) for robot in team.team.robots for place, name in enumerate(robot.interface)
        }
        for robot in team.team.robots:
            self._add_charges(robot, team, parameters)
        for robot in team.team.robots:
            for one in constraints_above(robot):
                self._add_constraint(one.constraint, robot.name)
            for _, part in parts_below(robot):
                self._add_constraint(part.constraint, robot.name)
            for other in (*(one.name for one in robot.parents), *(one.name for one in robot.children)):
                self._link(robot.name, other)
        finite = (int(cost) for number, cost in enumerate(self.truths) if self._is_counted_cost(number, cost))
        self.most = max(finite, default=0)

    def known_from_the_start(self, observer: str) -> Iterator[tuple[Secret, PossibleCosts]]:
        """Yield the secrets that `observer` knows initially, with their costs."""
        for secret in self.charges[observer].values():
            yield secret, exactly(self.truths[secret])
        for secret, knowing in self.entries[observer].items():
            if observer in knowing:
                yield secret, exactly(self.truths[secret])

    def unknown_charges(self, subject: str, observer: str) -> list[Secret]:
        """Return the charges of `subject` that `observer` does not know initially."""
        found = self.charges[subject].values() if subject != observer else ()
        return [secret for secret in found if secret not in self.withdrawing]

    def unknown_entries(self, subject: str, observer: str) -> list[Secret]:
        """Return the entries in constraints that `subject` knows, but `observer` does not know initially."""
        return [one for one, knowing in self.entries[subject].items() if subject in knowing and observer not in knowing]

    def own_cost(self, robot: str, value: Value, view: View) -> Terms:
        """Return the secrets whose sum is the own cost of `value` of `robot` in `view` (`protocols/disclosure.py`)."""
        charge = self.charges[robot].get(value)
        terms = [] if charge is None else [charge]
        return tuple(terms + self._between({**view, robot: value}, self._shared[robot]))

    def filtered(self, robot: str, value: Value, other: str, theirs: Value, *, parts_only: bool) -> Terms:
        """Return the secrets for a pair of values in the constraints between two robots that `robot` knows.

        With `parts_only`, only the parts of partially known constraints that `robot` knows count.
        """
        view = {robot: value, other: theirs}
        own = [one for one in self._shared[robot] if robot in one.knowing]
        return tuple(self._between(view, [one for one in own if not parts_only or one.knowing == {robot}]))

    def among(self, view: View) -> Terms:
        """Return the secrets for `view` in all constraints among the robots in `view`."""
        shared = {id(one): one for robot in view for one in self._shared[robot]}
        return tuple(self._between(view, list(shared.values())))

    def total(self, view: View) -> Terms:
        """Return the secrets whose sum is the cost of `view` by private constraints and those among its robots."""
        charged = [self.charges[robot][value] for robot, value in view.items() if value in self.charges[robot]]
        return (*charged, *self.among(view))

    def completions(self, view: View) -> Iterator[View]:
        """Yield all completions of `view` by values for its irrelevant variables (None)."""
        every = [self._matching(robot, value) for robot, value in view.items()]
        if math.prod(map(len, every)) <= MOST_SECRETS:
            for values in itertools.product(*every):
                yield dict(zip(view, values, strict=True))

    def _matching(self, robot: str, value: Value) -> Sequence[Value]:
        """Return the declared values of `robot` that equal `value` wherever `value` is not None."""
        if is_withdrawn(value) or None not in value:
            return [value]
        return [
            one
            for one in self.declared[robot]
            if not is_withdrawn(one) and all(wanted in (None, part) for wanted, part in zip(value, one, strict=True))
        ]

    def _is_counted_cost(self, secret: Secret, cost: float) -> bool:
        return cost < INFINITE and secret not in self.withdrawing

    def _between(self, view: View, shared: Sequence[_ConstraintSecrets]) -> list[Secret]:
        """Return the secrets in the constraints whose robots are all in `view`.

        Constraints that are dropped because of a withdrawn robot have no secrets.
        """
        found = []
        for one in shared:
            if all(owner in view for owner in one.owners):
                secret = one.secrets.get(tuple([view[robot][place] for robot, place in one.places]))
                found += [] if secret is None else [secret]
        return found

    def _add_charges(self, robot: Robot, team: CompiledTeam, parameters: RunParameters) -> None:
        columns = [sorted(self._team.variables[name].domain) for name in robot.interface]
        self._check_size(math.prod(map(len, columns)), f"{robot.name} can show its neighbours")
        domain = team[robot.name]
        costs: dict[Value, float] = dict(zip(domain.values, domain.costs, strict=True))
        declared: list[Value] = list(itertools.product(*columns))
        self.charges[robot.name] = {value: self._add_secret(costs.get(value, INFINITE)) for value in declared}
        if parameters.withdrawal_cost is not None:
            away: Value = (None,) * len(robot.interface)
            if away not in declared:
                declared.append(away)
                self.charges[robot.name][away] = self._add_secret(parameters.withdrawal_cost * robot.weight)
            self.withdrawing.add(self.charges[robot.name][away])
        self.declared[robot.name] = tuple(declared)
        self.entries[robot.name] = {}

    def _link(self, robot: str, other: str) -> None:
        """Make two robots that a file links neighbours, even if a scenario has left no constraint between them."""
        self.neighbours[robot].add(other)
        self.neighbours[other].add(robot)

    def _add_constraint(self, constraint: Constraint, holder: str) -> None:
        names = constraint.variables
        columns = [sorted(self._team.variables[name].domain) for name in names]
        self._check_size(math.prod(map(len, columns)), f"constraint {constraint.name} of {holder} has")
        places = tuple(self._places[name] for name in names)
        owners = frozenset(robot for robot, _ in places)
        knowing = frozenset([holder]) if constraint.model == ConstraintModel.PKC else owners | {holder}
        secrets: dict[Value, Secret] = {
            values: self._add_secret(constraint.price(dict(zip(names, values, strict=True))))
            for values in itertools.product(*columns)
        }
        entries = tuple(secrets.values())
        if self._may_withdraw and may_count_when_absent(constraint):
            secrets.update(self._in_absence(constraint, places))
        added = _ConstraintSecrets(places, owners, knowing, secrets)
        for owner in sorted(owners | {holder}):
            self._shared[owner].append(added)
            self.neighbours[owner] |= owners - {owner}
            self.entries[owner].update(dict.fromkeys(entries, knowing))

    def _in_absence(self, constraint: Constraint, places: Sequence[tuple[str, int]]) -> Iterator[tuple[Value, Secret]]:
        """Yield the values of a scope with withdrawn robots (None), and the cost of the restated `constraint`."""
        names = constraint.variables
        owners = dict.fromkeys(robot for robot, _ in places)
        for many in range(1, len(owners) + 1):
            for away in itertools.combinations(owners, many):
                gone = {name for name, (robot, _) in zip(names, places, strict=True) if robot in away}
                left = restated(constraint, gone)
                columns: list[Sequence[int | None]] = [
                    [None] if name in gone else sorted(self._team.variables[name].domain) for name in names
                ]
                self._check_size(math.prod(map(len, columns)), f"constraint {constraint.name} has")
                for values in itertools.product(*columns) if left is not None else ():
                    known = {name: value for name, value in zip(names, values, strict=True) if value is not None}
                    yield values, self._add_secret(left.price(known) if left is not None else 0)

    def _add_secret(self, cost: float) -> Secret:
        self.truths.append(cost)
        return len(self.truths) - 1

    def _check_size(self, number: int, who: str) -> None:
        if len(self.truths) + number > MOST_SECRETS:
            raise TooManySecretsError(f"{who} {number:,} combinations of values; at most {MOST_SECRETS:,} in all")


def exactly(cost: float) -> PossibleCosts:
    """Return the possible costs of a secret that is known to be `cost`."""
    return (
        PossibleCosts(0, -1, infinite=True) if cost == INFINITE else PossibleCosts(int(cost), int(cost), infinite=False)
    )
