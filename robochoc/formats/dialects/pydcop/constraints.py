"""Read the constraints of pyDCOP's files: functions and tables, as costs of tuples, predicates or cost functions."""

from __future__ import annotations

import importlib.util
import itertools
import math
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from dataclasses import field
from fractions import Fraction
from pathlib import Path

from robochoc.formats.definitions import MAX_TUPLES
from robochoc.formats.diagnostics import MistakeError, shortened, suggestion
from robochoc.formats.dialects.exact_costs import Amount, ExactCostTable, apply_infinity
from robochoc.formats.dialects.pydcop.domains import DomainValues
from robochoc.formats.dialects.pydcop.python_function import PythonFunction
from robochoc.formats.dialects.pydcop.python_values import NoValueError, Value
from robochoc.formats.dialects.pydcop.translation import VariableInfo, ViolationCost, translate
from robochoc.formats.yaml_tree import Node, Scalar, scalar_text
from robochoc.model.expression import Expression
from robochoc.model.expression.bounds import Interval, bounds
from robochoc.system.lazy_dataclass import dataclass

MAX_CELLS = 5_000_000
"""The maximum total number of tuples in tables created from functions."""


@dataclass(frozen=True)
class ParsedConstraint:
    """A constraint in the file.

    Attributes:
        name: Its name.
        scope: Its variables.
        costs: Its costs: a table, a predicate, or an expression over X0, X1, ...
        line: Its line in the file.
    """

    name: str
    scope: tuple[str, ...]
    costs: ExactCostTable | ViolationCost | Expression
    line: int


