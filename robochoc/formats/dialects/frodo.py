"""FRODO's XCSP 2.1 (`format="XCSP 2.1_FRODO"`), in one file or in one file per agent, and plain XCSP 2.0 and 2.1.

Sources: FRODO's manual, Appendix A, and its schemas; Roussel and Lecoutre, arXiv 0902.2362.

As shipped, FRODO ignores constraints in intension (only its JaCoP parser reads them), and its costs have 32 bits. So
constraints are written as relations, and decimal costs as integers of a smaller unit, which the file names. FRODO's
default parser ignores the `agent` of a constraint, or charges only that agent, so the attribute is not written.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import replace
from fractions import Fraction
from pathlib import Path

from lxml import etree

from robochoc.formats.diagnostics import shortened
from robochoc.formats.dialects.dialect import (
    ConversionNote,
    Dialect,
    ExportOptions,
    ExportResult,
    ImportOptions,
    ImportResult,
    can_state_random_variables,
)
from robochoc.formats.dialects.exact_costs import Amount, Scale
from robochoc.formats.dialects.tabulation import (
    OwnedConstraint,
    TabulatedConstraint,
    amounts,
    constant_table,
    decimal,
    finite_cost_bound,
)
from robochoc.formats.dialects.xcsp21.document import Document, FlatTeam, cost_text, in_xcsp21_operators
from robochoc.formats.dialects.xcsp21.instance import (
    UNIT,
    AsymmetricTable,
    ForeignConstraint,
    ForeignTable,
    Formula,
    Instance,
    refuse,
)
from robochoc.formats.dialects.xcsp21.reader import PUBLIC, FileHead, read_instance
from robochoc.formats.dialects.xcsp21.team import to_team
from robochoc.formats.element_view import ElementView
from robochoc.formats.global_constraints import PREFIX, write_global
from robochoc.model.constraint import INFINITE, Domain, Function, GlobalPredicate, Predicate, Relation, Variable
from robochoc.model.expression import Apply, Constant, Expression
from robochoc.model.problem import RandomVariable, Robot, Team
from robochoc.model.uncertainty import declared_robots, random_variables
from robochoc.solver.errors import UnsupportedError
from robochoc.system.plain_text import counted

NAME = "frodo"
FORMAT = "XCSP 2.1_FRODO"
TITLE = "FRODO's XCSP 2.1"
KEEPS_FORMULAS = "--intension writes it as a predicate or function, for FRODO's JaCoP parser"
LIMIT = 2**31 - 1
"""The integer that FRODO, whose costs have 32 bits, treats as infinity."""

_CHANCE = ""
"""The owner of random variables: no agent."""
_SELF = re.compile(rb"<agents\s[^>]*\bself\s*=")
_TERM = r"(?:X\d+|-?\d+)"
_FORMS = {
    "allDifferent": re.compile(rf"\[ (?:{_TERM} )+\]"),
    "weightedSum": re.compile(rf"\[ (?:{{ -?\d+ {_TERM} }} )+\] <[a-z]+/> -?\d+"),
    "element": re.compile(rf"X\d+ \[ (?:{_TERM} )+\] {_TERM}"),
    "cumulative": re.compile(rf"\[ (?:{{ {_TERM} {_TERM} {_TERM} }} )+\] <le/> {_TERM}"),
}
"""The parameters of each global constraint that FRODO reads."""


def _recognises(_path: Path, beginning: bytes) -> bool:
    found = FileHead(beginning)
    if not found.is_instance or "XDisCSP" in found.format:
        return False
    return found.format.startswith("XCSP 2") or (not found.format and found.has_agents) or found.is_network


def _is_part(_path: Path, beginning: bytes) -> bool:
    return _SELF.search(beginning) is not None


def _read(paths: Sequence[Path], options: ImportOptions) -> ImportResult:
    instances = [read_instance(path, options, _private_agent) for path in paths]
    result = merge(instances)
    result.name = paths[0].stem if len(paths) == 1 else paths[0].absolute().parent.name
    return to_team(result, NAME, options)


def _private_agent(element: ElementView, _instance: Instance) -> str:
    agent = element.attribute("agent")
    return "" if agent == PUBLIC else agent


def merge(instances: Sequence[Instance]) -> Instance:
    """Return the problem in the files of all agents, for example those written by FRODO's `-split`.

    Constraints with the same name, scope and contents in several files are one constraint. Variables in several files
    are one variable, and must have the same domain and owner.

    Raises:
        InvalidInputError: if the files do not belong together, or a file is missing.
    """
    result = replace(instances[0], self_agent="", agents=[], variables={}, random={}, laws={}, constraints=[], notes=[])
    if len(instances) > 1:
        _check_members(instances)
    _check_complete(instances)
    known: dict[tuple[str, frozenset[str]], ForeignConstraint] = {}
    for one in instances:
        result.agents += [name for name in one.agents if name not in result.agents]
        result.notes += [note for note in one.notes if note not in result.notes]
        _add_variables(result, one)
        for name, law in one.laws.items():
            if result.laws.setdefault(name, law) != law:
                what = f"the random variable '{shortened(name)}' has other probabilities in another file"
                refuse(one.file, one.random[name].line, what, "write the same probabilities in all files")
        for constraint in one.constraints:
            if len(instances) == 1:
                result.constraints.append(constraint)
                continue
            key = constraint.name, frozenset(constraint.scope)
            first = known.setdefault(key, constraint)
            if first is constraint:
                result.constraints.append(constraint)
            elif not _same(first, constraint):
                if not (is_hard(first) and is_hard(constraint)):
                    what = f"the constraint '{shortened(constraint.name)}' has different costs"
                    refuse(
                        one.file, constraint.line, what, f"rename it, or write the costs of {first.file}:{first.line}"
                    )
                result.constraints.append(constraint)
    return result


def is_hard(constraint: ForeignConstraint) -> bool:
    """Return whether each cost of a constraint is 0 or infinite."""
    match constraint.content:
        case ForeignTable(costs=costs, default=default):
            return {default, *costs.values()} <= {0, INFINITE}
        case Formula(definition=Predicate(), cost=cost):
            return cost is None
        case _:
            return False


def _check_members(instances: Sequence[Instance]) -> None:
    selves = {one.self_agent: one for one in instances}
    for one in instances:
        if not one.self_agent:
            refuse(one.file, 0, "is a complete problem", "import one complete problem at a time")
        if selves[one.self_agent] is not one:
            other = selves[one.self_agent].file
            what = f"is a second file of agent {shortened(one.self_agent)}; the first is {other}"
            refuse(one.file, 0, what, "import one of the two")
        if one.maximize != instances[0].maximize:
            here, there = ("maximises", "minimises") if one.maximize else ("minimises", "maximises")
            what = f"{here} the costs, but {instances[0].file} {there} them"
            refuse(one.file, 0, what, 'write the same value of maximize="..." in all files')


def _check_complete(instances: Sequence[Instance]) -> None:
    """Raise `InvalidInputError` if the file of an agent with variables is missing."""
    selves = {one.self_agent for one in instances if one.self_agent}
    if not selves:
        return
    for one in instances:
        for variable in one.variables.values():
            if variable.owner and variable.owner not in selves:
                what = f"is the file of agent {shortened(one.self_agent)} only; the file of agent"
                what = f"{what} {shortened(variable.owner)}, which owns {shortened(variable.name)}, is missing"
                refuse(one.file, variable.line, what, "import the files of all agents, or their folder")


def _add_variables(result: Instance, one: Instance) -> None:
    for variable in (*one.variables.values(), *one.random.values()):
        known = result.random if variable.name in one.random else result.variables
        first = known.setdefault(variable.name, variable)
        if (first.ranges, first.owner) != (variable.ranges, variable.owner):
            what = f"the variable '{shortened(variable.name)}' has a different domain or agent in another file"
            refuse(one.file, variable.line, what, "write the same domain and agent in all files")


def _same(one: ForeignConstraint, other: ForeignConstraint) -> bool:
    match one.content, other.content:
        case ForeignTable() as left, ForeignTable() as right:
            return (one.scope, left.costs, left.default) == (other.scope, right.costs, right.default)
        case AsymmetricTable() as left, AsymmetricTable() as right:
            return (one.scope, left.first.costs, left.second.costs) == (
                other.scope,
                right.first.costs,
                right.second.costs,
            )
        case Formula() as left, Formula() as right:
            named = replace(left.definition, name=""), replace(right.definition, name="")
            return named[0] == named[1] and left.terms == right.terms
        case _:
            return False


def _write(team: Team, options: ExportOptions) -> ExportResult:
    """Return a file in which every agent with a variable in a constraint's scope knows the constraint.

    Raises:
        UnsupportedError: if FRODO lacks a feature of the team.
    """
    random = random_variables(team) if can_state_random_variables(team) else ()
    writer = _FrodoWriter(FlatTeam(_declared(team, random), TITLE), random, intension=options.intension)
    return ExportResult({f"{team.name}.xml": writer.content()}, tuple(writer.notes()))


def _declared(team: Team, random: Sequence[RandomVariable]) -> Team:
    """Return the team with its `random` variables, which an additional robot owns."""
    if not random:
        return team
    domains = (Domain(one.name, tuple(range(value, value + 1) for value in sorted(one.outcomes))) for one in random)
    variables = tuple(Variable(one.name, domain) for one, domain in zip(random, domains, strict=True))
    chance = Robot(_CHANCE, variables, kind=team.kind)
    return replace(team, robots=(*declared_robots(team.robots), chance))


class _FrodoWriter:
    def __init__(self, flat: FlatTeam, random: Sequence[RandomVariable], *, intension: bool) -> None:
        self._flat = flat
        self._random = random
        hint = "" if intension else f" ({KEEPS_FORMULAS})"
        self._contents = [(intension and self._in_intension(one)) or flat.table(one, hint) for one in flat.owned]
        tables = [content for content in self._contents if isinstance(content, TabulatedConstraint)]
        if flat.constant:
            tables.append(constant_table(flat.team, flat.constant))
        self._places = Scale(amounts(tables)).places
        self._check_sizes(finite_cost_bound(tables, Fraction(0)) * 10**self._places)
        self._forbidden = "-infinity" if flat.maximize else "infinity"
        presentation = {
            "name": flat.team.name,
            "maxConstraintArity": str(max((len(one.constraint.variables) for one in flat.owned), default=1)),
            "maximize": "true" if flat.maximize else "false",
            "format": FORMAT,
        }
        self._document = Document(flat, presentation)
        self._references: dict[int, str] = {}

    def content(self) -> bytes:
        flat, document = self._flat, self._document
        if self._places:
            etree.SubElement(document.presentation, "stats", name=UNIT).text = self._unit
        for robot in flat.team.robots:
            owner = {"type": "random"} if robot.name == _CHANCE else {"agent": robot.name}
            if robot.name != _CHANCE:
                etree.SubElement(document.agents, "agent", name=robot.name)
            for variable in robot.variables:
                domain = flat.domain_of[variable.name]
                etree.SubElement(document.variables, "variable", {"name": variable.name, "domain": domain, **owner})
        for one, content in zip(flat.owned, self._contents, strict=True):
            if isinstance(content, TabulatedConstraint):
                self._add(content)
            else:
                self._add_formula(one, content)
        if flat.constant:
            self._add(constant_table(flat.team, flat.constant))
        if self._random:
            self._add_probabilities()
        return document.content()

    def _add_probabilities(self) -> None:
        section = etree.Element("probabilities")
        self._document.constraints.addprevious(section)
        for one in self._random:
            law = f"P.{one.name}"
            sizes = {"arity": "1", "nbTuples": str(len(one.outcomes)), "semantics": "soft"}
            element = etree.SubElement(section, "probability", {"name": law, **sizes})
            element.text = " | ".join(f"{decimal(chance)}: {value}" for value, chance in one.probabilities.items())
            self._document.constraint(f"Law.{one.name}", (one.name,), law)

    def notes(self) -> Iterator[ConversionNote]:
        """Yield the differences between the file and the team."""
        if self._places:
            yield ConversionNote(
                "scale", f"costs are integers, in units of {self._unit}: FRODO's costs are integers of 32 bits"
            )
        if any(one.private_part for one in self._flat.owned):
            text = "all agents of a constraint know it: FRODO does not support partially known constraints (PKC)"
            yield ConversionNote("known to more", text)
        if in_intension := sum(not isinstance(content, TabulatedConstraint) for content in self._contents):
            text = f"{counted(in_intension, 'constraint')} in intension, which only FRODO's JaCoP parser reads"
            yield ConversionNote("intension", text)

    @property
    def _unit(self) -> str:
        return decimal(Fraction(1, 10**self._places))

    def _check_sizes(self, most: int) -> None:
        if most >= LIMIT:
            unit = f" in units of {self._unit}" if self._places else ""
            what = f"costs may add up to {most:,}{unit}"
            raise UnsupportedError(f"{TITLE}: {what}, but FRODO's integers are below {LIMIT:,}: use smaller costs")
        for name, variable in self._flat.team.variables.items():
            far = max(variable.domain, key=abs)
            if abs(far) >= LIMIT:
                what = f"the value {far:,} of {name} is too large: FRODO's integers are below {LIMIT:,}"
                raise UnsupportedError(f"{TITLE}: {what}")

    def _in_intension(self, one: OwnedConstraint) -> Predicate | Function | None:
        """Return the definition of a constraint in FRODO's operators, or None if it must be written as a relation."""
        definition, cost = one.constraint.definition, one.constraint.cost
        if isinstance(definition, Relation):
            return None
        if isinstance(definition, GlobalPredicate) and cost == INFINITE and _is_known_form(definition):
            return definition
        body = in_xcsp21_operators(definition.body)
        if body is None:
            return None
        if isinstance(definition, Predicate) and cost == INFINITE:
            return Predicate(definition.name, definition.parameters, body)
        return self._as_function(one, definition, body)

    def _as_function(self, one: OwnedConstraint, definition: Predicate | Function, body: Expression) -> Function | None:
        """Return a definition with finite costs as a function, or None if it must be written as a relation."""
        if any(robot.costs.places for robot in self._flat.team.robots):  # functions have no unit of costs
            return None
        if isinstance(definition, Predicate):
            if self._flat.small_table(one) is not None:
                return None
            body = Apply("if", (body, Constant(0), Constant(int(one.constraint.cost))))
        return Function(definition.name, definition.parameters, body)

    def _add_formula(self, one: OwnedConstraint, definition: Predicate | Function) -> None:
        constraint = one.constraint
        if isinstance(definition, GlobalPredicate):
            element = self._document.constraint(constraint.name, constraint.variables, definition.name)
            write_global(etree.SubElement(element, "parameters"), definition, constraint.parameters)
            return
        reference = self._document.formula(definition, definition.body)
        element = self._document.constraint(constraint.name, constraint.variables, reference)
        etree.SubElement(element, "parameters").text = " ".join(map(str, constraint.parameters))

    def _add(self, table: TabulatedConstraint) -> None:
        """Write a soft relation, the only kind that all parts of FRODO read."""
        key = id(table.table)
        if key not in self._references:
            self._references[key] = self._relation(table)
        self._document.constraint(table.name, table.scope, self._references[key])

    def _relation(self, table: TabulatedConstraint) -> str:
        by_cost: dict[Amount, list[str]] = {}
        for values, cost in table.table.rows.items():
            by_cost.setdefault(cost, []).append(" ".join(map(str, values)))
        tuples = " | ".join(f"{self._number(cost)}: {' | '.join(listed)}" for cost, listed in by_cost.items())
        attributes = {"semantics": "soft", "defaultCost": self._number(table.table.default)}
        return self._document.relation(table, attributes, tuples)

    def _number(self, cost: Amount) -> str:
        result = cost if cost == INFINITE else cost * 10**self._places
        return cost_text(result, forbidden=self._forbidden)


def _is_known_form(predicate: GlobalPredicate) -> bool:
    """Return whether FRODO reads the parameters of a global constraint."""
    return _FORMS[predicate.name.removeprefix(PREFIX)].fullmatch(predicate.form) is not None


DIALECT = Dialect(NAME, TITLE, _recognises, _read, _write, is_part=_is_part, writes_random=True)
