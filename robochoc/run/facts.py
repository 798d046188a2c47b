"""The facts used to choose a protocol for a team (`run/choice.py`). Most are derived from its constraints."""

from __future__ import annotations

import math
import sys
from collections.abc import Callable, Collection, Iterator, Mapping
from functools import cached_property
from itertools import product
from random import Random

from robochoc.model.change import team_after_events
from robochoc.model.expression.tree import is_total
from robochoc.model.orders import Graph, constraint_graph
from robochoc.model.problem import INFINITE, Constraint, ConstraintModel, ProblemKind, Relation, Semantics, Team
from robochoc.run.divided_tables import divided_tables
from robochoc.run.pigeonholes import Crowd, find_crowd
from robochoc.solver.encoding import MAX_TUPLES, cost_function, is_soft
from robochoc.system.lazy_dataclass import dataclass

_TWO = 2
LARGE = 10_000_000
"""The analysis of a pseudo-tree stops when a table has more entries."""
DRAWS = 16
"""The number of sampled value combinations for estimating a constraint's tightness."""
MOST = sys.float_info.max
"""The largest cost of a combination that is not forbidden."""
MOST_EXAMINED = 400
"""The number of value combinations up to which all combinations of a constraint are examined."""
SAMPLED = 16
"""The number of sampled constraints for estimating the constrainedness."""
Sizes = Mapping[str, int]
"""The number of values of each robot. A value is one combination that the robot's neighbours see."""


