"""Random asymmetric DCOPs: partially known constraints whose parts cost something, and runs held against the truth."""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from dataclasses import replace
from random import Random
from typing import NamedTuple

from robochoc.generators.random_csp import random_csp
from robochoc.model.orders import Order
from robochoc.model.outcome import Outcome, Verdict
from robochoc.model.problem import INFINITE, Constraint, ConstraintModel, Relation, Semantics, Team
from robochoc.run import Options, Runtime, solve
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


class Spent(NamedTuple):
    """The sums over some runs."""

    messages: int
    ncccs: int


def spent_on_asymmetric(protocol: str) -> Spent:
    """Return what `protocol` needs for three connected problems of six robots, always the same ones."""
    messages = ncccs = 0
    for seed in range(3):
        team = random_csp(6, 3, 0.6, 0, seed, connected=True, max_cost=20, asymmetric=True)
        metrics = solve(team, Options(protocol=protocol, runtime=Runtime.SIMULATOR, cache=False)).metrics
        messages += sum(metrics.messages.values())
        ncccs += metrics.ncccs
    return Spent(messages, ncccs)
