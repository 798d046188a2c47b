"""Translate XCSP3's functional expressions to robochoc's, and conditions such as `(le,10)`.

XCSP3 (Boussemart, Lecoutre, Audemard, Piette, "XCSP3-core", arXiv 2009.00514) has no Booleans: 0 is false, any other
integer is true. robochoc's expressions are typed, so the translation inserts conversions.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Collection, Iterable, Iterator, Sequence
from functools import lru_cache, reduce
from typing import Any

from robochoc.formats.diagnostics import MistakeError, shortened, suggestion
from robochoc.model.expression import OPERATORS, Apply, Constant, Expression, Type
from robochoc.system.lazy_dataclass import dataclass

MAX_TEXT = 1_000_000
"""The maximum length of the text of an expression."""
MAX_DEPTH = 50
"""The maximum depth of an expression."""

TRUE: Expression = Apply("eq", (Constant(0), Constant(0)))
FALSE: Expression = Apply("ne", (Constant(0), Constant(0)))

_LARGEST_SET = 64
"""The maximum size of a set that is written as a set; larger sets are written as ranges."""
_TOKEN = re.compile(r"\s*([A-Za-z_][A-Za-z0-9_]*(?:\[[0-9]{1,9}\])*|[+-]?[0-9]{1,18}(?![0-9.])|%[0-9]{1,6}|[(),])")
_INTEGER = re.compile(r"[+-]?[0-9]{1,18}")
_RANGE = re.compile(r"([+-]?[0-9]{1,18})\.\.([+-]?[0-9]{1,18})")
_CONDITION = re.compile(r"\(\s*([a-z]+)\s*,\s*(.*?)\s*\)", re.DOTALL)

_CONDITION_IN_LIST = re.compile(r"\([^()]*\)")
_CONDITIONS = re.compile(r"(?>\([^()]*\)\s*)+")

INVERSE = {"lt": "gt", "le": "ge", "gt": "lt", "ge": "le", "eq": "eq", "ne": "ne"}
RELATIONS = frozenset(INVERSE)
"""The operators of conditions and ordered constraints."""


@dataclass(frozen=True, slots=True)
class Leaf:
    """A name, an integer or a parameter `%0` in an expression, as text."""

    text: str


@dataclass(frozen=True, slots=True)
class Call:
    """An operator with its arguments, before their translation."""

    operator: str
    arguments: tuple[Tree, ...]


Tree = Leaf | Call
Resolve = Callable[[str], tuple[Expression, bool]]
"""Returns the expression for a leaf, and whether it is symbolic: a symbol, or a variable over symbols."""


def type_of(expression: Expression) -> Type:
    """Return the type of the value of `expression`."""
    return OPERATORS[expression.operator].gives if isinstance(expression, Apply) else Type.INTEGER


def as_integer(expression: Expression) -> Expression:
    """Return `expression` as an integer: 1 for true, 0 for false."""
    if type_of(expression) == Type.INTEGER:
        return expression
    return Apply("if", (expression, Constant(1), Constant(0)))


def as_boolean(expression: Expression) -> Expression:
    """Return `expression` as a Boolean: true for any integer except 0."""
    if type_of(expression) == Type.BOOLEAN:
        return expression
    if isinstance(expression, Apply) and expression.operator == "if":
        condition, then, otherwise = expression.arguments
        if then == Constant(1) and otherwise == Constant(0):
            return condition
    return Apply("ne", (expression, Constant(0)))


def conjunction(parts: Sequence[Expression]) -> Expression:
    """Return the conjunction of Booleans."""
    return FALSE if FALSE in parts else _fold("and", [part for part in parts if part != TRUE], TRUE)


def disjunction(parts: Sequence[Expression]) -> Expression:
    """Return the disjunction of Booleans."""
    return TRUE if TRUE in parts else _fold("or", [part for part in parts if part != FALSE], FALSE)


def total(parts: Sequence[Expression]) -> Expression:
    """Return the sum of integers."""
    return _fold("add", [part for part in parts if part != Constant(0)], Constant(0))


def times(factor: Expression, expression: Expression) -> Expression:
    """Return the product of two integers."""
    if Constant(0) in (factor, expression):
        return Constant(0)
    if isinstance(factor, Constant) and isinstance(expression, Constant):
        return Constant(factor.value * expression.value)
    if factor == Constant(1):
        return expression
    return factor if expression == Constant(1) else Apply("mul", (factor, expression))


def plus(one: Expression, other: Expression) -> Expression:
    """Return the sum of two integers."""
    if isinstance(one, Constant) and isinstance(other, Constant):
        return Constant(one.value + other.value)
    return total((one, other))


def compare(operator: str, left: Expression, right: Expression) -> Expression:
    """Return a comparison of two integers."""
    return Apply(operator, (left, right))


def is_one_of(expression: Expression, values: Collection[int]) -> Expression:
    """Return an expression that is true if `expression` has one of `values`."""
    runs: list[tuple[int, int]] = []
    for value in sorted(set(values)):
        if runs and runs[-1][1] == value - 1:
            runs[-1] = runs[-1][0], value
        else:
            runs.append((value, value))
    if len(runs) > 1 and len(values) <= _LARGEST_SET:  # one operation has the same form in each term of an aggregate
        return Apply("in", (expression, *(Constant(value) for value in sorted(set(values)))))
    return disjunction([_between(expression, low, high) for low, high in runs])


@dataclass(frozen=True)
class Xcsp3Condition:
    """A comparison without its left side: `(le,10)`, `(eq,x)`, `(in,1..3)`, `(notin,{1,2})`."""

    operator: str
    operand: Expression | tuple[int, ...]

    def on(self, expression: Expression) -> Expression:
        """Return an expression that is true if the condition holds for the integer `expression`."""
        if isinstance(self.operand, tuple):
            found = is_one_of(expression, self.operand)
            return found if self.operator == "in" else Apply("not", (found,))
        return compare(self.operator, expression, self.operand)

    def with_constant(self, value: int) -> bool | None:
        """Return whether the condition holds for `value`; None if this depends on variables."""
        if isinstance(self.operand, tuple):
            return (value in self.operand) == (self.operator == "in")
        if not isinstance(self.operand, Constant):
            return None
        return bool(OPERATORS[self.operator].meaning(value, self.operand.value))


def read_conditions(text: str, term: Callable[[str], Expression], max_values: int) -> list[Xcsp3Condition]:
    """Return the conditions in a text such as `(le,10)(in,1..3)`. Raises `MistakeError`. See `read_condition`."""
    stripped = text.strip()
    if not _CONDITIONS.fullmatch(stripped):
        raise MistakeError(f"'{shortened(text)}' is not a list of conditions", "write (le,10)(le,x)(in,1..3)")
    return [read_condition(one, term, max_values) for one in _CONDITION_IN_LIST.findall(stripped)]


def read_condition(text: str, term: Callable[[str], Expression], max_values: int) -> Xcsp3Condition:
    """Return the condition in a text.

    Args:
        text: The text.
        term: Returns the variable or integer named by a word.
        max_values: The maximum number of values of a set.

    Raises:
        MistakeError: if the text is not a condition.
    """
    match = _CONDITION.fullmatch(text)
    if match and match[1] in RELATIONS:
        return Xcsp3Condition(match[1], term(match[2]))
    if match and match[1] in {"in", "notin"}:
        return Xcsp3Condition(match[1], tuple(_values(match[2], max_values)))
    raise MistakeError(f"'{shortened(text)}' is not a valid condition", "write (le,10), (eq,x) or (in,1..3)")


def zip_equal(*lists: Sequence[Any], what: str = "") -> Iterator[tuple[Any, ...]]:
    """Iterate over lists in parallel, like `zip`.

    Args:
        lists: The lists.
        what: The names of the lists, for a message.

    Raises:
        MistakeError: if the lists have different lengths.
    """
    lengths = [len(one) for one in lists]
    if len(set(lengths)) > 1:
        found = f"lists of different lengths: {' and '.join(map(str, lengths))}"
        raise MistakeError(f"{found} members{what and f' in {what}'}", "write lists of one length")
    return zip(*lists, strict=True)


def words_of(text: str) -> list[str]:
    """Return the words of a list; an expression is one word, even with blanks in it."""
    if "(" not in text:
        return text.split()
    words, depth, begun = [], 0, ""
    for piece in text.split():
        depth += piece.count("(") - piece.count(")")
        begun = f"{begun} {piece}" if begun else piece
        if depth <= 0:
            words.append(begun)
            begun = ""
    return [*words, begun] if begun else words


def integer(text: str) -> int:
    """Return the integer in a text. Raises `MistakeError`."""
    if not _INTEGER.fullmatch(text):
        raise MistakeError(
            f"'{shortened(text)}' is not a valid integer", "write at most 18 digits, with or without a sign"
        )
    return int(text)


def span(text: str) -> range:
    """Return the integers in `4` or `1..4`. Raises `MistakeError`."""
    match = _RANGE.fullmatch(text)
    if not match:
        value = integer(text)
        return range(value, value + 1)
    first, last = int(match[1]), int(match[2])
    if first > last:
        raise MistakeError(f"the range {text} is empty", f"write {last}..{first}")
    return range(first, last + 1)


@lru_cache(maxsize=4096)
def read_tree(text: str) -> Tree:
    """Return the syntax tree of the functional expression in a text.

    Raises:
        MistakeError: if the text is not an expression.
    """
    if len(text) > MAX_TEXT:
        raise MistakeError(f"an expression has {len(text):,} characters", f"write at most {MAX_TEXT:,}")
    tokens: list[str] = []
    place = 0
    stripped = text.rstrip()
    while place < len(stripped):
        match = _TOKEN.match(stripped, place)
        if not match:
            raise _unreadable(text, stripped[place:])
        tokens.append(match[1])
        place = match.end()
    tree, after = _tree(tokens, 0, 1, text)
    if after != len(tokens):
        raise _unreadable(text, tokens[after])
    return tree


def resolve_tree(tree: Tree, resolve: Resolve, max_values: int) -> Expression:
    """Translate `tree` to robochoc's expressions.

    Raises:
        MistakeError: if it has an unsupported operator, or invalid arguments.
    """
    return _resolve(tree, resolve, max_values)[0]


def _resolve(tree: Tree, resolve: Resolve, max_values: int) -> tuple[Expression, bool]:
    if isinstance(tree, Leaf):
        return resolve(tree.text)
    if tree.operator in {"in", "notin"}:
        return _membership(tree, resolve, max_values), False
    found = [_resolve(argument, resolve, max_values) for argument in tree.arguments]
    symbolic = [is_symbolic for _, is_symbolic in found]
    if any(symbolic) and (tree.operator not in {"eq", "ne"} or not all(symbolic)):
        raise MistakeError(
            f"{tree.operator} of symbols is not supported", "compare symbols only with symbols, by eq, ne or in"
        )
    return _apply(tree.operator, [expression for expression, _ in found]), False


def _membership(tree: Call, resolve: Resolve, max_values: int) -> Expression:
    if len(tree.arguments) != 2 or not isinstance(tree.arguments[1], Call) or tree.arguments[1].operator != "set":  # noqa: PLR2004
        raise MistakeError(f"{tree.operator} has no set", f"write {tree.operator}(x,set(1,2))")
    what, is_symbolic = _resolve(tree.arguments[0], resolve, max_values)
    members = [_resolve(member, resolve, max_values) for member in tree.arguments[1].arguments]
    if any(symbol is not is_symbolic for _, symbol in members):
        raise MistakeError("a set contains symbols and integers", "write values of one kind")
    value = as_integer(what)
    constants = [member.value for member, _ in members if isinstance(member, Constant)]
    others = [compare("eq", value, as_integer(member)) for member, _ in members if not isinstance(member, Constant)]
    found = disjunction([is_one_of(value, constants), *others])
    return found if tree.operator == "in" else Apply("not", (found,))


def _apply(operator: str, arguments: list[Expression]) -> Expression:
    """Return the expression for XCSP3's `operator` with `arguments`. Raises `MistakeError`."""
    least, most, make = _MEANINGS.get(operator, (0, -1, None))
    if make is None:
        hint = suggestion(operator, _MEANINGS.keys(), "operators")
        raise MistakeError(f"the operator '{shortened(operator)}' is not supported", hint)
    if not least <= len(arguments) <= most:
        number = f"at least {least}" if most == _MANY else f"{least}"
        raise MistakeError(f"{operator} has {len(arguments)} arguments", f"write {number}")
    return make(arguments)


