"""Read an XML file of XCSP 2.1 with agents. The counts stated in the file are ignored.

The file is read through views of its elements: an unread part is an error.
"""

from __future__ import annotations

import itertools
import re
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from decimal import Decimal
from pathlib import Path

from robochoc.formats.definitions import PREDEFINED
from robochoc.formats.diagnostics import MistakeError, shortened, suggestion
from robochoc.formats.dialects.dialect import ConversionNote, ImportOptions
from robochoc.formats.dialects.xcsp21.global_constraints import expand_global
from robochoc.formats.dialects.xcsp21.instance import (
    UNIT,
    AsymmetricTable,
    ForeignConstraint,
    ForeignTable,
    ForeignVariable,
    Formula,
    Instance,
    Price,
    refuse,
)
from robochoc.formats.dialects.xcsp21.numbers import (
    CostReader,
    finite_cost,
    integer,
    is_integer,
    ranges,
    split_tuples,
    unit_places,
)
from robochoc.formats.dialects.xcsp21.probabilities import ProbabilityTable
from robochoc.formats.element_view import ElementView, open_xml
from robochoc.model.constraint import INFINITE, Function, Predicate
from robochoc.model.expression import Expression, ExpressionError, Type, parse

_COMMENT = re.compile(rb"<!--.*?-->|<\?.*?\?>|\xef\xbb\xbf", re.DOTALL)
_ROOT = re.compile(rb"\s*<([A-Za-z_][^\s/>]*)([^>]*)>")
_PRESENTATION = re.compile(rb"<presentation\b([^>]*)>")
_ATTRIBUTE = re.compile(rb"\b([A-Za-z]+)\s*=\s*(?:\"([^\"]*)\"|'([^']*)')")
_ZERO = Decimal(0)
_OTHER_FORMS = ("infix", "prefix", "postfix", "math")
_SEMANTICS = ("supports", "conflicts", "soft")
_TRUTH = re.compile(r"\b(true|false)\b")
_TRUTH_VALUES = {"true": "eq(0,0)", "false": "ne(0,0)"}

MAX_XML = 32 * 1024 * 1024
"""The maximum size of an XML file, in bytes."""
MAX_CONSTRAINTS = 200_000
"""The maximum number of constraints, after the expansion of global constraints."""
GLOBAL = "global:"
PUBLIC = "PUBLIC"

PrivateAgentReader = Callable[[ElementView, Instance], str]
"""Returns the only agent that knows a constraint, or an empty text."""

_DESCRIPTIONS = (
    "maxConstraintArity", "minViolatedConstraints", "nbSolutions", "solution", "format", "benchmark", "model",
    "description",
)  # fmt: skip
"""Attributes of the presentation that do not concern the problem."""


class FileHead:
    """The properties of a file by its first bytes, without parsing it.

    Attributes:
        is_instance: True if its root element is `instance`, and not XCSP3's.
        format: The format stated in its presentation, or an empty text.
        type: The type stated in its presentation, or an empty text.
        has_agents: True if it has a section of agents, which robots' files do not have.
        is_network: True if it has domains and variables, and no part that only robots' files have.
    """

    def __init__(self, beginning: bytes) -> None:
        text = _COMMENT.sub(b"", beginning)
        root = _ROOT.match(text)
        self.is_instance = bool(root and root[1] == b"instance" and b"XCSP3" not in root[2])
        presentation = _PRESENTATION.search(text)
        found = _ATTRIBUTE.findall(presentation[1] if presentation else b"")
        stated = {name: one or other for name, one, other in found}
        self.format = stated.get(b"format", b"").decode("utf-8", "replace").strip()
        self.type = stated.get(b"type", b"").decode("utf-8", "replace").strip()
        is_own = b"<agents_neighbours" in text or self.type in {"DisCSP", "DisWCSP"}
        self.is_network = not is_own and all(part in text for part in (b"<domains", b"<variables", b"<variable "))
        self.has_agents = re.search(rb"<agents[\s/>]", text) is not None and b"<agents_neighbours" not in text


def read_instance(path: Path, options: ImportOptions, private_agent: PrivateAgentReader) -> Instance:
    """Return the instance in the file at `path`.

    Args:
        path: The file.
        options: The options of the import.
        private_agent: Returns the only agent that knows a constraint, or an empty text.

    Raises:
        InvalidInputError: with the first mistake.
    """
    with open_xml(path, MAX_XML) as root:
        reader = _Xcsp21Reader(path, root, options, private_agent)
        reader.read()
    return reader.instance


