"""Read pyDCOP's YAML as a team (see "File formats" in pyDCOP's documentation)."""

from __future__ import annotations

import re
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import replace
from fractions import Fraction
from pathlib import Path

from robochoc.formats.definitions import PREDEFINED
from robochoc.formats.diagnostics import MistakeError, shortened, suggestion
from robochoc.formats.dialects.dialect import ConversionNote, ImportOptions, ImportResult, NameMap, notes_on_names
from robochoc.formats.dialects.exact_costs import ExactCostTable, Scale, definition_name, relation, xml_name
from robochoc.formats.dialects.pydcop.constraints import ConstraintReader, ParsedConstraint
from robochoc.formats.dialects.pydcop.domains import Domains, DomainValues
from robochoc.formats.dialects.pydcop.files import ProblemFiles, SourceText, read_files
from robochoc.formats.dialects.pydcop.owners import VariableOwners, agent_names, name_text
from robochoc.formats.dialects.pydcop.scenario import read_scenario
from robochoc.formats.dialects.pydcop.translation import ViolationCost
from robochoc.formats.yaml_tree import Node, Scalar, scalar_text
from robochoc.model.assembly import assemble
from robochoc.model.constraint import (
    Constraint,
    ConstraintModel,
    Function,
    Predicate,
    Variable,
)
from robochoc.model.cost_units import CostUnits
from robochoc.model.expression import Apply, Expression, Name
from robochoc.model.problem import ProblemKind, ScenarioEvent, Team

_REMARKS = ("description", "inputs")
"""Sections with remarks for users, or about the program that wrote the file."""
_WISHES = ("host_with", "may_host")
"""Distribution hints that do not affect owners."""
_DISTRIBUTE_REMARKS = ("inputs", "status", "cost", "duration", "communication_cost", "hosting_cost")
_OBJECTIVE = "write objective: min, or objective: max"
_DROPPED = {
    "routes": "routes between agents",
    "hosting_costs": "costs of hosting",
    "events": "the events in the file of the problem: write them to a file of their own",
    "replica_dist": "replicas",
}


def read(paths: Sequence[Path], options: ImportOptions) -> ImportResult:
    """Return the problem in the pyDCOP files `paths`.

    Raises:
        InvalidInputError: with the first error.
    """
    parts, notes = read_files(paths), []

    def repeated(line: int, key: str) -> None:
        path, number = parts.problem.place(line)
        notes.append(
            ConversionNote("repeated", f"{path}:{number}: duplicate key {shortened(key)}; the later value counts")
        )

    return parts.problem.read(lambda root: _PydcopReader(parts, options, root, notes).imported(), repeated)


