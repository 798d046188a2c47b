"""The part of XDisCSP 1.0 that DCOPSolver supports. Other readers of XDisCSP read it, too.

Its parser (czy920/DCOPSolverOld) supports one variable per agent, domains from 1 to n, and one relation on two
variables for each pair of neighbours, in which each tuple has an integer cost. The format has no infinity, and the
protocols of DCOPSolver require a connected graph. So costs of one variable are added to those of a pair, and a
forbidden tuple costs more than all other costs together; this cost is the attribute `maximalCost` of XCSP 2.1.
"""

from __future__ import annotations

import itertools
from collections import defaultdict
from collections.abc import Iterator, Mapping
from fractions import Fraction
from pathlib import Path

from lxml import etree

from robochoc.formats.dialects import xdiscsp
from robochoc.formats.dialects.dialect import ConversionNote, Dialect, ExportOptions, ExportResult
from robochoc.formats.dialects.exact_costs import Amount
from robochoc.formats.dialects.tabulation import (
    TabulatedConstraint,
    amounts,
    finite_cost_bound,
    is_maximised,
    owned_constraints,
    tabulate,
)
from robochoc.formats.dialects.xdiscsp import FORMAT
from robochoc.model.constraint import INFINITE
from robochoc.model.problem import Team
from robochoc.solver.errors import UnsupportedError

NAME = "dcopsolver"
TITLE = "DCOPSolver's XDisCSP"
LIMIT = 2**31 - 1
"""The integer that DCOPSolver treats as infinity."""

_PAIR = 2
_Pair = tuple[str, str]


def _write(team: Team, options: ExportOptions) -> ExportResult:
    """Return the file.

    Raises:
        UnsupportedError: if DCOPSolver does not support a part of the team.
    """
    del options
    _check(team)
    tables, constant = tabulate(team)
    if any(cost < 0 or (cost != INFINITE and Fraction(cost) % 1) for cost in {constant, *amounts(tables)}):
        raise UnsupportedError(
            f"{TITLE} requires integer costs of 0 or more: use --format frodo or --format pydcop for other costs"
        )
    bound = finite_cost_bound(tables, constant)
    by_pair = _by_pair(team, tables)
    if bound * len(by_pair) >= LIMIT:
        raise UnsupportedError(
            f"{TITLE}: costs of up to {bound:,} are too large for integers of 32 bits: use smaller costs"
        )
    costs = {pair: _costs(team, pair, parts) for pair, parts in by_pair.items()}
    first = next(iter(costs))
    costs[first] = {values: cost + int(constant) for values, cost in costs[first].items()}
    return ExportResult({f"{team.name}.xml": _document(team, costs, bound)}, tuple(_notes(team)))


def _check(team: Team) -> None:
    if team.dynamic:
        raise UnsupportedError(f"{TITLE} does not support problems that change over time: remove scenario.xml")
    if is_maximised(team):
        raise UnsupportedError(f"{TITLE} does not support utilities: costs are minimised")
    for robot in team.robots:
        if len(robot.variables) > 1:
            raise UnsupportedError(
                f"{TITLE} allows one variable for each agent, but {robot.name} has {len(robot.variables)}"
            )
    if len(team.variables) < _PAIR:
        raise UnsupportedError(f"{TITLE} requires two agents or more")


def _by_pair(team: Team, tables: list[TabulatedConstraint]) -> dict[_Pair, list[TabulatedConstraint]]:
    """Return the tables of each pair of variables, in the order of the agents. The pairs connect all variables."""
    place = {name: number for number, name in enumerate(team.variables)}
    pairs: dict[_Pair, list[TabulatedConstraint]] = defaultdict(list)
    unary = []
    for one in tables:
        if len(one.scope) > _PAIR:
            what = f"the constraint {one.name} has {len(one.scope)} variables"
            raise UnsupportedError(f"{TITLE} allows constraints of two variables only, but {what}")
        if len(one.scope) == _PAIR:
            first, second = sorted(one.scope, key=place.__getitem__)
            pairs[first, second].append(one)
        else:
            unary.append(one)
    for pair in _missing_links(team, pairs):
        pairs[pair] = []
    for one in unary:
        pair = next(pair for pair in pairs if one.scope[0] in pair)
        pairs[pair].append(one)
    return pairs