class _Xcsp21Reader:
    def __init__(
        self, path: Path, root: ElementView, options: ImportOptions, private_agent: PrivateAgentReader
    ) -> None:
        self._path = path
        self._options = options
        self._private_agent = private_agent
        self._root = root
        self.instance = Instance(path)
        self._domains: dict[str, tuple[range, ...]] = {}
        self._relations: dict[str, ForeignTable | AsymmetricTable] = {}
        self._formulas: dict[str, Predicate | Function] = {}
        self._unit_places = 0
        self._probabilities: dict[str, ProbabilityTable] = {}

    def read(self) -> None:
        """Fill `instance`. Raises `MistakeError`."""
        if self._root.tag != "instance":
            raise self._root.mistake(f"the root element is <{self._root.tag}>", "expected <instance>")
        self._root.ignore("GuiPresentation")
        self._read_presentation()
        for element in self._elements("agents", "agent"):
            self._read_agent(element)
        for element in self._elements("domains", "domain"):
            with _with_line(element):
                element.ignore_attributes("nbValues")
                self._domains[element.attribute("name")] = ranges(element.text())
        for element in self._elements("variables", "variable"):
            self._read_variable(element)
        self._read_definitions()
        for element in self._elements("probabilities", "probability"):
            with _with_line(element):
                self._probabilities[self._new_name(element)] = ProbabilityTable(element)
        for element in self._elements("constraints", "constraint"):
            with _with_line(element):
                self._read_constraint(element)
        for name, variable in self.instance.random.items():
            if name not in self.instance.laws:
                hint = "add a constraint on it that refers to a probability"
                refuse(self._path, variable.line, f"the random variable '{shortened(name)}' has no probabilities", hint)

    def _read_presentation(self) -> None:
        for presentation in self._root.children("presentation"):
            self.instance.name = presentation.attribute("name")
            self.instance.type = presentation.attribute("type")
            self.instance.constraint_model = presentation.attribute("constraintModel")
            self.instance.maximize = presentation.attribute("maximize").lower() in {"true", "1"}
            presentation.ignore_attributes(*_DESCRIPTIONS)
            for stats in presentation.children("stats"):
                text = stats.text()
                if stats.attribute("name") == UNIT:
                    with _with_line(stats):
                        self._unit_places = unit_places(text)
            if not presentation.has_children:
                presentation.text()
        for agents in self._root.children("agents"):
            self.instance.self_agent = agents.attribute("self")
        for constraints in self._root.children("constraints"):
            with _with_line(constraints):
                self._read_bounds(constraints)

    def _read_bounds(self, constraints: ElementView) -> None:
        """Read the constant cost, and the bound of a weighted CSP (XCSP 2.1, "Representing WCSP")."""
        initial, most = constraints.attribute("initialCost"), constraints.attribute("maximalCost")
        if initial:
            self.instance.constant = finite_cost(initial)
            if self.instance.constant:
                self.instance.notes.append(ConversionNote("constant", f"initialCost {initial} is added to the cost"))
        if most and most != "infinity":
            bound = finite_cost(most)
            self.instance.maximal_cost = bound
            text = f"costs of {most} or more are infinite (maximalCost): an optimum of {most} or more means no solution"
            self.instance.notes.append(ConversionNote("bound", text))

    def _read_agent(self, element: ElementView) -> None:
        name = element.attribute("name")
        element.ignore_attributes("description")
        if name in self.instance.agents:
            raise element.mistake(f"duplicate agent '{shortened(name)}'", "rename one of them")
        self.instance.agents.append(name)
        if given := element.attribute("id"):
            self.instance.ids[given] = name

    def _read_variable(self, element: ElementView) -> None:
        name, domain = element.attribute("name"), element.attribute("domain")
        element.ignore_attributes("description", "id")
        known = self.instance.random if element.attribute("type") == "random" else self.instance.variables
        if name in {*self.instance.variables, *self.instance.random} or not name:
            raise element.mistake(f"duplicate or empty variable name '{shortened(name)}'", "write a unique name")
        if domain not in self._domains:
            hint = suggestion(domain, self._domains, "domains")
            raise element.mistake(f"there is no domain '{shortened(domain)}'", hint)
        owner = element.attribute("agent") or element.attribute("owner")
        known[name] = ForeignVariable(name, domain, self._domains[domain], owner, element.line)

    def _read_definitions(self) -> None:
        costs = CostReader(
            maximize=self.instance.maximize,
            infinity=self._options.infinity,
            bound=self.instance.maximal_cost,
            places=self._unit_places,
        )
        for element in self._elements("relations", "relation"):
            with _with_line(element):
                self._relations[self._new_name(element)] = read_relation(element, costs)
        for kind in ("predicate", "function"):
            for element in self._elements(f"{kind}s", kind):
                with _with_line(element):
                    self._formulas[self._new_name(element)] = read_formula(element)
                    if self._unit_places and kind == "function":
                        what = f"functions are not supported in a file with a {UNIT}"
                        raise MistakeError(what, "write the costs as a relation")

    def _new_name(self, element: ElementView) -> str:
        name = element.attribute("name")
        if name in self._relations or name in self._formulas or name in self._probabilities:
            raise MistakeError(f"duplicate definition '{shortened(name)}'", "rename one of them")
        return name

    def _read_constraint(self, element: ElementView) -> None:
        name, scope = element.attribute("name"), tuple(element.attribute("scope").split())
        element.ignore_attributes("arity")
        if (law := self._probabilities.get(element.attribute("reference"))) is not None:
            self._read_law(law, name, scope)
            return
        for variable in scope:
            if variable not in self._names:
                hint = suggestion(variable, self._names, "variables")
                raise MistakeError(f"there is no variable '{shortened(variable)}'", hint)
        for content in self._contents(element, scope):
            if isinstance(content, Formula):
                scope_now = tuple(dict.fromkeys(term for term in content.terms if isinstance(term, str)))
            else:
                scope_now = scope
            if not scope_now:
                raise MistakeError(f"the constraint {shortened(name)} has no variables", "delete it")
            if len(self.instance.constraints) == MAX_CONSTRAINTS:
                raise MistakeError(f"there are more than {MAX_CONSTRAINTS} constraints", "import a smaller problem")
            if self.instance.random.keys() >= set(scope_now):
                message = f"the constraint '{shortened(name)}' is over random variables only"
                raise MistakeError(message, "use one constraint with probabilities for each random variable")
            private_agent = self._private_agent(element, self.instance)
            self.instance.constraints.append(
                ForeignConstraint(name, scope_now, content, private_agent, str(self._path), element.line)
            )

    def _read_law(self, table: ProbabilityTable, name: str, scope: tuple[str, ...]) -> None:
        """Read a constraint that gives a random variable its probabilities."""
        if len(scope) != 1 or scope[0] not in self.instance.random:
            message = f"the probabilities of '{shortened(name)}' are not those of one random variable"
            raise MistakeError(message, "write a scope of one random variable: joint probabilities are not supported")
        if scope[0] in self.instance.laws:
            raise MistakeError(f"'{shortened(scope[0])}' has probabilities already", "delete one constraint")
        domain = self.instance.random[scope[0]].ranges
        self.instance.laws[scope[0]] = table.law(itertools.chain.from_iterable(domain), scope[0])

    @property
    def _names(self) -> Mapping[str, ForeignVariable]:
        """The variables, including random variables."""
        return self.instance.variables | self.instance.random

    def _contents(self, element: ElementView, scope: tuple[str, ...]) -> list[ForeignTable | AsymmetricTable | Formula]:
        reference = element.attribute("reference")
        if reference.lower().startswith(GLOBAL):
            kind = reference[len(GLOBAL) :]
            formulas = expand_global(kind, element, scope)
            for formula in formulas:
                self._check_terms(formula.terms)
            self.instance.notes.append(
                ConversionNote("global", f"{kind} {element.attribute('name')}: {len(formulas)} predicates")
            )
            return [*formulas]
        if reference in self._relations:
            relation = self._relations[reference]
            arity = relation.arity if isinstance(relation, ForeignTable) else relation.first.arity
            if arity not in {0, len(scope)}:
                what = (
                    f"the scope has {len(scope)} variables, but tuples of '{shortened(reference)}' have {arity} values"
                )
                raise MistakeError(what, "write one value for each variable")
            return [relation]
        definition = self._formulas.get(reference) or PREDEFINED.get(reference)
        if definition is None:
            hint = suggestion(reference, [*self._relations, *self._formulas], "relations, predicates and functions")
            raise MistakeError(f"there is no '{shortened(reference)}'", hint)
        parameters = element.child("parameters")
        words = (parameters.text() if parameters else "").split() or scope
        terms = tuple(integer(word) if is_integer(word) else word for word in words)
        self._check_terms(terms)
        if len(terms) != len(definition.parameters):
            what = f"'{shortened(reference)}' has {len(definition.parameters)} parameters, but {len(terms)} are given"
            raise MistakeError(what, "write one for each")
        return [Formula(definition, terms)]

    def _check_terms(self, terms: tuple[str | int, ...]) -> None:
        for term in terms:
            if isinstance(term, str) and term not in self._names:
                hint = suggestion(term, self._names, "variables")
                raise MistakeError(f"'{shortened(term)}' is not a variable", hint)

    def _elements(self, section: str, tag: str) -> Iterator[ElementView]:
        for found in self._root.children(section):
            found.ignore_attributes(f"nb{section.capitalize()}")
            yield from found.children(tag)


