"""Random teams with the costs that people have, and the truth about them in fractions."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from fractions import Fraction
from random import Random

from robochoc.model.assembly import assemble
from robochoc.model.expression import Type, parse
from robochoc.model.problem import (
    INFINITE,
    Constraint,
    CostUnits,
    Domain,
    Function,
    Predicate,
    ProblemKind,
    Relation,
    Semantics,
    Team,
    Variable,
)

_PAIR = ("X", "Y")
_PREDICATES = ("ne(X,Y)", "lt(X,Y)", "eq(add(X,Y),1)")
_FUNCTIONS = ("sub(mul(X,Y),3)", "abs(sub(X,Y))", "div(X,Y)", "neg(add(X,Y,2))", "if(eq(X,Y),-4,mod(X,3))")


def random_costs_team(seed: int, most: int = 9, places: Sequence[int] = (0, 0, 1, 3)) -> Team:
    """Return a team of 2 to 4 robots: decimal, negative and maximised costs, functions, constants, infinities.

    Relations have costs up to `most`, in units of as many decimal places as one of `places` says.
    """
    chance = Random(seed)
    robots = chance.randint(2, 4)
    variables = {f"r{number}": [_variable(chance, number)] for number in range(robots)}
    constraints = [_constraint(chance, number, robots, most) for number in range(chance.randint(1, 5))]
    units = CostUnits(chance.random() < 0.5, chance.choice(places), chance.choice([0, 7, -2]))
    return assemble(f"costs-{seed}", variables, constraints, kind=ProblemKind.DISWCSP, costs=units)


def _variable(chance: Random, number: int) -> Variable:
    return Variable(f"x{number}", Domain(f"D{number}", (range(chance.randint(-2, 0), chance.randint(1, 3)),)))


def _constraint(chance: Random, number: int, robots: int, most: int) -> Constraint:
    scope = tuple(f"x{one}" for one in chance.sample(range(robots), 2))
    name = f"C{number}"
    match chance.choice(["relation", "predicate", "function", "unary"]):
        case "relation":
            return Constraint(name, _relation(chance, f"R{number}", most), scope, scope)
        case "predicate":
            predicate = Predicate(f"P{number}", _PAIR, parse(chance.choice(_PREDICATES), _PAIR, Type.BOOLEAN))
            return Constraint(name, predicate, scope, scope, cost=chance.choice([INFINITE, -5, 7]))
        case "function":
            function = Function(f"F{number}", _PAIR, parse(chance.choice(_FUNCTIONS), _PAIR, Type.INTEGER))
            return Constraint(name, function, scope, scope)
        case _:
            function = Function(f"U{number}", ("X",), parse("sub(X,1)", ("X",), Type.INTEGER))
            return Constraint(name, function, scope[:1], scope[:1])


def _relation(chance: Random, name: str, most: int) -> Relation:
    tuples = [pair for pair in itertools.product(range(-2, 3), repeat=2) if chance.random() < 0.7]
    costs = tuple([chance.choice([INFINITE, *(chance.randint(-most, most) for _ in range(19))]) for _ in tuples])
    return Relation(name, 2, Semantics.SOFT, tuple(tuples), costs, chance.choice([INFINITE, -3, 0, 4]))


def best_cost(team: Team) -> Fraction | None:
    """Return the best cost of `team` in the user's numbers, by trying everything. None: there is no solution."""
    units = team.robots[0].costs
    totals = []
    for values in itertools.product(*(variable.domain for variable in team.variables.values())):
        assignment = dict(zip(team.variables, values, strict=True))
        paid = [(one, one.price(assignment)) for one in team.constraints()]
        if all(cost < INFINITE for _, cost in paid):
            unit = Fraction(1, 10**units.places)
            terms = (Fraction(cost) * (1 if isinstance(one.definition, Function) else unit) for one, cost in paid)
            totals.append(units.constant * unit + sum(terms))
    return (max if units.maximize else min)(totals, default=None)
