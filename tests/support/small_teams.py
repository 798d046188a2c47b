"""Teams of a few robots that must take different values, and what tests add to them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

from robochoc.formats import PREDEFINED
from robochoc.model.problem import (
    Child,
    Constraint,
    ConstraintModel,
    Domain,
    Parent,
    Predicate,
    Relation,
    Robot,
    ScenarioEvent,
    Semantics,
    Team,
    Variable,
)
from tests.support.problems import team_of

DIFFERENT = Relation("R", 2, Semantics.CONFLICTS, ((1, 1), (2, 2), (3, 3)))


def differ(left: str, right: str, name: str = "C") -> Constraint:
    """Return a constraint on two variables of values up to 3, which must differ."""
    return Constraint(name, DIFFERENT, (left, right), (left, right))


def triangle(values: int = 2) -> Team:
    """Return three robots, each different from each; a fourth that only the third knows."""
    return different("ABCD", "AB AC BC CD", values)


def odd_triple() -> Team:
    """Return three robots of the values 1 and 2: exactly one of them must have 2."""
    odd = Relation("R", 3, Semantics.SUPPORTS, ((1, 1, 2), (1, 2, 1), (2, 1, 1)))
    return team_of(dict.fromkeys("ABC", (1, 2)), [Constraint("C", odd, ("A", "B", "C"), ("A", "B", "C"))])


def pair(*events: ScenarioEvent, values: int = 1) -> Team:
    """Return two robots that must take different values, and what happens to them."""
    team = team_of(dict.fromkeys("AB", range(1, values + 1)), [differ("A", "B")])
    return replace(team, scenario=events)


def graph_team(edges: Sequence[str], domains: Mapping[str, int] | None = None) -> Team:
    """Return a team of robots `RA`, `RB`, ...; each edge `AB` is a constraint."""
    names = sorted({*"".join(edges), *(domains or {})})
    sizes = {name: range(1, 1 + (domains or {}).get(name, 2)) for name in names}
    return team_of(sizes, [differ(*edge) for edge in edges])


def pkc_team() -> Team:
    """Return A above B, which share a PKC, and X, which B must differ from."""
    part = Constraint("C", DIFFERENT, ("A", "B"), ("A", "B"), model=ConstraintModel.PKC)
    team = team_of({"A": (1, 2), "B": (1, 2), "X": (1, 2)}, [part, Constraint("D", DIFFERENT, ("B", "X"), ("B", "X"))])
    above = replace(team["RA"], children=(Child("RB", ("A",), (part,)),))
    return replace(team, robots=(above, team["RB"], team["RX"]))


def named_constraint(name: str, *scope: str) -> Constraint:
    """Return a constraint called `name`: two variables differ, or the first two of three."""
    definition = PREDEFINED["neq"] if len(scope) == 2 else Predicate("any", ("X", "Y", "Z"), PREDEFINED["neq"].body)
    return Constraint(name, definition, scope, scope)


def newcomer(*parents: Parent, name: str = "RE", variable: str = "E") -> Robot:
    """Return a robot of one variable with the values 1 and 2."""
    return Robot(name, (Variable(variable, Domain("D", (range(1, 3),))),), parents=parents)


def different(names: str, pairs: str, values: int) -> Team:
    """Return a robot for each letter; each of `pairs` takes different ones of `values` values."""
    constraints = [differ(*pair) for pair in pairs.split()]
    return team_of({name: range(1, values + 1) for name in names}, constraints)
