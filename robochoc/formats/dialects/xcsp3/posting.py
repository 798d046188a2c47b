"""What has been read so far of an instance: constraints and costs over its variables."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

from robochoc.formats.definitions import MAX_TUPLES, MAX_VALUES
from robochoc.formats.diagnostics import MistakeError, shortened, suggestion
from robochoc.formats.dialects.xcsp3.terms import (
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

MAX_CONSTRAINTS = 500_000
"""The maximum number of constraints."""
MAX_NODES = 9_000
"""The maximum number of operators and terms of one constraint."""
MAX_NESTING = 60
"""The maximum depth of the expression of one constraint."""
MAX_ENUMERATED = 200_000
"""The maximum number of combinations of values that a constraint is tried on to make it a table."""
MAX_COST_ENUMERATED = 1_000_000
"""The maximum number of combinations of values of the variables of one cost."""
MAX_WORK = 5_000_000
"""The maximum number of all operators, terms and values of an instance."""

Test = Callable[[Sequence[int]], bool]
Item = Expression
"""A member of a list: a variable, an integer, or an expression."""


class Auxiliary(NamedTuple):
    """A variable that is not in the instance: its values, its purpose, and the variable whose robot owns it, if any."""

    values: tuple[int, ...]
    purpose: str
    same_robot_as: str | None


@dataclass
class Posting:
    """The variables of an instance, and what has been posted on them.

    Attributes:
        variables: The variables as they are declared.
        values: The values of each variable, ascending; of a symbolic one the places in `symbols`.
        symbols: All symbols of the instance.
        names: Our name of each variable.
        constraints: The constraints, over our names.
        costs: The costs, over our names.
        constant: The constant part of the costs.
        auxiliaries: Auxiliary variables, which are not in the instance, by our names.
        line: The line of the element that is read.
        title: The name of the constraint that is read.
        work: The operators, terms and values so far.
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
        """Return the variable, integer or symbol that a word stands for, and whether it is symbolic."""
        if word in self.names:
            return Name(self.names[word]), self.variables.is_symbolic(word)
        if word in self.symbols:
            return Constant(self.symbols[word]), True
        if word[:1] in "+-0123456789":
            return Constant(integer(word)), False
        raise MistakeError(f"there is no variable '{shortened(word)}'", suggestion(word, self.names, "variables"))

    def term(self, word: str) -> Expression:
        """Return the expression, variable or integer that a word stands for."""
        if "(" in word:
            return self.expression(word)
        found, is_symbolic = self.leaf(word)
        if is_symbolic:
            raise MistakeError(f"the symbolic '{shortened(word)}'", "symbols stand in tables, eq, ne, in, allDifferent")
        return found

    def item(self, word: str) -> Expression:
        """Return what a word stands for, which may be symbolic, too."""
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
        """Return the values that a variable or an integer may have. Raises `MistakeError` for an expression."""
        match item:
            case Constant(value):
                return (value,)
            case Name(name):
                return self._values(name)
            case _:
                raise MistakeError("an expression where a variable or an integer should stand", "use a variable")

    def values_of(self, expression: Expression) -> Sequence[int]:
        """Return integers among which all values of `expression` are. Raises `MistakeError` for too many."""
        if not isinstance(expression, Apply):
            return self.domain(expression)
        limits = {name: Interval(min(self._values(name)), max(self._values(name))) for name in names(expression)}
        low, high = bounds(expression, limits)
        if high - low >= MAX_VALUES:
            raise MistakeError(f"an expression from {low:,} to {high:,}", f"{MAX_VALUES:,} values are supported")
        return range(int(low), int(high) + 1)

    def is_symbolic(self, name: str) -> bool:
        """Return whether the values of our variable `name` are symbols."""
        return name in self._original and self.variables.is_symbolic(self._original[name])

    def add_variable(self, name: str, values: Iterable[int], purpose: str, same_robot_as: str | None = None) -> Name:
        """Return a new auxiliary variable.

        Args:
            name: The name of the variable; a suffix is added if it is not free.
            values: The values of the variable.
            purpose: The purpose of the variable, for messages.
            same_robot_as: The name in the team of a variable; its robot owns the new variable. None: a new robot does.

        Raises:
            MistakeError: if there are too many values or variables.
        """
        found = tuple(sorted(set(values)))
        if len(found) > MAX_VALUES:
            raise MistakeError(f"an auxiliary variable of {len(found):,} values", f"{MAX_VALUES:,} are supported")
        if len(self.auxiliaries) == MAX_VARIABLES:
            raise MistakeError(f"more than {MAX_VARIABLES:,} auxiliary variables", "import a smaller problem")
        while name in self._original or name in self.auxiliaries:
            name += "_"
        self.auxiliaries[name] = Auxiliary(found, purpose, same_robot_as)
        return Name(name)

    def _values(self, name: str) -> Sequence[int]:
        return self.auxiliaries[name].values if name in self.auxiliaries else self.values[self._original[name]]

    def size(self, items: Iterable[str]) -> int:
        """Return the number of combinations of values of variables."""
        return math.prod(len(self._values(name)) for name in items)

    # Constraints

    def post(self, expression: Expression) -> None:
        """Post that a Boolean or an integer expression is true. A conjunction is posted part by part."""
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
            raise MistakeError("an expression in the scope of a table", "use variables and integers")
        own = [item.name for item in scope if isinstance(item, Name)]
        if len(own) != len(scope) or len(set(own)) != len(own):
            own = list(dict.fromkeys(own))
            rows = _matching_rows(scope, own, rows)
        found = tuple(sorted({tuple(row) for row in rows}))
        if len(found) > MAX_TUPLES:
            raise MistakeError(f"a table of {len(found):,} tuples", f"{MAX_TUPLES:,} are allowed")
        if not own:
            self.post(TRUE if bool(found) == allowed else FALSE)
            return
        self._count_work(len(found) + 1)
        if not found:
            self.post(_unsatisfiable(own[0]) if allowed else TRUE)
            return
        semantics = Semantics.SUPPORTS if allowed else Semantics.CONFLICTS
        relation = self._shared(
            ("relation", semantics, found), lambda name: Relation(name, len(own), semantics, found), "r"
        )
        self._add(relation, own)

    def post_enumerated(self, kind: str, scope: Sequence[Item], test: Test) -> None:
        """Post what `test` says of the values of `scope`, which are all tried."""
        own = list(dict.fromkeys(name for item in scope for name in names(item)))
        if self.size(own) > MAX_ENUMERATED:
            message = f"<{kind}> has {readable_number(self.size(own))} combinations of values"
            raise MistakeError(message, f"it becomes a table of at most {MAX_ENUMERATED:,}")
        domains = [self.domain(Name(name)) for name in own]
        place = {name: index for index, name in enumerate(own)}

        def holds(row: Sequence[int]) -> bool:
            return test([item.value if isinstance(item, Constant) else row[place[names(item)[0]]] for item in scope])

        self.post_table([Name(name) for name in own], filter(holds, itertools.product(*domains)), allowed=True)

    def post_cost(self, expression: Expression) -> None:
        """Post that an integer expression is a part of the costs."""
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
            message = (
                f"the cost of {len(scope)} variables together has {readable_number(self.size(scope))} combinations"
            )
            raise MistakeError(message, f"at most {MAX_COST_ENUMERATED:,} are supported; a sum is split into its terms")
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
        """Return the definition for `key`: constraints that say the same share one."""
        if key not in self._definitions:
            self._definitions[key] = make(f"{letter}{len(self._definitions)}")
        return self._definitions[key]

    def _add(self, definition: Definition, scope: Sequence[str]) -> None:
        if len(self.constraints) == MAX_CONSTRAINTS:
            raise MistakeError(f"more than {MAX_CONSTRAINTS:,} constraints", "import a smaller problem")
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
            message = f"a constraint of {nodes:,} operators and terms, {deepest} levels deep"
            raise MistakeError(message, f"{MAX_NODES:,} and {MAX_NESTING} are allowed: split it")

    def _count_work(self, work: int) -> None:
        self.work += work
        if self.work > MAX_WORK:
            raise MistakeError(f"the problem has more than {MAX_WORK:,} operators and values", "import a smaller one")


