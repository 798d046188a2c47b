"""Random asymmetric DCOPs: partially known constraints whose parts cost something, and runs held against the truth."""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from dataclasses import replace
from random import Random

from robochoc.model.assembly import Extras, assemble
from robochoc.model.orders import Order
from robochoc.model.outcome import Outcome, Verdict
from robochoc.model.problem import (
    INFINITE,
    Constraint,
    ConstraintModel,
    Domain,
    ProblemKind,
    Relation,
    Semantics,
    Team,
    Variable,
)
from robochoc.run import Options, solve
from robochoc.run.registry import protocol_named
from tests.support.cost_problems import MAX_COST, random_cost_team, soft_table, softened
from tests.support.loose_problems import loosened, minimum_cost, several_variables_team
from tests.support.pkc_problems import one_sided, with_part, with_robot
from tests.support.problems import PREDICATES
from tests.support.random_options import random_options

SEVERAL, LOOSE, ONE_SIDED = 0.2, 0.4, 0.2
"""How often teams are of robots with several variables, have what nobody needs, or lack a part."""


def random_asymmetric_team(chance: Random, *, simple: bool = False) -> Team:
    """Return a team of 2 to 8 robots, some in unconnected parts; most constraints of two robots are PKCs with costs.

    Parts are soft tables, hard ones, and predicates with or without a cost. Beside them there are TKC constraints, also
    for the same pair, and n-ary ones. `simple`: robots have one variable each.
    """
    several = not simple and chance.random() < SEVERAL
    plain = softened(several_variables_team(chance, n_ary=True), chance) if several else random_cost_team(chance)
    team = with_asymmetric_costs(plain, chance)
    if chance.random() < ONE_SIDED:
        team = one_sided(team, chance)
    return loosened(team, chance) if not simple and chance.random() < LOOSE else team


def with_asymmetric_costs(team: Team, chance: Random) -> Team:
    """Return `team`; most constraints of two robots are the lower robot's part now, and the higher has another."""
    numbers = itertools.count()
    parts: list[tuple[str, str, Constraint]] = []
    hard = chance.choice((0, 0.1, 0.2))
    for robot in team.robots:
        for parent in robot.parents:
            held = []
            for constraint in parent.constraints:
                pair = len({team.owner[name] for name in constraint.variables}) == 2
                if pair and chance.random() < 0.8:
                    named = replace(constraint, name=f"A{next(numbers)}")
                    parts.append((parent.name, robot.name, _part(team, named, chance, hard)))
                    held.append(replace(named, model=ConstraintModel.PKC))
                    if chance.random() < 0.15:
                        held.append(constraint)
                else:
                    held.append(constraint)
            team = _holding(team, robot.name, parent.name, held)
    for parent_name, child, part in parts:
        team = with_part(team, parent_name, child, part)
    return team


def random_pkc_options(team: Team, protocol: str, chance: Random) -> Options:
    """Return options for a random schedule, and an order that turns no PKC link, which another seed's might."""
    options = random_options(team, protocol, chance)
    return replace(options, order=None) if options.order is Order.RANDOM else options


def check_asymmetric(
    protocol: str, chance: Random, options: Options | None = None, settings: Mapping[str, str] | None = None
) -> Outcome:
    """Solve a random team by the complete `protocol`; the cost must be brute force's."""
    team = random_asymmetric_team(chance)
    how = random_pkc_options(team, protocol, chance)
    if options is not None:
        how = replace(options, protocol=protocol, order=how.order)
    how = replace(how, settings=dict(settings or {}))
    cost = minimum_cost(team)
    outcome = solve(team, how)
    if cost == INFINITE:
        assert outcome.verdict is Verdict.NO_SOLUTION, (team, how)
    else:
        assert (outcome.verdict, outcome.cost) == (Verdict.OPTIMAL, cost), (team, how)
        assert outcome.verified
    assert protocol_named(protocol).traits.complete
    return outcome


def _part(team: Team, like: Constraint, chance: Random, hard: float) -> Constraint:
    """Return another part of the constraint `like`: over the same variables."""
    scope = list(like.variables)
    if len(scope) == 2 and chance.random() < 0.2:
        cost = INFINITE if chance.random() < hard else chance.randint(1, MAX_COST)
        definition = chance.choice(PREDICATES)
        return Constraint(like.name, definition, tuple(scope), tuple(scope), ConstraintModel.PKC, cost=cost)
    domains = {name: sorted(team.variables[name].domain) for name in scope}
    return replace(soft_table(chance, domains, scope, hard), name=like.name, model=ConstraintModel.PKC)


def _holding(team: Team, child: str, parent: str, held: Sequence[Constraint]) -> Team:
    """Return `team`, where `child` holds these constraints under `parent`."""
    robot = team[child]
    parents = tuple(replace(one, constraints=tuple(held)) if one.name == parent else one for one in robot.parents)
    return with_robot(team, replace(robot, parents=parents))


def priced_part(scope: str, costs: Mapping[tuple[int, int], float]) -> Constraint:
    """Return a robot's part of a constraint over two variables of one letter each; what is not listed costs nothing."""
    relation = Relation("R", 2, Semantics.SOFT, tuple(costs), tuple(costs.values()), 0)
    return Constraint(scope, relation, tuple(scope), tuple(scope))


def two_valued(names: str, parts: Mapping[str, Sequence[Constraint]]) -> Team:
    """Return robots RA, RB, ... for the letters of `names`, of the values 1 and 2, with their parts of constraints."""
    own = {f"R{name}": [Variable(name, Domain("D", (range(1, 3),)))] for name in names}
    return assemble("asymmetric", own, [], kind=ProblemKind.DISWCSP, extras=Extras(parts=parts))


def divided_pair() -> Team:
    """A pays 3 for (1, 1) and 1 for (1, 2); B pays 2 for (1, 2), 5 for (2, 1) and 9 for (2, 2)."""
    parts = {
        "RA": [priced_part("AB", {(1, 1): 3, (1, 2): 1})],
        "RB": [priced_part("AB", {(2, 1): 5, (1, 2): 2, (2, 2): 9})],
    }
    return two_valued("AB", parts)