_MANY = 10**9
"""A number of arguments that no operator in a file can reach."""


def _plain(operator: str) -> Callable[[list[Expression]], Expression]:
    return lambda parts: Apply(operator, tuple(as_integer(part) for part in parts))


def _variadic(operator: str) -> Callable[[list[Expression]], Expression]:
    apply = _plain(operator)
    return lambda parts: apply(parts) if len(parts) > 1 else as_integer(parts[0])


def _equal(parts: list[Expression]) -> Expression:
    first, *others = parts
    return conjunction([_same(first, other) for other in others])


def _same(one: Expression, other: Expression) -> Expression:
    if type_of(one) == Type.BOOLEAN and type_of(other) == Type.BOOLEAN:
        return Apply("iff", (one, other))
    return Apply("eq", (as_integer(one), as_integer(other)))


def _unequal(parts: list[Expression]) -> Expression:
    one, other = parts
    if type_of(one) == Type.BOOLEAN and type_of(other) == Type.BOOLEAN:
        return Apply("xor", (one, other))
    return Apply("ne", (as_integer(one), as_integer(other)))


def _exclusive(parts: list[Expression]) -> Expression:
    return reduce(lambda one, other: Apply("xor", (one, other)), [as_boolean(part) for part in parts])


def _conditional(parts: list[Expression]) -> Expression:
    condition, then, otherwise = parts
    return Apply("if", (as_boolean(condition), as_integer(then), as_integer(otherwise)))


