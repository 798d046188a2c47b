"""Teams as toulbar2's `.cfn` and `.wcsp`."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from fractions import Fraction
from typing import NamedTuple

from robochoc.formats.dialects.dialect import ExportOptions, Written
from robochoc.formats.dialects.exported import Exported, amounts, decimal, exported, magnitude, maximises
from robochoc.formats.dialects.tables import Amount, Scale
from robochoc.model.constraint import INFINITE, Domain
from robochoc.model.problem import Team
from robochoc.solver.encoding import UnsupportedError

LIMIT = 2**53
"""The limit of costs in their unit: toulbar2 1.1 reads costs in a cfn as floating-point numbers."""


class _Network(NamedTuple):
    """A team's costs with their constant and decimal places, and a bound that no finite sum reaches."""

    tables: list[Exported]
    constant: Fraction
    places: int
    bound: int


def cfn(team: Team, options: ExportOptions) -> Written:
    """Return the `.cfn` of `team`. Its bound is one that no finite sum reaches.

    Forbidden tuples cost three times the bound, since toulbar2 1.1 does not read `inf`: even with the least cost of all
    other functions, such a sum reaches the bound.

    Raises:
        UnsupportedError: if costs or a constraint's table are too large, or the team changes over time.
    """
    del options
    return Written({f"{team.name}.cfn": ("\n".join(_cfn(team, _network(team))) + "\n").encode()})


def wcsp(team: Team, options: ExportOptions) -> Written:
    """Return the `.wcsp` of `team`, without any names.

    Raises:
        UnsupportedError: if a cost is negative or not an integer, costs are maximised, costs or the table of a
            constraint are too large, or the team changes over time.
    """
    del options
    network = _network(team)
    costs = {network.constant, *amounts(network.tables)}
    if maximises(team) or any(cost < 0 or (cost != INFINITE and Fraction(cost) % 1) for cost in costs):
        raise UnsupportedError("a wcsp has integer costs of 0 or more that are minimised; a cfn can say this one")
    return Written({f"{team.name}.wcsp": ("\n".join(_wcsp(team, network)) + "\n").encode()})


def _network(team: Team) -> _Network:
    if team.scenario:
        raise UnsupportedError("toulbar2's formats have no scenario")
    tables, constant = exported(team)
    places, bound = Scale([constant, *amounts(tables)]).places, magnitude(tables, constant)
    if bound * 10**places >= LIMIT:
        unit = f" in units of {decimal(Fraction(1, 10**places))}" if places else ""
        what = f"costs may add up to {bound * 10**places:,}{unit}"
        raise UnsupportedError(f"{what}: toulbar2 1.1 reads only costs below {LIMIT:,} exactly; use smaller costs")
    return _Network(tables, constant, places, bound)


def _cfn(team: Team, network: _Network) -> Iterator[str]:
    tables, constant, places, bound = network
    sign = -1 if maximises(team) else 1
    mustbe = f"{'>' if sign < 0 else '<'}{decimal(sign * bound, places)}"
    forbidding = decimal(sign * 3 * bound, places)
    names = {name: _names(variable.domain) for name, variable in team.variables.items()}
    yield "{"
    yield f'  "problem": {{"name": "{team.name}", "mustbe": "{mustbe}"}},'
    yield '  "variables": {'
    yield ",\n".join(f'    "{name}": {_cfn_domain(team.variables[name].domain, names[name])}' for name in names)
    yield "  },"
    yield '  "functions": {'
    functions = [f'    "constant": {{"scope": [], "costs": [{decimal(constant, places)}]}}'] if constant else []
    for number, one in enumerate(tables):
        scope = ", ".join(f'"{name}"' for name in one.scope)
        costs = ", ".join(
            ", ".join([*(f'"{names[name][value]}"' for name, value in zip(one.scope, values, strict=True)), told])
            for values, told in ((values, _cost(cost, places, forbidding)) for values, cost in one.table.rows.items())
        )
        default = _cost(one.table.default, places, forbidding)
        functions.append(f'    "f{number}": {{"scope": [{scope}], "defaultcost": {default}, "costs": [{costs}]}}')
    yield ",\n".join(functions)
    yield "  }"
    yield "}"


def _cost(cost: Amount, places: int, forbidding: str) -> str:
    return forbidding if cost == INFINITE else decimal(cost, places)


def _counted(domain: Domain) -> bool:
    """Return whether the values are 0, 1, ..., which need no names."""
    return not domain.symbols and len(domain.ranges) == 1 and domain.ranges[0].start == 0


def _names(domain: Domain) -> dict[int, str]:
    """Return what the values are called: names begin with no digit and no sign."""
    if _counted(domain):
        return {value: str(value) for value in domain}
    names = {}
    for value in domain:
        label = str(domain.label(value)) if domain.symbols else f"{'m' if value < 0 else 'v'}{abs(value)}"
        plain = "".join(sign if sign.isalnum() or sign in "_.-" else "_" for sign in label)
        names[value] = plain if plain[0].isalpha() or plain[0] == "_" else f"v{plain}"
    if len(set(names.values())) < len(names):
        names = {value: f"{name}_{number}" for number, (value, name) in enumerate(names.items())}
    return names


def _cfn_domain(domain: Domain, names: Mapping[int, str]) -> str:
    if _counted(domain):
        return str(len(domain))
    return f"[{', '.join(f'{chr(34)}{name}{chr(34)}' for name in names.values())}]"


def _wcsp(team: Team, network: _Network) -> Iterator[str]:
    tables, constant, _, bound = network
    place = {name: number for number, name in enumerate(team.variables)}
    codes = {
        name: {value: code for code, value in enumerate(variable.domain)} for name, variable in team.variables.items()
    }
    sizes = [len(variable.domain) for variable in team.variables.values()]
    yield f"{team.name} {len(sizes)} {max(sizes)} {len(tables) + (1 if constant else 0)} {bound}"
    yield " ".join(map(str, sizes))
    if constant:
        yield f"0 {constant} 0"
    for one in tables:
        scope = " ".join(str(place[name]) for name in one.scope)
        yield f"{len(one.scope)} {scope} {_whole(one.table.default, bound)} {len(one.table.rows)}"
        for values, cost in one.table.rows.items():
            coded = " ".join(str(codes[name][value]) for name, value in zip(one.scope, values, strict=True))
            yield f"{coded} {_whole(cost, bound)}"


def _whole(cost: Amount, bound: int) -> int:
    return bound if cost == INFINITE else int(cost)