@dataclass(frozen=True)
class Facts:
    """The properties of a team before the search.

    Attributes:
        team: The team with its scenario.
        environment: True if an environment changes the problem.
        compiled_sizes: Returns the sizes of the robots' compiled domains; None if only the declared sizes are known. It
            is called only if the declared sizes are large.
        loss: The probability that a message is lost.
        withdrawal: True if robots withdraw from a team without a solution.
    """

    team: Team
    environment: bool = False
    compiled_sizes: Callable[[], Sizes | None] = lambda: None
    loss: float = 0.0
    withdrawal: bool = False

    @property
    def robots(self) -> int:
        """The number of robots."""
        return len(self.team.robots)

    @property
    def has_costs(self) -> bool:
        """True if costs are minimised."""
        return self.team.kind == ProblemKind.DISWCSP

    @property
    def changes(self) -> bool:
        """True if the problem changes over time."""
        return self.team.dynamic or self.environment

    @cached_property
    def first(self) -> Team:
        """The team before the first event."""
        return team_after_events(self.team, 0)

    @cached_property
    def partially_known(self) -> bool:
        """True if a constraint is partially known (PKC), at any time."""
        epochs = (team_after_events(self.team, events) for events in range(len(self.team.scenario) + 1))
        return any(one.model == ConstraintModel.PKC for team in epochs for one in team.constraints())

    @cached_property
    def graph(self) -> Graph:
        """The neighbours of each robot."""
        return constraint_graph(self.first)

    @cached_property
    def links(self) -> int:
        """The number of pairs of neighbours."""
        return sum(map(len, self.graph.values())) // _TWO

    @cached_property
    def declared_sizes(self) -> Sizes:
        """The declared number of values of each robot. Private constraints may leave fewer values."""
        robots = self.first.robots
        seen = {name for robot in robots for name in robot.shown}
        for robot in robots:
            seen.update(name for constraint in robot.shared for name in constraint.variables)
            for child in robot.children:
                seen.update(child.variables, *(constraint.variables for constraint in child.constraints))
        return {
            robot.name: math.prod([len(one.domain) for one in robot.variables if one.name in seen]) for robot in robots
        }

    @cached_property
    def sizes(self) -> Sizes:
        """The number of values of each robot: the declared number or, if it is large, the number after compilation."""
        sizes = self.declared_sizes
        combinations = (math.prod([sizes[name] + 1 for name in scope]) for scope in self._scopes)
        return sizes if max(combinations, default=1) <= MAX_TUPLES else self.compiled_sizes() or sizes

    @property
    def values(self) -> int:
        """The number of values of all robots together."""
        return sum(self.sizes.values())

    @property
    def declared_values(self) -> int:
        """The declared number of values of all robots together."""
        return sum(self.declared_sizes.values())

    @property
    def largest_domain(self) -> int:
        """The largest number of values of a robot."""
        return max(self.sizes.values(), default=0)

    @cached_property
    def largest_table(self) -> int:
        """The number of entries in the largest table of a single constraint.

        A table is over the variables that the constraint names (`CostTable`), whatever other variables the robots have.
        """
        return self._largest_table(self.sizes, self._named)

    @property
    def is_binary(self) -> bool:
        """True if no constraint is over more than two robots."""
        return max(map(len, self._scopes), default=0) <= _TWO

    @cached_property
    def forbids(self) -> bool:
        """True if a constraint forbids something, so that not every assignment is a solution."""
        return any(map(_forbids, self.first.constraints()))

    @cached_property
    def constrainedness(self) -> float:
        """The constrainedness of the problem. Problems with values around 1 are hardest.

        It is kappa of Gent, MacIntyre, Prosser, Walsh ("The constrainedness of search", AAAI 1996): the bits removed by
        the constraints, divided by the bits of the domains. It is estimated from a sample of `SAMPLED` constraints, and
        of `DRAWS` combinations of values for each of them.
        """
        return self._constrainedness(MOST)

    @cached_property
    def cost_constrainedness(self) -> float:
        """The constrainedness of the problem to find an assignment without any costs."""
        return self._constrainedness(0)

    @cached_property
    def _domains(self) -> Mapping[str, Collection[int]]:
        return {one.name: one.domain for robot in self.first.robots for one in robot.variables}

    @cached_property
    def _sample(self) -> list[Constraint]:
        constraints = list(self.first.constraints())
        chance = Random(0)  # noqa: S311 - a sample, no secret
        return constraints if len(constraints) <= SAMPLED else chance.sample(constraints, SAMPLED)

    def _constrainedness(self, most: float) -> float:
        """Return the constrainedness if no constraint may cost more than `most`."""
        bits = math.log2(math.prod(max(1, len(domain)) for domain in self._domains.values()))
        if not bits or not self._sample:
            return 0.0
        chance = Random(0)  # noqa: S311 - as above
        taken = -sum(math.log2(_share_allowed(one, self._domains, chance, most)) for one in self._sample)
        return taken * sum(1 for _ in self.first.constraints()) / len(self._sample) / bits

    @cached_property
    def has_equal_costs(self) -> bool:
        """True if all costs of the sampled constraints are equal. Then many assignments cost the same."""
        chance = Random(0)  # noqa: S311 - as above
        costs = {cost for one in self._sample for cost in _sampled_costs(one, self._domains, chance)}
        return len(costs - {0, INFINITE}) == 1

    @property
    def share_linked(self) -> float:
        """The share of pairs of robots that are parent and child."""
        robots = self.first.robots
        return sum(len(robot.parents) for robot in robots) / max(len(robots) * (len(robots) - 1) / 2, 1)

    @cached_property
    def needs_no_backtracking(self) -> bool:
        """True if a robot's parents leave it a value, whatever they choose, in the order of the files.

        False if this is not easily seen: of robots with several variables, and of constraints over more robots.
        """
        if any(len(robot.variables) > 1 for robot in self.first.robots):
            return False
        most_constraints = max((len(robot.shared) for robot in self.first.robots), default=0)
        examined: dict[tuple[object, ...], float] = {}
        for constraint in self.first.constraints():
            places = (one if isinstance(one, int) else id(self._domains[one]) for one in constraint.parameters)
            same = (id(constraint.definition), constraint.cost, *places)
            if same not in examined:
                examined[same] = _largest_share_excluded(constraint, self._domains)
            if most_constraints * examined[same] >= 1:
                return False
        return True

    @cached_property
    def crowd(self) -> Crowd | None:
        """A group of robots that need different values of which there are too few; None if no group was found."""
        return find_crowd(self.first)

    @cached_property
    def tree(self) -> TreeTables:
        """The tables of dynamic programming on the robots' pseudo-tree. The analysis stops at a large table.

        If robots have several variables, these are DPOP's divided tables, unless the problem changes: S-DPOP divides no
        tables. A robot that may withdraw cannot choose its variables separately.
        """
        seen = {name for scope in self._named for name in scope}
        has_one_variable = len({self.first.owner[name] for name in seen}) == len(seen)
        if has_one_variable or self.changes or self.withdrawal:
            return tree_tables(self.graph, self.first.order, self.sizes, LARGE)
        above = tree_order(self.graph, self.first.order)
        return TreeTables(*divided_tables(self.first, above, self.sizes, LARGE))

    @cached_property
    def declared_table(self) -> int:
        """The same as `largest_table`, with the declared sizes."""
        return self._largest_table(self.declared_sizes, self._named)

    @cached_property
    def largest_needed_table(self) -> int:
        """The number of entries in the largest table that `sfb` cannot avoid by evaluating single rows."""
        if self.withdrawal or not self.has_costs:
            return self.largest_table
        needed = {frozenset(one.variables) for one in self._shared if not self._has_rows(one)}
        return self._largest_table(self.sizes, needed)

    def _has_rows(self, constraint: Constraint) -> bool:
        """Return whether `sfb` can evaluate rows of the constraint: see `LocalProblem.tables_or_rows`."""
        robots = {self.first.owner[name] for name in constraint.variables}
        definition = constraint.definition
        return len(robots) > _TWO and not isinstance(definition, Relation) and is_total(definition.body)

    @property
    def largest_pair(self) -> int:
        """The largest number of combinations of the declared values of two robots in a constraint."""
        sizes = self.declared_sizes
        pairs = (sorted([sizes[name] + 1 for name in scope])[-_TWO:] for scope in self._scopes)
        return max(map(math.prod, pairs), default=1)

    @cached_property
    def _scopes(self) -> set[frozenset[str]]:
        """The robots of each shared constraint."""
        owner = self.first.owner
        return {frozenset([owner[name] for name in scope]) for scope in self._named}

    @cached_property
    def _named(self) -> set[frozenset[str]]:
        """The variables of each shared constraint."""
        return {frozenset(one.variables) for one in self._shared}

    @property
    def _shared(self) -> Iterator[Constraint]:
        return (one for robot in self.first.robots for one in robot.shared)

    def _largest_table(self, sizes: Sizes, scopes: Collection[frozenset[str]]) -> int:
        owner, domains = self.first.owner, self._domains
        largest = 1
        for scope in scopes:
            named: dict[str, int] = {}
            for name in scope:
                named[owner[name]] = named.get(owner[name], 1) * len(domains[name])
            largest = max(
                largest, math.prod([min(size, sizes[robot]) + self.withdrawal for robot, size in named.items()])
            )
        return largest