def _constant(expression: Expression) -> int | None:
    """Return the value of an expression without variables, if it has one. Raises `MistakeError` beyond 64 bits."""
    try:
        return evaluate(expression, {})
    except ExcessiveValueError:
        message = f"the constant '{shortened(expression_text(expression))}' lies beyond the limit of 2^63"
        raise MistakeError(message, "use smaller numbers") from None
    except UndefinedValueError:
        return None


def readable_number(number: int) -> str:
    """Return a number as it may stand in a message, however large it is."""
    return f"{number:,}" if number < 10**15 else f"10^{int(number.bit_length() * 0.30103)}"


def rename_variables(expression: Expression, names_for: Mapping[str, str]) -> Expression:
    """Return `expression` with other names."""
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
    scope: Sequence[Item], own: Sequence[str], rows: Iterable[Sequence[int]]
) -> Iterator[tuple[int, ...]]:
    """Yield `rows` as values of the variables `own`: those that fit the integers and the repetitions of `scope`."""
    for row in rows:
        bound: dict[str, int] = {}
        for item, value in zip(scope, row, strict=True):
            fixed = item.value if isinstance(item, Constant) else bound.setdefault(names(item)[0], value)
            if fixed != value:
                break
        else:
            yield tuple([bound[name] for name in own])
