"""Random teams and their truth by brute force: what the conformance tests are made of."""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from random import Random

from hypothesis import strategies as st

from robochoc.model.expression import Type, parse
from robochoc.model.problem import (
    Child,
    Constraint,
    Domain,
    Parent,
    Predicate,
    Relation,
    Robot,
    Semantics,
    Team,
    Variable,
)
from robochoc.run.options import Runtime

ON_ONE_MACHINE = (Runtime.PROCESSES, Runtime.SIMULATOR)
"""The runtimes that need no network; that one has tests of its own, as it takes a second to start."""

PREDICATES = tuple(
    Predicate(f"p{number}", ("X", "Y"), parse(text, ("X", "Y"), Type.BOOLEAN))
    for number, text in enumerate(
        (
            "ne(X, Y)",
            "eq(X, Y)",
            "lt(X, Y)",
            "ne(abs(sub(X, Y)), 1)",
            "or(gt(mul(X, Y), 1), eq(X, neg(Y)))",
            "ne(mod(add(X, Y), 3), 0)",
            "eq(div(X, Y), 0)",  # undefined where Y is 0
            "xor(gt(X, 0), le(Y, 0))",
        )
    )
)


def team_of(domains: Mapping[str, Sequence[int]], constraints: Iterable[Constraint], name: str = "random") -> Team:
    """One robot `R<x>` for each variable `<x>`; priority in the order of `domains`, constraints with the lowest."""
    rank = {variable: place for place, variable in enumerate(domains)}
    held: dict[str, dict[str, list[Constraint]]] = {variable: {} for variable in domains}
    private: dict[str, list[Constraint]] = {variable: [] for variable in domains}
    for constraint in constraints:
        *above, lowest = sorted(constraint.variables, key=rank.__getitem__)
        if not above:
            private[lowest].append(constraint)
            continue
        for parent in above:
            held[lowest].setdefault(parent, [])
        held[lowest][above[-1]].append(constraint)
    robots = tuple(
        Robot(
            name=f"R{variable}",
            variables=(Variable(variable, _domain(values)),),
            private=tuple(private[variable]),
            parents=tuple(Parent(f"R{parent}", tuple(shared)) for parent, shared in held[variable].items()),
            children=tuple(Child(f"R{child}", (variable,)) for child in domains if variable in held[child]),
        )
        for variable, values in domains.items()
    )
    return Team(name, robots)


def known_to_both(team: Team) -> Team:
    """`team`, where parents' files repeat what their children hold, as the original platform's do."""
    held = {robot.name: robot.shared for robot in team.robots}
    own = {robot.name: {variable.name for variable in robot.variables} for robot in team.robots}

    def copied(parent: str, child: Child) -> Child:
        return replace(child, copies=tuple(one for one in held[child.name] if own[parent] & set(one.variables)))

    robots = [
        replace(robot, children=tuple(copied(robot.name, child) for child in robot.children)) for robot in team.robots
    ]
    return replace(team, robots=tuple(robots))


def random_team(chance: Random, *, n_ary: bool = True) -> Team:
    """A team of 2 to 7 robots; about as often satisfiable as not; negative and gapped domains, n-ary constraints."""
    size = chance.randint(2, 7)
    domains = {
        f"X{number:02}": sorted(chance.sample(range(-3, 6), chance.choice((1, 2, 3, 3, 4)))) for number in range(size)
    }
    density = chance.uniform(0.3, 0.95)
    constraints = [
        random_constraint(chance, domains, pair)
        for pair in itertools.combinations(domains, 2)
        if chance.random() < density
    ]
    if size > 2 and n_ary:
        triples = (chance.sample(sorted(domains), chance.choice((3, 3, min(4, size)))) for _ in range(2))
        constraints += [_random_table(chance, domains, scope, 0.35) for scope in triples if chance.random() < 0.4]
    constraints += [_random_table(chance, domains, (name,), 0.3) for name in domains if chance.random() < 0.15]
    return team_of(domains, constraints)


teams = st.integers(0, 2**32).map(lambda seed: random_team(Random(seed)))


def random_constraint(chance: Random, domains: Mapping[str, Sequence[int]], pair: Sequence[str]) -> Constraint:
    scope = list(pair)
    chance.shuffle(scope)
    if chance.random() < 0.5:
        return _random_table(chance, domains, scope, chance.uniform(0.1, 0.7))
    return Constraint("C", chance.choice(PREDICATES), tuple(scope), tuple(scope))


def _random_table(
    chance: Random, domains: Mapping[str, Sequence[int]], scope: Sequence[str], tightness: float
) -> Constraint:
    """A table over `scope` that forbids about `tightness` of all tuples, stated either way."""
    rows = list(itertools.product(*(domains[name] for name in scope)))
    forbidden = [row for row in rows if chance.random() < tightness]
    semantics = chance.choice((Semantics.CONFLICTS, Semantics.SUPPORTS))
    listed = forbidden if semantics is Semantics.CONFLICTS else [row for row in rows if row not in forbidden]
    relation = Relation("R", len(scope), semantics, tuple(listed))
    return Constraint("C", relation, tuple(scope), tuple(scope))


def _domain(values: Sequence[int]) -> Domain:
    return Domain("D", tuple(range(value, value + 1) for value in values))


def shuffled(chance: Random, team: Team) -> list[str]:
    """Return the names of the robots of `team` in random order."""
    return chance.sample(team.order, len(team.order))


def with_unique_definitions(team: Team) -> Team:
    """Return `team` with another name for each definition, as they are read back from files."""
    numbers = itertools.count()

    def apart(constraints: Iterable[Constraint]) -> tuple[Constraint, ...]:
        return tuple(replace(one, definition=replace(one.definition, name=f"d{next(numbers)}")) for one in constraints)

    robots = (
        replace(
            robot,
            private=tuple(replace(one, model=None) for one in apart(robot.private)),
            parents=tuple(replace(parent, constraints=apart(parent.constraints)) for parent in robot.parents),
        )
        for robot in team.robots
    )
    return replace(team, robots=tuple(robots))