def _square(parts: list[Expression]) -> Expression:
    return Apply("mul", (as_integer(parts[0]), as_integer(parts[0])))


_MEANINGS: dict[str, tuple[int, int, Callable[[list[Expression]], Expression] | None]] = {
    **{name: (1, 1, _plain(name)) for name in ("neg", "abs")},
    **{name: (2, 2, _plain(name)) for name in ("sub", "div", "mod", "pow", "dist", "lt", "le", "gt", "ge")},
    **{name: (1, _MANY, _variadic(name)) for name in ("add", "mul", "min", "max")},
    "sqr": (1, 1, _square),
    "eq": (2, _MANY, _equal),
    "ne": (2, 2, _unequal),
    "not": (1, 1, lambda parts: Apply("not", (as_boolean(parts[0]),))),
    "and": (1, _MANY, lambda parts: conjunction([as_boolean(part) for part in parts])),
    "or": (1, _MANY, lambda parts: disjunction([as_boolean(part) for part in parts])),
    "xor": (1, _MANY, _exclusive),
    "iff": (2, _MANY, lambda parts: _equal([as_boolean(part) for part in parts])),
    "imp": (2, 2, lambda parts: disjunction([Apply("not", (as_boolean(parts[0]),)), as_boolean(parts[1])])),
    "if": (3, 3, _conditional),
}
"""The minimum and maximum number of arguments of each operator, and its translation."""