@dataclass
class ConstraintReader:
    """Reads the constraints of one problem.

    Attributes:
        values: The values of each variable.
        fixed: The values of external variables.
        infinity: Costs of at least this are infinite. None: no finite cost is.
        maximize: True if costs are maximised.
        folder: The folder of Python files. None: these may not be executed.
        incomplete: The constraints whose tables lack tuples and a default.
    """

    values: Mapping[str, DomainValues]
    fixed: Mapping[str, Scalar]
    infinity: int | None
    maximize: bool
    folder: Path | None
    incomplete: list[str] = field(default_factory=list)
    _cells: int = 0
    _sources: dict[str, Mapping[str, Callable[..., Value]]] = field(default_factory=dict)

    def read(self, name: str, node: Node) -> ParsedConstraint:
        """Return the constraint in `node`. Raises `MistakeError`."""
        if not node.is_mapping:
            raise MistakeError("is not a mapping", "write type: and function:, or variables: and values:")
        kind = node.get("type")
        match kind.scalar if kind else None:
            case "intention":
                return self._intention(name, node)
            case "extensional":
                return self._extensional(name, node)
            case None:
                raise MistakeError("has no type", "write type: intention, or type: extensional")
            case other:
                what = f"has the unknown type '{shortened(str(other))}'"
                raise MistakeError(what, "write type: intention, or type: extensional")

    def function(
        self, name: str, node: Node, variables: Collection[str], sources: Node | None = None
    ) -> ParsedConstraint:
        """Return the constraint given by the function in `node` over some of the `variables`."""
        if isinstance(node.scalar, (bool, int, Fraction, float)):
            return ParsedConstraint(name, (), ExactCostTable(name, {}, self._amount(node.scalar), 1), node.line)
        if not isinstance(node.scalar, str):
            raise MistakeError("has no function", "write function: and a Python expression", node.line)
        function = PythonFunction(node.scalar, variables, self.fixed, self._source_functions(sources))
        known = {one: VariableInfo(self.values[one].domain, self.values[one].kind) for one in function.scope}
        simple = translate(function.body, function.scope, known, self.fixed) if len(function.scope) > 1 else None
        if simple is not None and self._is_bounded(simple, function.scope):
            if isinstance(simple, ViolationCost):
                simple = ViolationCost(simple.body, self._amount(simple.cost))
            return ParsedConstraint(name, function.scope, simple, node.line)
        return ParsedConstraint(name, function.scope, self._tabulate(name, function), node.line)

    def _intention(self, name: str, node: Node) -> ParsedConstraint:
        function = node.needed("function", "it", "write function: and a Python expression")
        return self.function(name, function, self.values, node.get("source"))

    def _source_functions(self, node: Node | None) -> Mapping[str, Callable[..., Value]]:
        if node is None:
            return {}
        if self.folder is None:
            what = f"requires the Python file '{shortened(str(node.scalar))}', which would be executed"
            raise MistakeError(what, "use --allow-code if you trust this file", node.line)
        path = str(node.scalar)
        if path not in self._sources:
            self._sources[path] = load_functions(self.folder / path)
        return self._sources[path]

    def _is_bounded(self, simple: ViolationCost | Expression, scope: Sequence[str]) -> bool:
        """Return whether all costs of an expression are below the infinity."""
        if isinstance(simple, ViolationCost) or self.infinity is None:
            return True
        limits = {}
        for place, one in enumerate(scope):
            ranges = self.values[one].domain.ranges
            limits[f"X{place}"] = Interval(ranges[0][0], ranges[-1][-1])
        low, high = bounds(simple, limits)
        return -low < self.infinity if self.maximize else high < self.infinity

    def _tabulate(self, name: str, function: PythonFunction) -> ExactCostTable:
        size = self._size(function.scope)
        self._cells += size
        if size > MAX_TUPLES or self._cells > MAX_CELLS:
            what = f"has a function with {size} combinations of values, too many for a table"
            hint = (
                f"use at most {MAX_TUPLES} in a table and {MAX_CELLS} in all tables, or a function of integers with"
                " + - * abs min max, comparisons and conditions, which requires no table"
            )
            raise MistakeError(what, hint)
        rows = {}
        scalars = [self.values[one].scalars for one in function.scope]
        for codes in itertools.product(*scalars):
            arguments = {one: known[code] for one, known, code in zip(function.scope, scalars, codes, strict=True)}
            value = function.value(arguments)
            if not isinstance(value, (int, Fraction, float)):
                raise MistakeError(f"has a function with the value {value!r:.40}", "write a function of numbers")
            rows[codes] = self._amount(value)
        if not function.scope:
            return ExactCostTable(name, {}, rows[()], 1)
        return ExactCostTable(name, rows, 0, size)

    def _extensional(self, name: str, node: Node) -> ParsedConstraint:
        line, hint = node.line, "write values: and, below, COST: v w | v w"
        scope = self._scope(node.needed("variables", "it", "write variables: [v1, v2]"), line)
        values = node.needed("values", "it", hint)
        if not values.is_mapping:
            raise MistakeError("has no values", hint, line)
        rows: dict[tuple[int, ...], Amount] = {}
        for cost, tuples in values.named():
            if not isinstance(cost, (int, Fraction, float)):
                what = f"has the cost '{shortened(str(cost))}', which is not a number"
                raise MistakeError(what, "write COST: v w | v w", values.key_line(cost))
            amount = self._amount(cost)
            for codes in self._tuples(scope, tuples):
                rows[codes] = amount
        default = node.get("default")
        if default is None or default.is_empty:
            amount = math.inf
            if len(rows) < self._size(scope):
                self.incomplete.append(name)
        elif isinstance(default.scalar, (int, Fraction, float)):
            amount = self._amount(default.scalar)
        else:
            raise MistakeError("has a default that is not a number", "write default: 100", default.line)
        return ParsedConstraint(name, scope, ExactCostTable(name, rows, amount, self._size(scope)), line)

    def _scope(self, node: Node, line: int) -> tuple[str, ...]:
        parts = [node] if node.is_scalar else node.items
        if not parts:
            raise MistakeError("has no variables", "write variables: [v1, v2]", line)
        scope = tuple(str(one.scalar).strip() for one in parts)
        for one in scope:
            if one not in self.values:
                what = f"has the unknown variable '{shortened(one)}'"
                raise MistakeError(what, suggestion(one, list(self.values), "variables"), line)
        if len(set(scope)) < len(scope):
            raise MistakeError("has a variable twice in its scope", "name each variable once", line)
        return scope

    def _tuples(self, scope: Sequence[str], node: Node) -> Iterator[tuple[int, ...]]:
        codes = [self.values[one].codes for one in scope]
        for place, words in _tuple_words(scope, node):
            if len(words) != len(scope):
                what = f"has the tuple '{shortened(' '.join(words))}' with {len(words)} values instead of {len(scope)}"
                raise MistakeError(what, "separate values by blanks, and tuples by '|'", place)
            try:
                yield tuple([known[one] for known, one in zip(codes, words, strict=True)])
            except KeyError as error:
                bad = str(error.args[0])
                where = next(one for one, known, given in zip(scope, codes, words, strict=True) if given not in known)
                what = f"has the value '{shortened(bad)}', which is not in the domain of {shortened(where)}"
                raise MistakeError(what, suggestion(bad, list(self.values[where].codes), "values"), place) from None

    def _amount(self, amount: Amount) -> Amount:
        return apply_infinity(
            int(amount) if isinstance(amount, bool) else amount, self.infinity, maximize=self.maximize
        )

    def _size(self, scope: Sequence[str]) -> int:
        return math.prod(len(self.values[one].scalars) for one in scope)


