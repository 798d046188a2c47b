"""Random teams with real variables, and their best cost by enumeration of all multiples of the precision."""

from __future__ import annotations

import itertools
from decimal import Decimal
from random import Random

from robochoc.model.assembly import assemble
from robochoc.model.constraint import Constraint, Domain, Function, Predicate, Variable
from robochoc.model.cost_units import CostUnits
from robochoc.model.expression import Type, UndefinedValueError, compile_expression, parse
from robochoc.model.expression.fixed_point import VALUE_PLACES, fixed_point
from robochoc.model.problem import INFINITE, ProblemKind, Team
from robochoc.model.real import RealInterval, RealParameters, grid

PLACES = 1
PAIRS = (
    "sqr(X - Y + {a})", "abs(X - Y) * {b}", "mul(X, Y)", "max(0, {b} - dist(X, Y))", "min(sqr(X), abs(Y - {a}))",
    "sqr(sqr(X) - Y)", "div(X, sqr(Y) + 1)", "if(lt(X, Y), X + {b}, sqr(Y))", "pow(X - Y, 4) - sqr(X)",
)  # fmt: skip
SINGLES = ("sqr(X - {a})", "abs(X - {a}) * {b}", "neg(sqr(X))", "max(X, {a} - X)", "pow(X, 3)")
HARD = ("ge(dist(X, Y), {b})", "le(sqr(X) + sqr(Y), 4.5)", "le(X, Y + {b})")


def real_constraint(name: str, body: str, scope: tuple[str, ...], *, hard: bool = False) -> Constraint:
    """Return a constraint over real variables from the text of its body over X and Y."""
    formals, wanted = ("X", "Y")[: len(scope)], Type.BOOLEAN if hard else Type.INTEGER
    source = parse(body, formals, wanted, decimals=True)
    steps, real = fixed_point(source, formals, PLACES, wanted, VALUE_PLACES), RealParameters(formals, PLACES, source)
    if hard:
        return Constraint(name, Predicate(name, formals, steps, real=real), scope, scope)
    return Constraint(name, Function(name, formals, steps, real=real, places=VALUE_PLACES), scope, scope)


def random_team(chance: Random, variables: int, width: int) -> Team:
    """Return a team of robots with one variable each, whose intervals have `width` steps of 0.1."""

    def text(body: str) -> str:
        return body.format(a=chance.randint(-20, 20) / 10, b=chance.randint(1, 15) / 10)

    names = [f"x{number}" for number in range(variables)]
    owned = {}
    for name in names:
        low = chance.randint(-15, 5)
        points = chance.choice([3, 5, 9])
        real = RealInterval(low, low + width, PLACES)
        owned[f"R{name}"] = [Variable(name, Domain(f"D{name}", grid(low, low + width, points), real=real))]
    constraints = [
        real_constraint(f"s{name}", text(chance.choice(SINGLES)), (name,)) for name in names if chance.random() < 0.7
    ]
    for number, pair in enumerate(itertools.combinations(names, 2)):
        if chance.random() < 0.7:
            constraints.append(real_constraint(f"p{number}", text(chance.choice(PAIRS)), pair))
        if chance.random() < 0.25:
            constraints.append(real_constraint(f"h{number}", text(chance.choice(HARD)), pair, hard=True))
    costs = CostUnits(maximize=chance.random() < 0.3, places=VALUE_PLACES)
    return assemble("random", owned, constraints, kind=ProblemKind.DISWCSP, costs=costs)


def best_cost(team: Team) -> Decimal | None:
    """Return the best cost over all multiples of the precision; None if no assignment satisfies the constraints."""
    names = list(team.variables)
    closures = [
        (compile_expression(constraint.applied, names), isinstance(constraint.definition, Predicate))
        for constraint in team.constraints()
    ]
    maximize = team.robots[0].costs.maximize
    best: float = INFINITE
    reals = [variable.domain.real for variable in team.variables.values()]
    for values in itertools.product(*(range(real.low, real.high + 1) for real in reals if real)):
        total = 0
        try:
            for closure, hard in closures:
                found = closure(values)
                if hard and not found:
                    break
                total += 0 if hard else found
            else:
                best = min(best, -total if maximize else total)
        except UndefinedValueError:
            continue
    return None if best == INFINITE else Decimal(int(-best if maximize else best)).scaleb(-VALUE_PLACES)
