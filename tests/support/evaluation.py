"""What a team means, by its own words: the price of every row of every constraint, and its best sum exactly."""

from __future__ import annotations

import itertools
from fractions import Fraction
from hashlib import sha256

from robochoc.model.problem import INFINITE, Team


def digest(team: Team) -> str:
    """Return a fingerprint of the meaning of a small `team`: robots, domains, and what each constraint charges."""
    domains = {name: list(variable.domain) for name, variable in team.variables.items()}
    said: list[object] = [team.name, str(team.kind), team.order, team.owner, domains]
    said += [(robot.costs.maximize, robot.costs.places, robot.costs.constant) for robot in team.robots[:1]]
    for one in team.constraints():
        rows = itertools.product(*(domains[name] for name in one.variables))
        said.append((one.name, one.scope, [one.price(dict(zip(one.variables, row, strict=True))) for row in rows]))
    return sha256(repr(said).encode()).hexdigest()[:16]


def best(team: Team) -> Fraction | None:
    """Return the best sum of all costs of a small `team` in the user's numbers, by trying all; None: there is none."""
    units = team.robots[0].costs
    constant = sum(robot.costs.constant for robot in team.robots)
    constraints = list(team.constraints())
    totals = []
    for row in itertools.product(*(variable.domain for variable in team.variables.values())):
        values = dict(zip(team.variables, row, strict=True))
        prices = [one.price(values) for one in constraints]
        if INFINITE not in prices:
            totals.append(sum(int(price) for price in prices) + constant)
    if not totals:
        return None
    return Fraction(max(totals) if units.maximize else min(totals), 10**units.places)
