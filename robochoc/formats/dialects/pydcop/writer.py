"""Teams as pyDCOP's YAML: tables, owners as hints, a scenario of robots that leave.

pyDCOP has no hard constraints. What forbids costs an infinity that no sum of the other costs reaches, and the file
names it: `infinity: 10000`. pyDCOP passes over that; here the costs from there on forbid again.
"""

from __future__ import annotations

import json
from collections import defaultdict
from collections.abc import Iterator, Mapping

from robochoc.formats.dialects.exported import Exported, decimal, exported, magnitude, maximises
from robochoc.formats.dialects.tables import Amount, CostTable
from robochoc.model.constraint import INFINITE, Domain
from robochoc.model.problem import RemoveAgent, Team
from robochoc.solver.encoding import UnsupportedError

LEAST_INFINITY = 10_000
"""What forbids costs at least so much: pyDCOP's own convention."""


def written(team: Team) -> Mapping[str, bytes]:
    """Return the files of `team`.

    Raises:
        UnsupportedError: if a constraint is too large for a table, or robots join in its scenario.
    """
    files = {f"{team.name}.yaml": "\n".join(_problem(team)) + "\n"}
    if team.scenario:
        files[f"{team.name}.scenario.yaml"] = "\n".join(_scenario(team)) + "\n"
    return {name: text.encode() for name, text in files.items()}


def _problem(team: Team) -> Iterator[str]:
    tables, constant = exported(team)
    maximize = maximises(team)
    infinity = max(LEAST_INFINITY, 10 * magnitude(tables, constant))
    forbids = any(INFINITE in one.table.amounts() for one in tables)
    yield f"name: {_quoted(team.name)}"
    yield f"objective: {'max' if maximize else 'min'}"
    if forbids:
        yield f"# {'Costs of minus this or less' if maximize else 'Costs of this or more'} forbid."
        yield f"infinity: {infinity}"
    yield "domains:"
    for name, variable in team.variables.items():
        yield f"  {_quoted(f'd_{name}')}: {{values: {_values(variable.domain)}}}"
    yield "variables:"
    for name in team.variables:
        yield f"  {_quoted(name)}: {{domain: {_quoted(f'd_{name}')}}}"
    if constant:
        first = next(iter(team.variables))
        tables.append(Exported((first,), CostTable("constant", {}, constant, len(team.variables[first].domain))))
    forbidding = str(-infinity if maximize else infinity)
    yield "constraints:" if tables else "constraints: {}"
    for one in tables:
        yield from _constraint(one, team, forbidding)
    yield "agents:"
    for robot in team.robots:
        yield f"  {_quoted(robot.name)}: {{}}"
    yield "distribution_hints:"
    yield "  must_host:"
    for robot in team.robots:
        yield f"    {_quoted(robot.name)}: [{', '.join(_quoted(one.name) for one in robot.variables)}]"


def _constraint(one: Exported, team: Team, forbidding: str) -> Iterator[str]:
    domains = [team.variables[name].domain for name in one.scope]
    by_cost: dict[str, list[str]] = defaultdict(list)
    for values, cost in one.table.rows.items():
        words = [str(domain.label(value)) for domain, value in zip(domains, values, strict=True)]
        by_cost[_cost(cost, forbidding)].append(" ".join(words))
    yield f"  {_quoted(one.table.name)}:"
    yield "    type: extensional"
    yield f"    variables: [{', '.join(map(_quoted, one.scope))}]"
    if len(one.table.rows) < one.table.size:
        yield f"    default: {_cost(one.table.default, forbidding)}"
    yield "    values:" if by_cost else "    values: {}"
    for told, tuples in by_cost.items():
        yield f"      {told}: {_quoted(' | '.join(tuples))}"


def _cost(cost: Amount, forbidding: str) -> str:
    return forbidding if cost == INFINITE else decimal(cost)


def _values(domain: Domain) -> str:
    if domain.symbols:
        return f"[{', '.join(_quoted(str(domain.label(value))) for value in domain)}]"
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
                raise UnsupportedError("pyDCOP's scenarios only remove agents: this one has other changes")
            yield f"      - {{type: remove_agent, agent: {_quoted(change.name)}}}"


def _quoted(text: str) -> str:
    return json.dumps(text)