def _share_allowed(
    constraint: Constraint, domains: Mapping[str, Collection[int]], chance: Random, most: float
) -> float:
    """Return the share of value combinations that cost at most `most`. If there are none, count half a combination."""
    many = math.prod([len(domains[name]) for name in constraint.variables])
    definition = constraint.definition
    if not many:
        return 1.0
    if isinstance(definition, Relation) and definition.arity == len(constraint.variables):
        return min(max(_number_allowed(definition, many, most), 1 / 2), many) / many
    columns = [list(domains[name]) for name in constraint.variables]
    number = min(many, DRAWS)
    sampled = product(*columns) if many <= DRAWS else (_drawn(columns, chance) for _ in range(DRAWS))
    price = cost_function(constraint, constraint.variables)
    return max(sum(price(values) <= most for values in sampled), 1 / 2) / number


def _sampled_costs(constraint: Constraint, domains: Mapping[str, Collection[int]], chance: Random) -> set[float]:
    """Return the costs of a relation's tuples, or of some value combinations of another constraint."""
    definition = constraint.definition
    if isinstance(definition, Relation) and definition.semantics == Semantics.SOFT:
        return {*definition.costs, definition.default_cost}
    columns = [list(domains[name]) for name in constraint.variables]
    price = cost_function(constraint, constraint.variables)
    return {price(_drawn(columns, chance)) for _ in range(DRAWS)} if all(columns) else set()