def _fold(operator: str, parts: list[Expression], nothing: Expression) -> Expression:
    if not parts:
        return nothing
    return parts[0] if len(parts) == 1 else Apply(operator, tuple(parts))


def _between(expression: Expression, low: int, high: int) -> Expression:
    if low == high:
        return compare("eq", expression, Constant(low))
    return conjunction([compare("ge", expression, Constant(low)), compare("le", expression, Constant(high))])


def _values(text: str, max_values: int) -> Iterable[int]:
    if text.startswith("{") and text.endswith("}"):
        return [integer(word.strip()) for word in text[1:-1].split(",") if word.strip()]
    values = span(text)
    if len(values) > max_values:
        raise MistakeError(
            f"the set {shortened(text)} has {len(values):,} values", f"write at most {max_values:,} values"
        )
    return values


def _tree(tokens: Sequence[str], place: int, depth: int, text: str) -> tuple[Tree, int]:
    if depth > MAX_DEPTH:
        raise MistakeError("an expression is nested too deeply", f"write at most {MAX_DEPTH} levels")
    if place >= len(tokens) or tokens[place] in "(),":
        raise _unreadable(text, tokens[place] if place < len(tokens) else "its end")
    word = tokens[place]
    place += 1
    if place >= len(tokens) or tokens[place] != "(":
        return Leaf(word), place
    arguments: list[Tree] = []
    place += 1
    if place < len(tokens) and tokens[place] == ")":
        return Call(word, ()), place + 1
    while True:
        argument, place = _tree(tokens, place, depth + 1, text)
        arguments.append(argument)
        if place >= len(tokens) or tokens[place] not in ",)":
            raise _unreadable(text, tokens[place] if place < len(tokens) else "its end")
        place += 1
        if tokens[place - 1] == ")":
            return Call(word, tuple(arguments)), place


def _unreadable(text: str, where: str) -> MistakeError:
    what = f"'{shortened(text)}' is not a valid expression: see '{shortened(where)}'"
    return MistakeError(what, "write operators, integers and names of variables: le(add(x,y[0]),10)")
