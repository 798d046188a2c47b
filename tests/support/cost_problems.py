"""Random teams with costs, and the least cost by brute force."""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from dataclasses import replace
from random import Random

from robochoc.model.absence import may_count_when_absent, restated
from robochoc.model.problem import (
    INFINITE,
    Assignment,
    Constraint,
    Predicate,
    ProblemKind,
    Relation,
    Robot,
    Semantics,
    Team,
)
from tests.support.complex_problems import random_complex_team
from tests.support.problems import PREDICATES, random_team, team_of

MAX_COST = 9


def random_cost_team(chance: Random, *, n_ary: bool = True) -> Team:
    """A team of 3 to 8 robots: soft relations and soft predicates, hard constraints among them, unary costs."""
    size = chance.choice((3, 4, 4, 5, 5, 6, 7, 8))
    most = 3 if size > 6 else 4
    domains = {
        f"X{number:02}": sorted(chance.sample(range(-3, 6), chance.randint(1 if chance.random() < 0.2 else 2, most)))
        for number in range(size)
    }
    density = chance.uniform(0.3, 0.9)
    hard = chance.choice((0, 0.1, 0.3))
    pairs = [pair for pair in itertools.combinations(domains, 2) if chance.random() < density]
    constraints = [_random_constraint(chance, domains, pair, hard) for pair in pairs]
    if n_ary and chance.random() < 0.5:
        triples = [chance.sample(sorted(domains), 3) for _ in range(chance.randint(1, 2))]
        constraints += [soft_table(chance, domains, triple, hard) for triple in triples]
    constraints += [soft_table(chance, domains, (name,), hard / 2) for name in domains if chance.random() < 0.4]
    return with_costs(team_of(domains, constraints, "costs"))


def random_complex_cost_team(chance: Random) -> Team:
    """The complex robots of `random_complex_team`, where about two thirds of the constraints have become soft."""
    return softened(random_complex_team(chance), chance)


def random_hard_team(chance: Random, *, n_ary: bool = True) -> Team:
    """A team without costs, for protocols that minimise: a solution costs nothing."""
    return random_team(chance, n_ary=n_ary)


def with_costs(team: Team) -> Team:
    """`team` as a DisWCSP."""
    return replace(team, robots=tuple(replace(robot, kind=ProblemKind.DISWCSP) for robot in team.robots))


def softened(team: Team, chance: Random) -> Team:
    """`team` as a DisWCSP in which about two thirds of the constraints only cost something."""

    def soft(constraint: Constraint) -> Constraint:
        if chance.random() < 0.35:
            return constraint
        definition = constraint.definition
        if isinstance(definition, Predicate):
            return replace(constraint, cost=chance.randint(1, MAX_COST))
        assert isinstance(definition, Relation)
        listed, other = chance.randint(0, MAX_COST), chance.randint(0, MAX_COST)
        costs = tuple(chance.choice((listed, chance.randint(0, MAX_COST), INFINITE)) for _ in definition.tuples)
        return replace(
            constraint,
            definition=replace(definition, semantics=Semantics.SOFT, costs=costs, default_cost=other),
        )

    def of(robot: Robot) -> Robot:
        parents = tuple(replace(p, constraints=tuple(map(soft, p.constraints))) for p in robot.parents)
        return replace(robot, private=tuple(map(soft, robot.private)), parents=parents)

    return with_costs(replace(team, robots=tuple(map(of, team.robots))))


def cost_of(assignment: Assignment, constraints: Sequence[Constraint]) -> float:
    total: float = 0
    for constraint in constraints:
        total += constraint.price(assignment)
        if total == INFINITE:
            break
    return total