def read_relation(element: ElementView, costs: CostReader) -> ForeignTable | AsymmetricTable:
    """Return a relation. Raises `MistakeError`.

    A cost applies to all following tuples until the next cost. Of equal tuples the last one counts, as in FRODO.
    Without `defaultCost`, unlisted tuples are forbidden.
    """
    semantics = element.attribute("semantics")
    element.ignore_attributes("nbTuples")
    if semantics not in _SEMANTICS:
        what = f"the semantics '{shortened(semantics)}' is not valid"
        raise MistakeError(what, f"write one of {' '.join(_SEMANTICS)}")
    if semantics == "soft":
        return _read_soft_relation(element, costs)
    listed, other = (_ZERO, INFINITE) if semantics == "supports" else (INFINITE, _ZERO)
    found: dict[tuple[int, ...], Price] = {}
    for cost, values in split_tuples(element.text()):
        if cost:
            what = f"a relation with semantics {semantics} cannot have the cost {shortened(cost)}"
            raise MistakeError(what, 'write semantics="soft"')
        found[_values(values)] = listed
    return _table(element, found, other)


def _read_soft_relation(element: ElementView, costs: CostReader) -> ForeignTable | AsymmetricTable:
    default = element.attribute("defaultCost")
    other = [costs.cost(word) for word in default.split()] or [INFINITE]
    now: list[Price] = []
    first: dict[tuple[int, ...], Price] = {}
    second: dict[tuple[int, ...], Price] = {}
    written = None
    for cost, text in split_tuples(element.text()):
        if cost and cost != written:
            now, written = [costs.cost(word) for word in cost.split()], cost
        if not now:
            raise MistakeError(f"the tuple '{shortened(text.strip())}' has no cost", "write cost:tuple, 5:1 2|3:2 2")
        if len(now) > 2 or (first and (len(now) > 1) != bool(second)):  # noqa: PLR2004 - one for each side
            what = f"the number of costs in '{shortened(cost)}' is not valid"
            raise MistakeError(what, "write one cost for each tuple, or two for each tuple: one for each agent")
        values = _values(text)
        if values:
            first[values] = now[0]
            if len(now) > 1:
                second[values] = now[1]
    if second or len(other) > 1:
        return AsymmetricTable(_table(element, first, other[0]), _table(element, second, other[-1]))
    return _table(element, first, other[0])


