"""From an XML file of XCSP 2.1 with agents to an `Instance`. Counts that it states are not looked at."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

from lxml import etree

from robochoc.formats.definitions import PREDEFINED
from robochoc.formats.diagnostics import MistakeError, shortened, suggestion
from robochoc.formats.dialects.dialect import ImportOptions, Note
from robochoc.formats.dialects.xcsp21.definitions import read_formula, read_relation
from robochoc.formats.dialects.xcsp21.global_constraints import expand
from robochoc.formats.dialects.xcsp21.instance import (
    UNIT,
    ForeignConstraint,
    ForeignVariable,
    Formula,
    Instance,
    Sides,
    Table,
    refuse,
)
from robochoc.formats.dialects.xcsp21.numbers import CostReader, finite_cost, integer, is_integer, ranges, unit_places
from robochoc.formats.xml import attribute, line, read_tree
from robochoc.model.constraint import Function, Predicate

MAX_XML = 32 * 1024 * 1024
"""The maximum size of an XML file, in bytes."""
MAX_CONSTRAINTS = 200_000
"""The maximum number of constraints, once global ones are written out."""
GLOBAL = "global:"
PUBLIC = "PUBLIC"

_SECTIONS = (
    "presentation", "agents", "domains", "variables", "relations", "predicates", "functions", "constraints",
    "probabilities", "GuiPresentation",
)  # fmt: skip


def read_instance(path: Path, options: ImportOptions, knower: Callable[[etree._Element, Instance], str]) -> Instance:
    """Return the instance in the file at `path`.

    Args:
        path: The file.
        options: What the import is asked.
        knower: Returns the agent that alone knows a constraint, or an empty text.

    Raises:
        InvalidInputError: with the first mistake.
    """
    return _Reader(path, options, knower).instance()


class _Reader:
    """A file on its way."""

    def __init__(self, path: Path, options: ImportOptions, knower: Callable[[etree._Element, Instance], str]) -> None:
        self._path = path
        self._options = options
        self._knower = knower
        self._root = read_tree(path, MAX_XML)
        self._read = Instance(path)
        self._domains: dict[str, tuple[range, ...]] = {}
        self._relations: dict[str, Table | Sides] = {}
        self._formulas: dict[str, Predicate | Function] = {}
        self._unit_places = 0

    def instance(self) -> Instance:
        if self._root.tag != "instance":
            refuse(self._path, line(self._root), f"the root element is <{self._root.tag}>", "expected <instance>")
        for section in self._root:
            if section.tag not in _SECTIONS:
                known = ", ".join(_SECTIONS[:-2])
                refuse(self._path, line(section), f"an element <{shortened(str(section.tag))}>", f"known are {known}")
        for element in self._every("probabilities", "probability"):
            self._not_stochastic(element)
        self._present()
        for element in self._every("agents", "agent"):
            self._agent(element)
        for element in self._every("domains", "domain"):
            with self._at(element):
                self._domains[attribute(element, "name")] = ranges(element.text or "")
        for element in self._every("variables", "variable"):
            self._variable(element)
        self._define()
        for element in self._every("constraints", "constraint"):
            with self._at(element):
                self._constrain(element)
        return self._read

    def _present(self) -> None:
        presentation = self._root.find("presentation")
        if presentation is not None:
            self._read.name = attribute(presentation, "name")
            self._read.type = attribute(presentation, "type")
            self._read.constraint_model = attribute(presentation, "constraintModel")
            self._read.maximize = attribute(presentation, "maximize").lower() in {"true", "1"}
            for element in presentation.iterfind("stats"):
                if attribute(element, "name") == UNIT:
                    with self._at(element):
                        self._unit_places = unit_places((element.text or "").strip())
        agents = self._root.find("agents")
        if agents is not None:
            self._read.self_agent = attribute(agents, "self")
        constraints = self._root.find("constraints")
        if constraints is not None:
            with self._at(constraints):
                self._bounds(constraints)

    def _bounds(self, constraints: etree._Element) -> None:
        """Note the constant cost, and the bound of a weighted CSP (XCSP 2.1, "Representing WCSP")."""
        initial, most = attribute(constraints, "initialCost"), attribute(constraints, "maximalCost")
        if initial:
            self._read.constant = finite_cost(initial)
            if self._read.constant:
                self._read.notes.append(Note("constant", f"initialCost {initial} is added to every cost"))
        if most and most != "infinity":
            bound = finite_cost(most)
            self._read.costs_from = bound
            told = (
                f"costs of {most} or more forbid (maximalCost); an optimum of as much means that there is no solution"
            )
            self._read.notes.append(Note("bound", told))

    def _agent(self, element: etree._Element) -> None:
        name = attribute(element, "name")
        if name in self._read.agents:
            refuse(self._path, line(element), f"a second agent '{shortened(name)}'", "names are unique")
        self._read.agents.append(name)
        if given := attribute(element, "id"):
            self._read.ids[given] = name

    def _variable(self, element: etree._Element) -> None:
        name, domain = attribute(element, "name"), attribute(element, "domain")
        if attribute(element, "type") == "random":
            self._not_stochastic(element)
        if name in self._read.variables or not name:
            refuse(self._path, line(element), f"a second variable '{shortened(name)}'", "names are unique")
        if domain not in self._domains:
            hint = suggestion(domain, self._domains, "domains")
            refuse(self._path, line(element), f"there is no domain '{shortened(domain)}'", hint)
        owner = attribute(element, "agent") or attribute(element, "owner")
        self._read.variables[name] = ForeignVariable(name, domain, self._domains[domain], owner, line(element))

    def _not_stochastic(self, element: etree._Element) -> None:
        what = f"the {'random variable' if element.tag == 'variable' else 'probability'} "
        what += f"'{shortened(attribute(element, 'name'))}'"
        refuse(self._path, line(element), f"{what}: stochastic problems are not read", "give the variable one value")

    def _define(self) -> None:
        costs = CostReader(
            maximize=self._read.maximize,
            infinity=self._options.infinity,
            bound=self._read.costs_from,
            places=self._unit_places,
        )
        for element in self._every("relations", "relation"):
            with self._at(element):
                self._relations[self._new(element)] = read_relation(element, costs)
        for kind in ("predicate", "function"):
            for element in self._every(f"{kind}s", kind):
                with self._at(element):
                    self._formulas[self._new(element)] = read_formula(element)
                    if self._unit_places and kind == "function":
                        raise MistakeError(f"a function in a file with a {UNIT}", "write its costs as a relation")

    def _new(self, element: etree._Element) -> str:
        name = attribute(element, "name")
        if name in self._relations or name in self._formulas:
            raise MistakeError(f"a second definition '{shortened(name)}'", "names are unique")
        return name

    def _constrain(self, element: etree._Element) -> None:
        name, scope = attribute(element, "name"), tuple(attribute(element, "scope").split())
        for variable in scope:
            if variable not in self._read.variables:
                hint = suggestion(variable, self._read.variables, "variables")
                raise MistakeError(f"there is no variable '{shortened(variable)}'", hint)
        for content in self._contents(element, scope):
            if isinstance(content, Formula):
                scope_now = tuple(dict.fromkeys(term for term in content.terms if isinstance(term, str)))
            else:
                scope_now = scope
            if not scope_now:
                raise MistakeError(f"constraint {shortened(name)} is about no variable", "delete it")
            if len(self._read.constraints) == MAX_CONSTRAINTS:
                raise MistakeError(f"more than {MAX_CONSTRAINTS} constraints", "import a smaller problem")
            knower = self._knower(element, self._read)
            self._read.constraints.append(
                ForeignConstraint(name, scope_now, content, knower, str(self._path), line(element))
            )

    def _contents(self, element: etree._Element, scope: tuple[str, ...]) -> list[Table | Sides | Formula]:
        reference = attribute(element, "reference")
        if reference.lower().startswith(GLOBAL):
            kind = reference[len(GLOBAL) :]
            formulas = expand(kind, element, scope)
            for formula in formulas:
                self._check_terms(formula.terms)
            self._read.notes.append(Note("global", f"{kind} {attribute(element, 'name')}: {len(formulas)} predicates"))
            return [*formulas]
        if reference in self._relations:
            relation = self._relations[reference]
            arity = relation.arity if isinstance(relation, Table) else relation.first.arity
            if arity not in {0, len(scope)}:
                there = f"{len(scope)} variables in the scope, but tuples of {arity} values in '{shortened(reference)}'"
                raise MistakeError(there, "one for each variable")
            return [relation]
        definition = self._formulas.get(reference) or PREDEFINED.get(reference)
        if definition is None:
            hint = suggestion(reference, [*self._relations, *self._formulas], "relations, predicates and functions")
            raise MistakeError(f"there is no '{shortened(reference)}'", hint)
        words = (element.findtext("parameters") or " ".join(scope)).split()
        terms = tuple(integer(word) if is_integer(word) else word for word in words)
        self._check_terms(terms)
        if len(terms) != len(definition.parameters):
            there = f"{len(terms)} parameters for '{shortened(reference)}', which has {len(definition.parameters)}"
            raise MistakeError(there, "one for each")
        return [Formula(definition, terms)]

    def _check_terms(self, terms: tuple[str | int, ...]) -> None:
        for term in terms:
            if isinstance(term, str) and term not in self._read.variables:
                hint = suggestion(term, self._read.variables, "variables")
                raise MistakeError(f"'{shortened(term)}' is no variable", hint)

    def _every(self, section: str, tag: str) -> Iterator[etree._Element]:
        for found in self._root.iterfind(section):
            yield from found.iterfind(tag)

    @contextmanager
    def _at(self, element: etree._Element) -> Iterator[None]:
        try:
            yield
        except MistakeError as mistake:
            refuse(self._path, mistake.line or line(element), mistake.message, mistake.hint)
