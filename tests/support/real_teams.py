"""Random teams with real variables, and their best cost by enumeration of all multiples of the precision."""

from __future__ import annotations

import itertools
from decimal import Decimal
from random import Random

from robochoc.model.assembly import assemble
from robochoc.model.constraint import Constraint, Domain, Function, Predicate, Relation, Semantics, Variable
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
MIXED = ("sqr(X - Y)", "mul(X, Y)", "if(eq(Y, 2), X, sqr(X))", "div(X, Y)")
"""Costs over a real and an integer variable."""
HARD = ("ge(dist(X, Y), {b})", "le(sqr(X) + sqr(Y), 4.5)", "le(X, Y + {b})")


def real_constraint(name: str, body: str, scope: tuple[str, ...], *, hard: bool = False) -> Constraint:
    """Return a constraint over variables, real if their names begin with x, from the text of its body over X and Y."""
    formals, wanted = ("X", "Y")[: len(scope)], Type.BOOLEAN if hard else Type.INTEGER
    source = parse(body, formals, wanted, decimals=True)
    reals = tuple(formal for formal, name in zip(formals, scope, strict=True) if name.startswith("x"))
    steps, real = fixed_point(source, reals, PLACES, wanted, VALUE_PLACES), RealParameters(reals, PLACES, source)
    if hard:
        return Constraint(name, Predicate(name, formals, steps, real=real), scope, scope)
    return Constraint(name, Function(name, formals, steps, real=real, places=VALUE_PLACES), scope, scope)


def real_team(*constraints: Constraint) -> Team:
    """RA owns x, RB owns xb: intervals from 0 to 10 with steps of 0.1, and grids of three points."""
    domain = Domain("D", grid(0, 100, 3), real=RealInterval(0, 100, PLACES))
    owned = {"RA": [Variable("x", domain)], "RB": [Variable("xb", domain)]}
    costs = CostUnits(places=VALUE_PLACES)
    return assemble("two", owned, constraints, kind=ProblemKind.DISWCSP, costs=costs)


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


def with_integers(team: Team, chance: Random) -> Team:
    """Return `team` with two integer variables, a relation over them, and costs over them and a real variable."""
    owned = {robot.name: [*robot.variables] for robot in team.robots}
    ranges = [(range(3),), (range(-1, 1), range(3, 4)), (range(1), range(2, 5))]
    for name in ("n", "m"):
        owned[f"R{name}"] = [Variable(name, Domain(f"D{name}", chance.choice(ranges)))]
    values = range(-1, 5)
    share = chance.choice([0.1, 0.5, 0.9])
    rows = tuple(row for row in itertools.product(values, values) if chance.random() < share)
    semantics = chance.choice(list(Semantics))
    costs = tuple(chance.choice([INFINITE, chance.randint(-3, 9) * 10**5]) for _ in rows)
    soft = semantics == Semantics.SOFT
    relation = Relation(
        "table", 2, semantics, rows, costs if soft else (), chance.choice([0, INFINITE]) if soft and rows else 0
    )
    terms: list[str | int] = ["n", "m", 0]
    scope = "n", chance.choice(terms)
    joined = [real_constraint(f"f{name}", chance.choice(MIXED), ("x0", name)) for name in ("n", "m")]
    constraints = [*team.constraints(), Constraint("table", relation, scope, scope), *joined]
    return assemble(team.name, owned, constraints, kind=ProblemKind.DISWCSP, costs=team.robots[0].costs)


def best_cost(team: Team) -> Decimal | None:
    """Return the best cost over all multiples of the precision; None if no assignment satisfies the constraints."""
    names = list(team.variables)
    relations = [one for one in team.constraints() if isinstance(one.definition, Relation)]
    closures = [
        (compile_expression(constraint.applied, names), isinstance(constraint.definition, Predicate))
        for constraint in team.constraints()
        if constraint not in relations
    ]
    maximize = team.robots[0].costs.maximize
    best: float = INFINITE
    domains = [variable.domain for variable in team.variables.values()]
    for values in itertools.product(*(range(one.real.low, one.real.high + 1) if one.real else one for one in domains)):
        total = sum(relation.price(dict(zip(names, values, strict=True))) for relation in relations)
        if total == INFINITE:
            continue
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
