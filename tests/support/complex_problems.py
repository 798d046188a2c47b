"""Random teams of complex robots: several variables each, private constraints, every operator, negative values."""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from dataclasses import replace
from random import Random

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
    Term,
    Variable,
)

BODIES = (
    "ne(X, Y)",
    "eq(X, Y)",
    "lt(neg(X), Y)",
    "le(abs(X), add(Y, 2))",
    "gt(mul(X, Y), -3)",
    "ge(sub(X, Y), -1)",
    "ne(div(X, Y), 1)",
    "ne(mod(X, Y), 0)",
    "lt(pow(X, 2), add(Y, 9))",
    "eq(min(X, Y), X)",
    "ne(max(X, Y), 2)",
    "ne(dist(X, Y), 1)",
    "not(eq(X, add(Y, 1)))",
    "and(ne(X, Y), ne(X, neg(Y)))",
    "or(gt(X, 1), lt(Y, 0))",
    "xor(gt(X, 0), le(Y, 0))",
    "iff(gt(X, 0), gt(Y, 0))",
    "ne(if(gt(X, Y), X, mul(2, Y)), 2)",
)
PREDICATES = tuple(
    Predicate(f"p{number}", ("X", "Y"), parse(text, ("X", "Y"), Type.BOOLEAN)) for number, text in enumerate(BODIES)
)
TERNARY = Predicate("t", ("X", "Y", "Z"), parse("le(add(X, mul(Y, Z)), 4)", ("X", "Y", "Z"), Type.BOOLEAN))


def random_complex_team(chance: Random) -> Team:
    """2 to 4 robots of 1 to 3 variables; n-ary constraints, constants and repeated variables in scopes."""
    owned: dict[str, list[str]] = {}
    domains: dict[str, list[int]] = {}
    for number in range(chance.randint(2, 4)):
        room = 7 - len(domains)
        names = [f"V{number}.{place}" for place in range(min(chance.choice((1, 2, 2, 3)), max(1, room)))]
        owned[f"R{number}"] = names
        for name in names:
            domains[name] = sorted(chance.sample(range(-4, 7), chance.choice((2, 2, 3, 3, 4))))
    density = chance.uniform(0.25, 0.8)
    pairs = [pair for pair in itertools.combinations(domains, 2) if chance.random() < density]
    constraints = [random_constraint(chance, domains, pair) for pair in pairs]
    constraints += [random_constraint(chance, domains, pair) for pair in pairs if chance.random() < 0.15]
    if len(domains) > 2 and chance.random() < 0.6:
        constraints.append(random_constraint(chance, domains, chance.sample(sorted(domains), 3)))
    constraints += [
        random_constraint(chance, domains, (name, chance.randint(-3, 5))) for name in domains if chance.random() < 0.15
    ]
    return complex_team(owned, domains, constraints)


def complex_team(
    owned: Mapping[str, Sequence[str]], domains: Mapping[str, Sequence[int]], constraints: Sequence[Constraint]
) -> Team:
    """Robots that own variables as `owned` says, in priority order; each constraint with its lowest robot."""
    owner = {name: robot for robot, names in owned.items() for name in names}
    rank = {robot: place for place, robot in enumerate(owned)}
    private: dict[str, list[Constraint]] = {robot: [] for robot in owned}
    above: dict[str, dict[str, list[Constraint]]] = {robot: {} for robot in owned}
    told: dict[str, dict[str, set[str]]] = {robot: {} for robot in owned}
    for constraint in constraints:
        robots = sorted({owner[name] for name in constraint.variables}, key=rank.__getitem__)
        *parents, lowest = robots
        if not parents:
            private[lowest].append(replace(constraint, model=None))
            continue
        for parent in parents:
            above[lowest].setdefault(parent, [])
            told[parent].setdefault(lowest, set()).update(n for n in constraint.variables if owner[n] == parent)
        above[lowest][parents[-1]].append(constraint)
    robots_made = (
        Robot(
            name=robot,
            variables=tuple(Variable(name, _domain(name, domains[name])) for name in names),
            private=tuple(private[robot]),
            parents=tuple(Parent(parent, tuple(held)) for parent, held in above[robot].items()),
            children=tuple(Child(child, tuple(sorted(seen))) for child, seen in told[robot].items()),
        )
        for robot, names in owned.items()
    )
    return Team("complex", tuple(robots_made))


def random_constraint(chance: Random, domains: Mapping[str, Sequence[int]], terms: Sequence[Term]) -> Constraint:
    """A relation stated either way, or a predicate, over `terms` in any order; sometimes with a constant more."""
    scope = list(terms)
    chance.shuffle(scope)
    if chance.random() < 0.45:
        return _random_relation(chance, domains, scope)
    if len(scope) == 3:
        return Constraint("C", TERNARY, tuple(scope), tuple(scope))
    names = [term for term in scope if isinstance(term, str)]
    if chance.random() < 0.1:
        terms_there: list[Term] = [*names, chance.randint(-2, 3)]
        third = chance.choice(terms_there)
        return Constraint("C", TERNARY, (*scope, third), (*scope, third))
    return Constraint("C", chance.choice(PREDICATES), tuple(scope), tuple(scope))


def _random_relation(chance: Random, domains: Mapping[str, Sequence[int]], scope: Sequence[Term]) -> Constraint:
    tightness = chance.uniform(0.1, 0.6)
    columns: list[Sequence[int]] = [domains[term] if isinstance(term, str) else (term, term + 1) for term in scope]
    rows: list[tuple[int, ...]] = list(itertools.product(*columns))
    forbidden = [row for row in rows if chance.random() < tightness]
    semantics = chance.choice((Semantics.CONFLICTS, Semantics.SUPPORTS))
    listed = forbidden if semantics is Semantics.CONFLICTS else [row for row in rows if row not in forbidden]
    outside: list[tuple[int, ...]] = [tuple(99 for _ in scope)] if chance.random() < 0.2 else []
    relation = Relation("R", len(scope), semantics, (*listed, *outside))
    return Constraint("C", relation, tuple(scope), tuple(scope))


def _domain(name: str, values: Sequence[int]) -> Domain:
    return Domain(f"D{name}", tuple(range(value, value + 1) for value in values))
