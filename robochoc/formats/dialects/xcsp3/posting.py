"""The constraints and costs read from an instance, over the variables of the team."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import field
from typing import NamedTuple

from robochoc.formats.definitions import MAX_TUPLES, MAX_VALUES
from robochoc.formats.diagnostics import MistakeError, shortened, suggestion
from robochoc.formats.dialects.xcsp3.expressions import (
    FALSE,
    TRUE,
    Xcsp3Condition,
    as_boolean,
    as_integer,
    compare,
    integer,
    read_condition,
    read_conditions,
    read_tree,
    resolve_tree,
)
from robochoc.formats.dialects.xcsp3.variables import MAX_VARIABLES, Variables
from robochoc.model.expression import (
    Apply,
    Constant,
    ExcessiveValueError,
    Expression,
    Name,
    UndefinedValueError,
    evaluate,
    names,
)
from robochoc.model.expression import text as expression_text
from robochoc.model.expression.bounds import Interval, bounds
from robochoc.model.problem import Constraint, Definition, Function, Predicate, Relation, Semantics
from robochoc.system.lazy_dataclass import dataclass

MAX_CONSTRAINTS = 500_000
"""The maximum number of constraints."""
MAX_NODES = 9_000
"""The maximum number of operators and terms of one constraint."""
MAX_NESTING = 60
"""The maximum depth of the expression of one constraint."""
MAX_ENUMERATED = 200_000
"""The maximum number of combinations of values of a constraint that is tabulated by enumeration."""
MAX_COST_ENUMERATED = 1_000_000
"""The maximum number of combinations of values of the variables of one cost function."""
MAX_WORK = 5_000_000
"""The maximum number of operators, terms and values of an instance."""

Test = Callable[[Sequence[int]], bool]
Item = Expression
"""A member of a list: a variable, an integer, or an expression."""


class Auxiliary(NamedTuple):
    """A variable that is not in the instance; `same_robot_as` is a variable whose robot owns it, if any."""

    values: tuple[int, ...]
    purpose: str
    same_robot_as: str | None


@dataclass
class Posting:
    """The variables of an instance, and the constraints and costs posted on them.

    Attributes:
        variables: The variables as declared.
        values: The values of each variable, ascending; for a symbolic variable, the indexes in `symbols`.
        symbols: All symbols of the instance, with their indexes.
        names: The name in the team of each variable.
        constraints: The constraints, over names in the team.
        costs: The cost functions, over names in the team.
        constant: The constant part of the costs.
        auxiliaries: The auxiliary variables, which are not in the instance, by their names in the team.
        line: The line of the current element.
        title: The name of the current constraint.
        work: The number of operators, terms and values so far.
    """

    variables: Variables
    values: Mapping[str, Sequence[int]]
    symbols: Mapping[str, int]
    names: Mapping[str, str]
    constraints: list[Constraint] = field(default_factory=list)
    costs: list[Constraint] = field(default_factory=list)
    constant: int = 0
    auxiliaries: dict[str, Auxiliary] = field(default_factory=dict)
    line: int = 0
    title: str = ""
    work: int = 0
    _definitions: dict[object, Definition] = field(default_factory=dict)
    _original: dict[str, str] = field(default_factory=dict)

    def __post_init__(self) -> None:
        self._original = {ours: theirs for theirs, ours in self.names.items()}

    # Terms

    def leaf(self, word: str) -> tuple[Expression, bool]:
        """Return the variable, integer or symbol named by a word, and whether it is symbolic."""
        if word in self.names:
            return Name(self.names[word]), self.variables.is_symbolic(word)
        if word in self.symbols:
            return Constant(self.symbols[word]), True
        if word[:1] in "+-0123456789":
            return Constant(integer(word)), False
        raise MistakeError(f"there is no variable '{shortened(word)}'", suggestion(word, self.names, "variables"))

    def term(self, word: str) -> Expression:
        """Return the expression, variable or integer in a word. Raises `MistakeError` for a symbol."""
        if "(" in word:
            return self.expression(word)
        found, is_symbolic = self.leaf(word)
        if is_symbolic:
            what = f"'{shortened(word)}' is symbolic"
            raise MistakeError(what, "use symbols only in tables, eq, ne, in and allDifferent")
        return found

    def item(self, word: str) -> Expression:
        """Return the expression, variable, integer or symbol in a word."""
        return self.expression(word) if "(" in word else self.leaf(word)[0]

    def expression(self, text: str) -> Expression:
        """Return the functional expression in a text."""
        return resolve_tree(read_tree(text), self.leaf, MAX_VALUES)

    def condition(self, text: str) -> Xcsp3Condition:
        """Return the condition in a text."""
        return read_condition(text, self.term, MAX_VALUES)

    def conditions(self, text: str) -> list[Xcsp3Condition]:
        """Return the conditions in a text."""
        return read_conditions(text, self.term, MAX_VALUES)

    def domain(self, item: Expression) -> Sequence[int]:
        """Return the possible values of a variable or an integer. Raises `MistakeError` for an expression."""
        match item:
            case Constant(value):
                return (value,)
            case Name(name):
                return self._values(name)
            case _:
                raise MistakeError("expected a variable or an integer, found an expression", "use a variable")

    def values_of(self, expression: Expression) -> Sequence[int]:
        """Return integers that include all values of `expression`. Raises `MistakeError` for too many."""
        if not isinstance(expression, Apply):
            return self.domain(expression)
        limits = {name: Interval(min(self._values(name)), max(self._values(name))) for name in names(expression)}
        low, high = bounds(expression, limits)
        if high - low >= MAX_VALUES:
            what = f"the values of an expression are from {low:,} to {high:,}"
            raise MistakeError(what, f"use an expression of at most {MAX_VALUES:,} values")
        return range(int(low), int(high) + 1)

    def is_symbolic(self, name: str) -> bool:
        """Return whether the values of the team's variable `name` are symbols."""
        return name in self._original and self.variables.is_symbolic(self._original[name])

    def add_variable(self, name: str, values: Iterable[int], purpose: str, same_robot_as: str | None = None) -> Name:
        """Return a new auxiliary variable.

        Args:
            name: The name of the variable; a suffix is added if the name is in use.
            values: The values of the variable.
            purpose: The purpose of the variable, for messages.
            same_robot_as: The name in the team of a variable; its robot owns the new variable. None: a new robot does.

        Raises:
            MistakeError: if there are too many values or variables.
        """
        found = tuple(sorted(set(values)))
        if len(found) > MAX_VALUES:
            what = f"an auxiliary variable has {len(found):,} values"
            raise MistakeError(what, f"use domains of at most {MAX_VALUES:,} values")
        if len(self.auxiliaries) == MAX_VARIABLES:
            raise MistakeError(f"there are more than {MAX_VARIABLES:,} auxiliary variables", "import a smaller problem")
        while name in self._original or name in self.auxiliaries:
            name += "_"
        self.auxiliaries[name] = Auxiliary(found, purpose, same_robot_as)
        return Name(name)

    def _values(self, name: str) -> Sequence[int]:
        return self.auxiliaries[name].values if name in self.auxiliaries else self.values[self._original[name]]

    def size(self, items: Iterable[str]) -> int:
        """Return the number of combinations of values of the variables `items`."""
        return math.prod(len(self._values(name)) for name in items)

    # Constraints

    def post(self, expression: Expression) -> None:
        """Post that a Boolean or an integer expression is true. The parts of a conjunction are posted one by one."""
        for part in _conjuncts(as_boolean(expression)):
            self._check_size(part)
            scope = names(part)
            if not scope:
                self._post_constant(part)
                continue
            formal, body = self._with_formals(part, scope)
            predicate = self._shared(("predicate", body), lambda name: Predicate(name, formal, body), "p")  # noqa: B023
            self._add(predicate, scope)

    def post_table(self, scope: Sequence[Item], rows: Iterable[Sequence[int]], *, allowed: bool) -> None:
        """Post that `scope` has one of the values in `rows`, or none of them."""
        if any(isinstance(item, Apply) for item in scope):
            raise MistakeError("the scope of a table contains an expression", "use variables and integers")
        scope_names = [item.name for item in scope if isinstance(item, Name)]
        if len(scope_names) != len(scope) or len(set(scope_names)) != len(scope_names):
            scope_names = list(dict.fromkeys(scope_names))
            rows = _matching_rows(scope, scope_names, rows)
        found = tuple(sorted({tuple(row) for row in rows}))
        if len(found) > MAX_TUPLES:
            raise MistakeError(f"the table has {len(found):,} tuples", f"use at most {MAX_TUPLES:,} tuples")
        if not scope_names:
            self.post(TRUE if bool(found) == allowed else FALSE)
            return
        self._count_work(len(found) + 1)
        if not found:
            self.post(_unsatisfiable(scope_names[0]) if allowed else TRUE)
            return
        semantics = Semantics.SUPPORTS if allowed else Semantics.CONFLICTS
        relation = self._shared(
            ("relation", semantics, found), lambda name: Relation(name, len(scope_names), semantics, found), "r"
        )
        self._add(relation, scope_names)

    def post_enumerated(self, kind: str, scope: Sequence[Item], test: Test) -> None:
        """Post the table of all combinations of values of `scope` for which `test` returns True."""
        scope_names = list(dict.fromkeys(name for item in scope for name in names(item)))
        if self.size(scope_names) > MAX_ENUMERATED:
            message = f"<{kind}> has {readable_number(self.size(scope_names))} combinations of values"
            raise MistakeError(message, f"use at most {MAX_ENUMERATED:,}, since it becomes a table")
        domains = [self.domain(Name(name)) for name in scope_names]
        place = {name: index for index, name in enumerate(scope_names)}

        def holds(row: Sequence[int]) -> bool:
            return test([item.value if isinstance(item, Constant) else row[place[names(item)[0]]] for item in scope])

        self.post_table([Name(name) for name in scope_names], filter(holds, itertools.product(*domains)), allowed=True)

    def post_cost(self, expression: Expression) -> None:
        """Add an integer expression to the costs."""
        expression = as_integer(expression)
        self._check_size(expression)
        scope = names(expression)
        if not scope:
            value = _constant(expression)
            if value is None:
                self.post(FALSE)
            else:
                self.constant += value
            return
        if self.size(scope) > MAX_COST_ENUMERATED:
            message = f"a cost of {len(scope)} variables has {readable_number(self.size(scope))} combinations of values"
            raise MistakeError(message, f"use at most {MAX_COST_ENUMERATED:,}, or a sum, which is split into its terms")
        formal, body = self._with_formals(expression, scope)
        function = self._shared(("function", body), lambda name: Function(name, formal, body), "f")
        self.costs.append(Constraint(self.title, function, scope, scope, line=self.line))

    def _post_constant(self, part: Expression) -> None:
        if not _constant(part):
            self.post(_unsatisfiable(next(iter(self._original))))

    def _with_formals(self, expression: Expression, scope: Sequence[str]) -> tuple[tuple[str, ...], Expression]:
        """Return formal parameters for `scope`, and `expression` over them."""
        formal = {name: f"X{number}" for number, name in enumerate(scope)}
        return tuple(formal.values()), rename_variables(expression, formal)

    def _shared(self, key: object, make: Callable[[str], Definition], letter: str) -> Definition:
        """Return the definition for `key`, which equal constraints share."""
        if key not in self._definitions:
            self._definitions[key] = make(f"{letter}{len(self._definitions)}")
        return self._definitions[key]

    def _add(self, definition: Definition, scope: Sequence[str]) -> None:
        if len(self.constraints) == MAX_CONSTRAINTS:
            raise MistakeError(f"there are more than {MAX_CONSTRAINTS:,} constraints", "import a smaller problem")
        self.constraints.append(Constraint(self.title, definition, tuple(scope), tuple(scope), line=self.line))

    def _check_size(self, expression: Expression) -> None:
        nodes, deepest = 0, 0
        waiting = [(expression, 1)]
        while waiting:
            node, depth = waiting.pop()
            nodes, deepest = nodes + 1, max(deepest, depth)
            if isinstance(node, Apply):
                waiting += [(argument, depth + 1) for argument in node.arguments]
        self._count_work(nodes)
        if nodes > MAX_NODES or deepest > MAX_NESTING:
            message = f"the constraint has {nodes:,} operators and terms, {deepest} levels deep"
            raise MistakeError(message, f"split it: use at most {MAX_NODES:,}, at most {MAX_NESTING} levels deep")

    def _count_work(self, work: int) -> None:
        self.work += work
        if self.work > MAX_WORK:
            what = f"the problem has more than {MAX_WORK:,} operators and values"
            raise MistakeError(what, "import a smaller problem")