def _largest_share_excluded(constraint: Constraint, domains: Mapping[str, Collection[int]]) -> float:
    """Return the largest share of one robot's values that a value of another robot excludes; 1 if it is not known."""
    columns = [list(domains[name]) for name in constraint.variables]
    if len(columns) != _TWO or not 0 < math.prod(map(len, columns)) <= MOST_EXAMINED:
        return 1.0
    price = cost_function(constraint, constraint.variables)
    rows = [[price((one, other)) == INFINITE for other in columns[1]] for one in columns[0]]
    largest: float = max(sum(row) / len(row) for row in (*rows, *zip(*rows, strict=True)))
    return largest


def _number_allowed(relation: Relation, many: int, most: float) -> int:
    """Return the number of tuples among `many` that cost at most `most`, if all listed tuples are in the domains."""
    match relation.semantics:
        case Semantics.SUPPORTS:
            return len(relation.tuples)
        case Semantics.CONFLICTS:
            return many - len(relation.tuples)
        case Semantics.SOFT:
            others = many - len(relation.tuples) if relation.default_cost <= most else 0
            return others + sum(cost <= most for cost in relation.costs)


def _drawn(columns: list[list[int]], chance: Random) -> tuple[int, ...]:
    return tuple([column[int(chance.random() * len(column))] for column in columns])


def _forbids(constraint: Constraint) -> bool:
    """Return whether `constraint` may forbid a combination of values."""
    definition = constraint.definition
    if isinstance(definition, Relation):
        return not is_soft(constraint) or INFINITE in (*definition.costs, definition.default_cost)
    return not is_soft(constraint)


@dataclass(frozen=True)
class TreeTables:
    """`width`: the induced width of a pseudo-tree; `cells`: the number of entries of the largest table."""

    width: int
    cells: float


def tree_tables(graph: Graph, order: tuple[str, ...], sizes: Sizes, enough: float = math.inf) -> TreeTables:
    """Return the size of DPOP's tables on the tree that `protocols/shared/dfs.py` would build.

    Args:
        graph: The neighbours of each robot.
        order: The priority order, which breaks ties.
        sizes: The number of values of each robot.
        enough: The analysis stops at the first table with more entries than this.
    """
    return _joined(tree_order(graph, order), sizes, enough)


def tree_order(graph: Graph, order: tuple[str, ...]) -> dict[str, tuple[str, ...]]:
    """Return each robot's neighbours above it in the tree of `tree_tables`, roots first."""
    rank = {name: place for place, name in enumerate(order)}

    def strength(name: str) -> tuple[int, int]:
        return -len(graph[name]), rank[name]

    above: dict[str, tuple[str, ...]] = {}
    for root in sorted(graph, key=strength):
        branch: dict[str, Iterator[str]] = {}
        coming: str | None = None if root in above else root
        while coming is not None or branch:
            if coming is not None:
                above[coming] = tuple(other for other in graph[coming] if other in branch)
                branch[coming] = iter(sorted(graph[coming], key=strength))
            else:
                branch.popitem()
            left = next(reversed(branch.values()), iter(()))
            coming = next((name for name in left if name not in above), None)
    return above


def _joined(above: dict[str, tuple[str, ...]], sizes: Sizes, enough: float) -> TreeTables:
    """Return the size of the tables on a tree. `above` contains each robot's neighbours above it, roots first."""
    place = {name: number for number, name in enumerate(above)}
    separators = {name: set(others) for name, others in above.items()}
    width, cells = 0, 1.0
    for name in reversed(above):
        separator = separators.pop(name)
        width = max(width, len(separator))
        cells = max(cells, float(min(math.prod(sizes[one] for one in (name, *separator)), 10**300)))
        if cells > enough:
            break
        if separator:
            parent = max(separator, key=place.__getitem__)
            separators[parent] |= separator - {parent}
    return TreeTables(width, cells)