def _tuple_words(scope: Sequence[str], node: Node) -> Iterator[tuple[int, list[str]]]:
    """Yield the words in the tuples of a cost, with their line numbers."""
    for one in node.items if node.items is not None else [node]:
        if not one.is_scalar:
            raise MistakeError("has a list or a mapping instead of tuples", "write v w | v w", one.line)
        if isinstance(one.scalar, str) and len(scope) == 1:
            yield from ((one.line, [part.strip()]) for part in one.scalar.split("|"))
        elif isinstance(one.scalar, str):
            yield from ((one.line, part.split()) for part in one.scalar.split("|"))
        else:
            yield one.line, [scalar_text(one.scalar)]


def load_functions(path: Path) -> dict[str, Callable[..., Value]]:
    """Execute the Python file at `path`, and return its functions.

    Raises:
        MistakeError: if the execution fails.
    """
    spec = importlib.util.spec_from_file_location("source", path)
    if spec is None or spec.loader is None or not path.is_file():
        what = f"the source {shortened(str(path))} is not a Python file"
        raise MistakeError(what, "put it in the folder of the first file of the problem")
    module = importlib.util.module_from_spec(spec)
    try:
        spec.loader.exec_module(module)
    except Exception as error:  # noqa: BLE001 - whatever the user's code raises
        what = f"the source {shortened(str(path))} fails: {type(error).__name__}: {shortened(str(error))}"
        raise MistakeError(what, "correct the Python file") from None
    return {name: _with_exact_numbers(thing) for name, thing in vars(module).items() if callable(thing)}


def _with_exact_numbers(function: Callable[..., object]) -> Callable[..., Value]:
    """Return `function` with exact numbers as arguments and result."""

    def call(*arguments: Value) -> Value:
        try:
            result = function(*[float(one) if isinstance(one, Fraction) else one for one in arguments])
        except Exception as error:  # noqa: BLE001 - whatever the user's code raises
            raise NoValueError(f"{type(error).__name__}: {error}") from None
        if isinstance(result, float) and result not in (float("inf"), float("-inf")):
            return Fraction(repr(result)) if result == result else result  # noqa: PLR0124 - only NaN differs from itself
        if result is None or isinstance(result, (int, float, str)):
            return result
        raise NoValueError(f"the result is of the type {type(result).__name__}, not a number")

    return call