def _constant(expression: Expression) -> int | None:
    """Return the value of an expression without variables, None if undefined. Raises `MistakeError` beyond 64 bits."""
    try:
        return evaluate(expression, {})
    except ExcessiveValueError:
        message = f"the constant '{shortened(expression_text(expression))}' is beyond the limit of 2^63"
        raise MistakeError(message, "use smaller numbers") from None
    except UndefinedValueError:
        return None


def readable_number(number: int) -> str:
    """Return a number as text for a message, short even for very large numbers."""
    return f"{number:,}" if number < 10**15 else f"10^{int(number.bit_length() * 0.30103)}"


def rename_variables(expression: Expression, names_for: Mapping[str, str]) -> Expression:
    """Return `expression` with each name replaced by the one in `names_for`."""
    match expression:
        case Name(name):
            return Name(names_for[name])
        case Apply(operator, arguments):
            return Apply(operator, tuple(rename_variables(argument, names_for) for argument in arguments))
        case Constant():
            return expression


def _conjuncts(expression: Expression) -> Iterator[Expression]:
    if isinstance(expression, Apply) and expression.operator == "and":
        for argument in expression.arguments:
            yield from _conjuncts(argument)
    elif expression != TRUE:
        yield expression


def _unsatisfiable(name: str) -> Expression:
    return compare("ne", Name(name), Name(name))


def _matching_rows(
    scope: Sequence[Item], scope_names: Sequence[str], rows: Iterable[Sequence[int]]
) -> Iterator[tuple[int, ...]]:
    """Yield the values of `scope_names` in the rows that match the integers and repetitions in `scope`."""
    for row in rows:
        bound: dict[str, int] = {}
        for item, value in zip(scope, row, strict=True):
            fixed = item.value if isinstance(item, Constant) else bound.setdefault(names(item)[0], value)
            if fixed != value:
                break
        else:
            yield tuple([bound[name] for name in scope_names])