def _table(element: ElementView, costs: dict[tuple[int, ...], Price], default: Price) -> ForeignTable:
    name, given = element.attribute("name"), element.attribute("arity")
    arity = len(next(iter(costs))) if costs else integer(given or "0")
    for values in costs:
        if len(values) != arity:
            shown = " ".join(map(str, values))
            what = f"the tuple '{shortened(shown)}' has {len(values)} values, but other tuples have {arity}"
            raise MistakeError(what, "write one value for each variable")
    return ForeignTable(name, arity, costs, default)


def _values(text: str) -> tuple[int, ...]:
    return tuple([integer(word) for word in text.split()])


def read_formula(element: ElementView) -> Predicate | Function:
    """Return a predicate, or a function whose value is a cost. Raises `MistakeError`."""
    name, function = element.attribute("name"), element.tag == "function"
    formula, parameters = element.child("expression"), element.child("parameters")
    functional = formula.child("functional") if formula else None
    if formula is None or functional is None:
        others = next((form for form in _OTHER_FORMS if formula and formula.has(form)), "")
        wrong = f"only an expression in the form {others}" if others else "no expression"
        raise MistakeError(f"'{shortened(name)}' has {wrong}", "write it as <expression><functional>")
    formula.ignore(*_OTHER_FORMS)  # other forms of the same expression
    if function:
        element.ignore_attributes("return")
    formals = _parameters(parameters.text() if parameters else "")
    body = read_expression(functional.text(), formals, Type.INTEGER if function else Type.BOOLEAN)
    return Function(name, formals, body) if function else Predicate(name, formals, body)


def _parameters(text: str) -> tuple[str, ...]:
    words = text.split()
    if len(words) % 2 or any(word != "int" for word in words[::2]):
        raise MistakeError(f"the parameters '{shortened(text.strip())}' are not valid", "write int X int Y")
    if len(set(words[1::2])) < len(words) // 2:
        raise MistakeError(f"duplicate parameter in '{shortened(text.strip())}'", "rename one of them")
    return tuple(words[1::2])


def read_expression(text: str, names: tuple[str, ...], result_type: Type) -> Expression:
    """Return the functional expression in `text`. Raises `MistakeError`."""
    if not {"true", "false"} & set(names):
        text = _TRUTH.sub(lambda word: _TRUTH_VALUES[word[0]], text)
    try:
        return parse(text, names, result_type)
    except ExpressionError as error:
        raise MistakeError(f"in the expression: {error.message}", error.hint or "see the format's reference") from None


@contextmanager
def _with_line(element: ElementView) -> Iterator[None]:
    """Add the line of `element` to a `MistakeError` without a line."""
    try:
        yield
    except MistakeError as mistake:
        raise MistakeError(mistake.message, mistake.hint, mistake.line or element.line) from None