class _PydcopReader:
    def __init__(self, parts: ProblemFiles, options: ImportOptions, root: Node, notes: list[ConversionNote]) -> None:
        self._parts = parts
        self._options = options
        self._root = _mapping(root, "the problem")
        self._notes = notes
        self._variable_names, self._robot_names = NameMap(), NameMap()

    def imported(self) -> ImportResult:
        """Return the problem. Raises `MistakeError`."""
        self._note_dropped_sections()
        maximize = self._maximize()
        nodes = dict(_section(self._root, "variables"))
        if not nodes:
            raise MistakeError("has no variables", "write variables: and, below, NAME: {domain: NAME}")
        domains = Domains(dict(_section(self._root, "domains")))
        self._notes += notes_on_names(list(domains.renamed))
        values = {name: _values(name, node, domains) for name, node in nodes.items()}
        self._constraints = dict(_section(self._root, "constraints"))
        reader = ConstraintReader(values, self._external(domains), self._infinity(), maximize, self._folder())
        costs = list(self._costs(reader, nodes))
        if reader.incomplete:
            text = f"unlisted tuples of tables without default are forbidden: {_first_names(reader.incomplete)}"
            self._notes.append(ConversionNote("default", text))
        robots = self._robots(list(values))
        team = self._team(values, costs, robots, maximize=maximize)
        team = replace(team, scenario=self._scenario(team))
        changed = {**self._variable_names.originals, **self._robot_names.originals}
        self._notes += notes_on_names(list(changed.items()))
        return ImportResult(team, "pydcop", changed, tuple(self._notes))

    def _note_dropped_sections(self) -> None:
        for key in _REMARKS:
            if remark := self._root.get(key):
                remark.skip()
        for key, what in _DROPPED.items():
            if dropped := self._root.get(key):
                dropped.skip()
                self._notes.append(ConversionNote("dropped", what))

    def _maximize(self) -> bool:
        node = self._root.get("objective")
        known = node.scalar if node is not None else None
        if node is None or known is None:
            raise MistakeError("has no objective", _OBJECTIVE, node.line if node else 0)
        if known not in ("min", "max"):
            text = str(known)
            meant = next((short for short in ("min", "max") if text.strip().lower().startswith(short)), None)
            hint = f"write objective: {meant}" if meant else _OBJECTIVE
            raise MistakeError(f"has the unknown objective '{shortened(text)}'", hint, node.line)
        return known == "max"

    def _infinity(self) -> int | None:
        """Return the infinity specified by the options, or by the file if robochoc exported it."""
        node = self._root.get("infinity")
        if self._options.infinity is not None or node is None:
            if node is not None:
                node.skip()
            return self._options.infinity
        if isinstance(node.scalar, bool) or not isinstance(node.scalar, int) or node.scalar < 1:
            raise MistakeError(
                "has an infinity that is not an integer of 1 or more", "write infinity: 10000", node.line
            )
        self._notes.append(ConversionNote("infinity", f"costs from {node.scalar} on are infinite, as in the file"))
        return node.scalar

    def _folder(self) -> Path | None:
        return self._parts.problem.files[0][0].parent if self._options.allow_code else None

    def _external(self, domains: Domains) -> dict[str, Scalar]:
        fixed: dict[str, Scalar] = {}
        for name, node in _section(self._root, "external_variables"):
            values, initial = _values(name, node, domains), node.get("initial_value")
            if initial is None or initial.scalar not in values.scalars.values():
                what = f"the external variable '{shortened(name)}' has no initial_value, or one outside its domain"
                raise MistakeError(what, "write initial_value: and a value of its domain", node.line)
            fixed[name] = initial.scalar
        if fixed:
            self._notes.append(
                ConversionNote("external", f"external variables keep their initial values: {_first_names(fixed)}")
            )
        return fixed

    def _costs(self, reader: ConstraintReader, variables: Mapping[str, Node]) -> Iterator[ParsedConstraint]:
        parts: dict[str, list[str]] = {"noise_level": [], "initial_value": [], "partial": []}
        for name, node in variables.items():
            for part in ("noise_level", "initial_value", "partial"):
                _leave_out(node, part, name, parts)
            if function := node.get("cost_function"):
                with _error_context(f"the cost_function of {shortened(name)}", function.line):
                    yield reader.function(f"cost_{name}", function, (name,))
        for name, node in self._constraints.items():
            _leave_out(node, "partial", name, parts)
            with _error_context(f"the constraint {shortened(name)}", node.line):
                yield reader.read(name, node)
        for part, found in parts.items():
            if found:
                self._notes.append(ConversionNote("dropped", f"{part} of {_first_names(found)}"))

    def _robots(self, variables: Sequence[str]) -> dict[str, list[str]]:
        hosting = VariableOwners(agent_names(self._root.get("agents")), variables, self._constraints)
        hints, own = self._root.get("distribution_hints"), self._root.get("distribution")
        must = hints.get("must_host") if hints else None
        for wish in filter(None, (hints.get(key) if hints else None for key in _WISHES)):
            wish.skip()
        if self._options.owner is not None:
            hosting.assign_by_pattern(self._options.owner)
            for other in filter(None, (own, must)):
                other.skip()
        elif self._parts.distribution is not None:
            self._parts.distribution.read(lambda root: _read_distribution(root, hosting), _ignore_duplicate_key)
            if own:
                own.skip()
        elif own is not None:
            hosting.assign_by_agent(own, "distribution")
        if self._options.owner is None and must is not None:
            hosting.assign_by_agent(must, "must_host")
        hosting.assign_remaining()
        robots = hosting.robots()
        self._notes += hosting.notes
        return robots

    def _team(
        self,
        values: Mapping[str, DomainValues],
        costs: Sequence[ParsedConstraint],
        robots: Mapping[str, Sequence[str]],
        *,
        maximize: bool,
    ) -> Team:
        scale = Scale(_amounts(costs))
        if scale.rounds:
            text = f"some costs were rounded to {scale.places} decimal places"
            self._notes.append(ConversionNote("rounded", text))
        places = self._variable_names
        variables = {
            self._robot_names.allowed(agent): [Variable(places.allowed(name), values[name].domain) for name in names]
            for agent, names in robots.items()
        }
        builder = _ConstraintBuilder(places, scale)
        constraints = [made for one in costs if (made := builder.constraint(one)) is not None]
        name = self._options.name or self._name()
        if not builder.constant and not any(one.has_costs for one in constraints):
            return assemble(name, variables, constraints)
        units = CostUnits(maximize, scale.places, builder.constant)
        return assemble(name, variables, constraints, kind=ProblemKind.DISWCSP, costs=units)

    def _name(self) -> str:
        node = self._root.get("name")
        found = str(node.scalar) if node and node.scalar is not None else self._parts.problem.files[0][0].stem
        return re.sub(r"[^A-Za-z0-9_.-]+", "_", found)[:100].strip("._-") or "team"

    def _scenario(self, team: Team) -> tuple[ScenarioEvent, ...]:
        part: SourceText | None = self._parts.scenario
        if part is None:
            return ()
        agents = agent_names(self._root.get("agents"))
        return part.read(
            lambda root: read_scenario(root, team, self._robot_names, agents, self._notes),
            lambda _, key: self._notes.append(
                ConversionNote("repeated", f"duplicate key {shortened(key)}; the later value counts")
            ),
        )