def minimum_withdrawal(team: Team) -> int:
    """The least weight of robots that have to withdraw so that the others have a solution, by brute force."""
    own = {robot.name: {variable.name for variable in robot.variables} for robot in team.robots}
    dropped = [c for c in team.constraints() if not may_count_when_absent(c)]
    counted = [c for c in team.constraints() if may_count_when_absent(c)]

    def place(left: Sequence[Robot], assignment: Assignment, aside: int, best: int) -> int:
        if aside >= best:
            return best
        if not left:
            known = (restated(c, {name for name in c.variables if name not in assignment}) for c in counted)
            return aside if all(one is None or one.allows(assignment) for one in known) else best
        robot, *others = left
        columns = [variable.domain for variable in robot.variables]
        for values in itertools.product(*columns):
            names = [variable.name for variable in robot.variables]
            wider = {**assignment, **dict(zip(names, values, strict=True))}
            met = (c for c in dropped if own[robot.name] & {*c.variables} and wider.keys() >= {*c.variables})
            if all(constraint.allows(wider) for constraint in met):
                best = place(others, wider, aside, best)
        return place(others, assignment, aside + robot.weight, best)

    return place(team.robots, {}, 0, sum(robot.weight for robot in team.robots) + 1)


def _random_constraint(
    chance: Random, domains: Mapping[str, Sequence[int]], pair: Sequence[str], hard: float
) -> Constraint:
    scope = list(pair)
    chance.shuffle(scope)
    if chance.random() < 0.6:
        return soft_table(chance, domains, scope, hard)
    cost = INFINITE if chance.random() < hard else chance.randint(1, MAX_COST)
    return Constraint("C", chance.choice(PREDICATES), tuple(scope), tuple(scope), cost=cost)


def soft_table(chance: Random, domains: Mapping[str, Sequence[int]], scope: Sequence[str], hard: float) -> Constraint:
    """Every tuple has a cost; those that are not listed have the default."""
    rows = list(itertools.product(*(domains[name] for name in scope)))
    listed = [row for row in rows if chance.random() < 0.8]
    costs = tuple(INFINITE if chance.random() < hard else chance.randint(0, MAX_COST) for _ in listed)
    default = INFINITE if chance.random() < hard else chance.randint(0, MAX_COST)
    relation = Relation("R", len(scope), Semantics.SOFT, tuple(listed), costs, default)
    return Constraint("C", relation, tuple(scope), tuple(scope))


def random_tree(chance: Random) -> Team:
    """Return a team with costs whose graph is a tree: each robot but the first shares a table with one before it."""
    domains = {f"X{number}": range(1, chance.randint(2, 4)) for number in range(chance.randint(2, 7))}
    constraints = []
    for number, name in enumerate(list(domains)[1:], 1):
        pair = (f"X{chance.randrange(number)}", name)
        rows = list(itertools.product(*(domains[one] for one in pair)))
        costs = tuple(INFINITE if chance.random() < 0.15 else chance.randint(0, MAX_COST) for _ in rows)
        relation = Relation("R", 2, Semantics.SOFT, tuple(rows), costs)
        constraints.append(Constraint("C", relation, pair, pair))
    return team_of(domains, constraints)


PAIR_COSTS = Relation("T", 2, Semantics.SOFT, ((1, 1), (1, 2), (2, 1), (2, 2)), (2, 5, 3, 4))


def pair(relation: Relation = PAIR_COSTS) -> Team:
    """Two robots A and B, each with the values 1 and 2, and a constraint between them."""
    return team_of(dict.fromkeys("AB", (1, 2)), [Constraint("C", relation, ("A", "B"), ("A", "B"))])


def weighted_colouring(chance: Random, robots: int, degree: float, colours: int) -> Team:
    """A random graph; two neighbours of one colour cost 1 to 10."""
    names = [f"X{number:02}" for number in range(robots)]
    pairs = chance.sample([*itertools.combinations(names, 2)], round(robots * degree / 2))
    constraints = [
        Constraint(
            "C",
            Relation("R", 2, Semantics.SOFT, tuple((c, c) for c in range(colours)), (chance.randint(1, 10),) * colours),
            one,
            one,
        )
        for one in pairs
    ]
    return team_of(dict.fromkeys(names, range(colours)), constraints)
