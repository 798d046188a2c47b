"""The problems that all libraries solve, in the format of each: written once by robochoc's own exporters."""

from __future__ import annotations

import itertools
import json
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from colouring import AGENTS, EDGES, colouring
from measure import FailedError

from robochoc.formats import write_team
from robochoc.formats.dialects.dialect import ExportOptions
from robochoc.formats.dialects.registry import find_dialect
from robochoc.generators.coloring import coloring
from robochoc.generators.random_csp import random_csp
from robochoc.model.constraint import INFINITE, Constraint, Domain, Predicate, Relation, Semantics
from robochoc.model.problem import ProblemKind, Team

TEAM = "team"
FILES = {"frodo": "frodo.xml", "pydcop": "pydcop.yaml", "xcsp3": "problem.xml"}
RAVEN = "raven.json"
TABLES = "tables.json"


@dataclass(frozen=True)
class Family:
    """Problems of one kind: what they are, how one is made of its seed, and what a run may take."""

    name: str
    text: str
    team: Callable[[int], Team]
    seeds: Iterable[int]
    cpu_s: int
    limit_s: float
    decided: bool = True
    """True if each problem has one right answer. If not, answers are compared by their cost."""


def _random(tightness: float) -> Callable[[int], Team]:
    return lambda seed: random_csp(20, 10, 0.25, tightness, seed)


COLOURING = Family(
    "3-colouring",
    f"{AGENTS} agents, {EDGES} edges, a solution hidden in each: `colouring.py`",
    colouring,
    range(3),
    15,
    120,
)
LOOSE = Family(
    "<20,10,.25,.60>",
    "`robochoc generate random --agents 20 --domain 10 --density 0.25 --tightness 0.6`",
    _random(0.6),
    range(3),
    15,
    120,
)
TIGHT = Family(
    "<20,10,.25,.72>",
    "`robochoc generate random --agents 20 --domain 10 --density 0.25 --tightness 0.72`",
    _random(0.72),
    range(5),
    15,
    120,
)
COSTS = Family(
    "costs",
    "`robochoc generate random --agents 10 --domain 5 --density 0.35 --max-cost 100 --connected`",
    lambda seed: random_csp(10, 5, 0.35, 0, seed, connected=True, max_cost=100),
    range(3),
    15,
    120,
)
LOCAL = Family(
    "local search",
    "`robochoc generate coloring --agents 1000 --degree 4`: soft 3-colouring, 200 cycles",
    lambda seed: coloring(1000, 3, 4, seed),
    range(1),
    60,
    240,
    decided=False,
)
SATISFACTION = (COLOURING, LOOSE, TIGHT)
OPTIMISATION = (COSTS, LOCAL)


def write_problem(team: Team, folder: Path) -> None:
    """Write `team` to `folder`: as a team, and in all formats of other libraries that can say it."""
    folder.mkdir(parents=True)
    write_team(team, folder / TEAM)
    for name, file in FILES.items():
        (folder / file).write_bytes(_exported(in_tables(team), name))
    (folder / TABLES).write_text(json.dumps(_in_prices(team)))
    if team.kind is ProblemKind.DISCSP:
        (folder / RAVEN).write_text(json.dumps(_for_raven(team)))


def in_tables(team: Team) -> Team:
    """The same problem, its hard predicates as relations: FRODO's first parser reads no predicates."""
    domains = {name: variable.domain for name, variable in team.variables.items()}
    robots = [
        replace(
            robot,
            parents=tuple(
                replace(parent, constraints=tuple(_in_table(one, domains) for one in parent.constraints))
                for parent in robot.parents
            ),
        )
        for robot in team.robots
    ]
    return replace(team, robots=tuple(robots))


def _in_table(constraint: Constraint, domains: Mapping[str, Domain]) -> Constraint:
    if not isinstance(constraint.definition, Predicate) or constraint.cost != INFINITE:
        return constraint
    forbidden = tuple(_forbidden(constraint, domains))
    relation = Relation(f"R{constraint.name}", len(constraint.variables), Semantics.CONFLICTS, forbidden)
    return replace(constraint, definition=relation, scope=constraint.variables, parameters=constraint.variables)


def _forbidden(constraint: Constraint, domains: Mapping[str, Domain]) -> Iterator[tuple[int, ...]]:
    scope = constraint.variables
    for values in itertools.product(*(domains[name] for name in scope)):
        if not constraint.allows(dict(zip(scope, values, strict=True))):
            yield values


def _exported(team: Team, name: str) -> bytes:
    dialect = find_dialect(name)
    if dialect is None or dialect.write is None:
        raise FailedError(f"no export to {name}")
    (content,) = dialect.write(team, ExportOptions()).files.values()
    return content


def _for_raven(team: Team) -> dict[str, Any]:
    """Domains, and for each constraint its variables and the pairs that it forbids."""
    domains = {name: variable.domain for name, variable in team.variables.items()}
    constraints = [(one.variables, list(_forbidden(one, domains))) for one in team.constraints()]
    return {"domains": {name: list(domain) for name, domain in domains.items()}, "constraints": constraints}


def _in_prices(team: Team) -> dict[str, Any]:
    """Domains, and for each constraint its variables and the price of each row of values, None if forbidden."""
    domains = {name: variable.domain for name, variable in team.variables.items()}
    constraints = [(one.variables, list(_prices(one, domains))) for one in team.constraints()]
    return {"domains": {name: list(domain) for name, domain in domains.items()}, "constraints": constraints}


def _prices(constraint: Constraint, domains: Mapping[str, Domain]) -> Iterator[float | None]:
    scope = constraint.variables
    for values in itertools.product(*(domains[name] for name in scope)):
        price = constraint.price(dict(zip(scope, values, strict=True)))
        yield None if price == INFINITE else int(price) if price == int(price) else price
