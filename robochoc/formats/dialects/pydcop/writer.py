"""Write teams as pyDCOP's YAML: tables, owners, and a scenario of robots that leave.

The file also has the section `distribution` of a distribution file, so it can be passed to pyDCOP as both. If a robot
has several variables, pyDCOP itself finds no distribution for DPOP. For algorithms on factors (Max-Sum) it finds one
(`adhoc`): the hints name the owners, and the capacities are sufficient.

pyDCOP has no hard constraints. A forbidden tuple gets a cost that exceeds every sum of the other costs, and the file
contains this cost: `infinity: 10000`. pyDCOP ignores this key; an import treats costs from this value on as infinite.
"""

from __future__ import annotations

import json
from collections import defaultdict
from collections.abc import Iterable, Iterator

from robochoc.formats.dialects.dialect import ConversionNote, ExportOptions, ExportResult
from robochoc.formats.dialects.exact_costs import Amount
from robochoc.formats.dialects.tabulation import (
    TabulatedConstraint,
    amounts,
    constant_table,
    decimal,
    finite_cost_bound,
    forbidden_cost,
    is_maximised,
    tabulate,
)
from robochoc.model.constraint import INFINITE, Domain
from robochoc.model.problem import RemoveAgent, Team
from robochoc.solver.errors import UnsupportedError

CAPACITY = 1000
"""The capacity of an agent per variable, constraint and value. It exceeds the needs of all algorithms in pyDCOP."""
LIMIT = 2**31 - 1
"""The worst cost in pyDCOP's DPOP."""


def write(team: Team, options: ExportOptions) -> ExportResult:
    """Return the files of `team`.

    Raises:
        UnsupportedError: if costs or a constraint's table are too large, or the scenario contains changes other than
            leaving robots.
    """
    del options
    file = f"{team.name}.yaml"
    files = {file: "\n".join(_problem(team)) + "\n"}
    if team.scenario:
        files[f"{team.name}.scenario.yaml"] = "\n".join(_scenario(team)) + "\n"
    several = any(len(robot.variables) > 1 for robot in team.robots)
    text = (
        f"robots have several variables: give the file to pyDCOP as the distribution, too, with --distribution {file}"
    )
    notes = (ConversionNote("distribution", text),) if several else ()
    return ExportResult({name: text.encode() for name, text in files.items()}, notes)


def _problem(team: Team) -> Iterator[str]:
    tables, constant = tabulate(team)
    maximize = is_maximised(team)
    most, forbids = finite_cost_bound(tables, constant), INFINITE in amounts(tables)
    infinity = forbidden_cost(tables, constant)
    if (infinity if forbids else most) >= LIMIT:
        more = ", and forbidden tuples cost ten times as much" if forbids else ""
        what = f"costs may add up to {most - 1:,}{more}"
        raise UnsupportedError(f"{what}: pyDCOP's costs are below {LIMIT:,}; use smaller costs")
    yield f"name: {_quoted(team.name)}"
    yield f"objective: {'max' if maximize else 'min'}"
    if forbids:
        yield f"# {'Costs of minus this or less' if maximize else 'Costs of this or more'} are infinite."
        yield f"infinity: {infinity}"
    yield "domains:"
    for name, variable in team.variables.items():
        yield f"  {_quoted(f'd_{name}')}: {{values: {_values(variable.domain)}}}"
    yield "variables:"
    for name in team.variables:
        yield f"  {_quoted(name)}: {{domain: {_quoted(f'd_{name}')}}}"
    if constant:
        tables.append(constant_table(team, constant))
    forbidden = str(-infinity if maximize else infinity)
    yield "constraints:" if tables else "constraints: {}"
    for one in tables:
        yield from _constraint(one, team, forbidden)
    sizes = {name: len(variable.domain) for name, variable in team.variables.items()}
    capacity = CAPACITY * sum(1 + sizes[name] for name in [*sizes, *(name for one in tables for name in one.scope)])
    yield "agents:"
    for robot in team.robots:
        yield f"  {_quoted(robot.name)}: {{capacity: {capacity}}}"
    yield "distribution_hints:"
    yield "  must_host:"
    yield from (f"  {line}" for line in _owners(team))
    yield "distribution:"
    yield from _owners(team)


def _owners(team: Team) -> Iterator[str]:
    for robot in team.robots:
        yield f"  {_quoted(robot.name)}: {_list(one.name for one in robot.variables)}"


def _constraint(one: TabulatedConstraint, team: Team, forbidden: str) -> Iterator[str]:
    domains = [team.variables[name].domain for name in one.scope]
    by_cost: dict[str, list[str]] = defaultdict(list)
    for values, cost in one.table.rows.items():
        words = [_value(domain, value) for domain, value in zip(domains, values, strict=True)]
        by_cost[_cost(cost, forbidden)].append(" ".join(words))
    yield f"  {_quoted(one.name)}:"
    yield "    type: extensional"
    yield f"    variables: {_list(one.scope)}"
    if len(one.table.rows) < one.table.size:
        yield f"    default: {_cost(one.table.default, forbidden)}"
    yield "    values:" if by_cost else "    values: {}"
    for cost_text, tuples in by_cost.items():
        yield f"      {cost_text}: {_quoted(' | '.join(tuples))}"


def _cost(cost: Amount, forbidden: str) -> str:
    return forbidden if cost == INFINITE else decimal(cost)


def _value(domain: Domain, value: int) -> str:
    return str(domain.label(value)) if domain.symbols else str(value)


def _values(domain: Domain) -> str:
    if domain.symbols:
        return f"[{', '.join(_quoted(_value(domain, value)) for value in domain)}]"
    if len(domain.ranges) == 1:
        return f'["{domain.ranges[0][0]}..{domain.ranges[0][-1]}"]'
    return f"[{', '.join(map(str, domain))}]"


def _scenario(team: Team) -> Iterator[str]:
    yield "events:"
    for number, event in enumerate(team.scenario, 1):
        yield f"  - {{id: w{number}, delay: 1}}"
        yield f"  - id: e{number}"
        yield "    actions:"
        for change in event.changes:
            if not isinstance(change, RemoveAgent):
                raise UnsupportedError("pyDCOP's scenarios only remove agents: remove other changes from scenario.xml")
            yield f"      - {{type: remove_agent, agent: {_quoted(change.name)}}}"


def _list(names: Iterable[str]) -> str:
    return f"[{', '.join(map(_quoted, names))}]"


def _quoted(text: str) -> str:
    return json.dumps(text)