def _missing_links(team: Team, pairs: Mapping[_Pair, object]) -> Iterator[_Pair]:
    """Yield, for each part of the graph without the first variable, the first variable and a variable in that part."""
    near: dict[str, list[str]] = defaultdict(list)
    for one, other in pairs:
        near[one].append(other)
        near[other].append(one)
    first, *others = team.variables
    seen: set[str] = set()
    for start in (first, *others):
        if start in seen:
            continue
        if start != first:
            yield first, start
        waiting = [start]
        while waiting:
            name = waiting.pop()
            if name not in seen:
                seen.add(name)
                waiting += near[name]


def _costs(team: Team, pair: _Pair, parts: list[TabulatedConstraint]) -> dict[tuple[int, int], Amount]:
    found: dict[tuple[int, int], Amount] = {}
    domains = [team.variables[name].domain for name in pair]
    for one, other in itertools.product(*(enumerate(domain, 1) for domain in domains)):
        values = {pair[0]: one[1], pair[1]: other[1]}
        found[one[0], other[0]] = sum(
            part.table.rows.get(tuple([values[name] for name in part.scope]), part.table.default) for part in parts
        )
    return found


def _document(team: Team, costs: Mapping[_Pair, Mapping[tuple[int, int], Amount]], bound: int) -> bytes:
    root = etree.Element("instance")
    stated = {
        "name": team.name,
        "type": "DCOP",
        "benchmark": "RandomDCOP",  # the parser requires a name here, and accepts this name for any problem
        "model": "Simple",
        "constraintModel": "TKC",
        "maxConstraintArity": "2",
        "format": FORMAT,
    }
    etree.SubElement(root, "presentation", stated)
    sections = {name: etree.SubElement(root, name) for name in ("agents", "domains", "variables", "relations")}
    constraints = etree.SubElement(root, "constraints", initialCost="0", maximalCost=str(bound))
    for number, robot in enumerate(team.robots, 1):
        (variable,) = robot.variables
        etree.SubElement(sections["agents"], "agent", name=robot.name, id=str(number), description=robot.name)
        size = len(variable.domain)
        if _is_renamed(team, variable.name):
            labels = ", ".join(
                f"{place} is {variable.domain.label(value)}" for place, value in enumerate(variable.domain, 1)
            )
            sections["domains"].append(etree.Comment(f" {variable.name}: {labels} ".replace("--", "- -")))
        domain = etree.SubElement(sections["domains"], "domain", name=f"D{number}", nbValues=str(size))
        domain.text = f"1..{size}"
        stated = {"agent": robot.name, "name": variable.name, "id": "1", "domain": f"D{number}"}
        etree.SubElement(sections["variables"], "variable", {**stated, "description": variable.name})
    for number, (pair, table) in enumerate(costs.items()):
        stated = {"name": f"R{number}", "arity": "2", "nbTuples": str(len(table)), "semantics": "soft"}
        relation = etree.SubElement(sections["relations"], "relation", {**stated, "defaultCost": "infinity"})
        relation.text = "|".join(
            f"{bound if cost == INFINITE else cost}:{one} {other}" for (one, other), cost in table.items()
        )
        stated = {"name": f"C{number}", "model": "TKC", "arity": "2", "scope": " ".join(pair)}
        etree.SubElement(constraints, "constraint", {**stated, "reference": f"R{number}"})
    for name, section in (*sections.items(), ("constraints", constraints)):
        section.set(f"nb{name.capitalize()}", str(len(section.findall("*"))))
    body = etree.tostring(root, pretty_print=True, encoding="unicode")
    return f'<?xml version="1.0" encoding="UTF-8"?>\n{body}'.encode()


def _is_renamed(team: Team, name: str) -> bool:
    domain = team.variables[name].domain
    return bool(domain.symbols) or list(domain) != [*range(1, len(domain) + 1)]


def _notes(team: Team) -> Iterator[ConversionNote]:
    if renamed := [name for name in team.variables if _is_renamed(team, name)]:
        text = f"the values of {len(renamed)} variables are numbered from 1; comments in the file name the originals"
        yield ConversionNote("values", text)
    if any(one.private_part for one in owned_constraints(team)):
        yield ConversionNote(
            "known to more", "both agents of a constraint know it: DCOPSolver does not support partial knowledge (PKC)"
        )


def _recognises(path: Path, beginning: bytes) -> bool:
    """Return False: such a file is recognised as XDisCSP."""
    del path, beginning
    return False


DIALECT = Dialect(NAME, TITLE, _recognises, xdiscsp.DIALECT.read, _write)