class _ConstraintBuilder:
    """Builds the team's constraints. Equal predicates and functions share one object."""

    def __init__(self, names: NameMap, scale: Scale) -> None:
        self._names = names
        self._scale = scale
        self._definitions: dict[tuple[str, Expression], Predicate | Function] = {}
        self.constant = 0

    def constraint(self, parsed: ParsedConstraint) -> Constraint | None:
        """Return a constraint, or None if it is a constant cost, now part of `constant`. Raises `MistakeError`."""
        scope = tuple(map(self._names.allowed, parsed.scope))
        name = xml_name(parsed.name)
        with _error_context(f"the constraint {shortened(parsed.name)}", parsed.line):
            match parsed.costs:
                case ExactCostTable() as table:
                    made = relation(table, len(scope), self._scale)
                    if isinstance(made, int):
                        self.constant += made
                        return None
                    if not scope:
                        raise MistakeError("forbids all assignments", "delete it, or write a finite cost")
                    scope = scope[: made.arity]
                    return Constraint(name, made, scope, scope, ConstraintModel.TKC, line=parsed.line)
                case ViolationCost(body, cost):
                    predicate = self._predicate(name, scope, body)
                    units = self._scale.units(cost)
                    return Constraint(name, predicate, scope, scope, ConstraintModel.TKC, units, parsed.line)
                case body:
                    function = self._definition(Function, name, scope, body)
                    return Constraint(name, function, scope, scope, ConstraintModel.TKC, line=parsed.line)

    def _predicate(self, name: str, scope: Sequence[str], body: Expression) -> Predicate | Function:
        for known in PREDEFINED.values():
            if _over_formals(known.body) == body and len(scope) == len(known.parameters):
                return known
        return self._definition(Predicate, name, scope, body)

    def _definition(
        self, kind: type[Predicate | Function], name: str, scope: Sequence[str], body: Expression
    ) -> Predicate | Function:
        key = (f"{kind.__name__} {len(scope)}", body)
        if key not in self._definitions:
            self._definitions[key] = kind(
                definition_name(name), tuple(f"X{place}" for place in range(len(scope))), body
            )
        return self._definitions[key]


def _over_formals(body: Expression) -> Expression:
    """Return the body of a predefined predicate, with X and Y renamed to X0 and X1."""
    match body:
        case Apply(operator, (Name("X"), Name("Y"))):
            return Apply(operator, (Name("X0"), Name("X1")))
        case _:
            return body


def _amounts(costs: Iterable[ParsedConstraint]) -> Iterator[int | Fraction | float]:
    for one in costs:
        match one.costs:
            case ExactCostTable() as table:
                yield from table.amounts()
            case ViolationCost(_, cost):
                yield cost
            case _:
                pass


def _values(name: str, node: Node, domains: Domains) -> DomainValues:
    domain = _mapping(node, f"the variable '{shortened(name)}'").get("domain")
    domain_name = scalar_text(domain.scalar) if domain is not None else ""
    if domain_name not in domains.all:
        what = f"the variable '{shortened(name)}' has no domain, or an unknown one"
        raise MistakeError(what, suggestion(domain_name, list(domains.all), "domains"), node.line)
    return domains.all[domain_name]


def _section(root: Node, name: str) -> Iterator[tuple[str, Node]]:
    node = root.get(name)
    if node is None or node.is_empty:
        return
    for key, one in _mapping(node, name).named():
        yield name_text(key, one.line), one


def _mapping(node: Node, what: str) -> Node:
    if not node.is_mapping:
        raise MistakeError(f"{what} is not a mapping", "write NAME: VALUE, one a line", node.line)
    return node


def _leave_out(node: Node, part: str, name: str, found: Mapping[str, list[str]]) -> None:
    if given := node.get(part):
        given.skip()
        found[part].append(name)


def _read_distribution(root: Node, hosting: VariableOwners) -> None:
    """Read a distribution; ignore the remarks added by pyDCOP's `distribute`."""
    for key in _DISTRIBUTE_REMARKS:
        if remark := root.get(key):
            remark.skip()
    hosting.assign_by_agent(root.needed("distribution", "the file"), "distribution")


def _ignore_duplicate_key(_line: int, _key: str) -> None:
    """Use the later one of two equal keys, like pyDCOP."""


@contextmanager
def _error_context(what: str, line: int) -> Iterator[None]:
    """Add `what`, and `line` if it has none, to a `MistakeError` raised inside."""
    try:
        yield
    except MistakeError as mistake:
        raise MistakeError(f"{what}: {mistake.message}", mistake.hint, mistake.line or line) from None


def _first_names(names: Collection[str]) -> str:
    first = list(names)[:5]
    return f"{' '.join(map(shortened, first))}{f' and {len(names) - 5} more' if len(names) > 5 else ''}"  # noqa: PLR2004
