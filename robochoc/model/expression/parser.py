"""Parse functional expressions: tokens, recursive descent, types."""

from __future__ import annotations

import itertools
import re
from collections.abc import Callable, Collection, Iterator, Sequence
from typing import NamedTuple

from robochoc.model.expression.operators import ALIASES, OPERATORS, Operator
from robochoc.model.expression.tree import DECIMAL, SYMBOLIC, Apply, Constant, Expression, Name, Type, text
from robochoc.system.errors import RobochocError
from robochoc.system.lazy_dataclass import dataclass

MAX_TEXT = 64 * 1024
MAX_DEPTH = 64
MAX_NODES = 10_000
MAX_DIGITS = 18


class ExpressionError(RobochocError, ValueError):
    """Raised for an invalid expression. It contains a message, the position (an offset in the text) and a hint."""

    def __init__(self, message: str, position: int, hint: str = "") -> None:
        super().__init__(f"{message}, at character {position + 1}" + (f" ({hint})" if hint else ""))
        self.message = message
        self.position = position
        self.hint = hint


@dataclass(frozen=True)
class SymbolNames:
    """The symbols that an expression may contain.

    Attributes:
        names: The names in the expression that are symbols.
        code: Returns the code of a symbol by its name. Raises `ValueError` with the reason for an invalid symbol.
    """

    names: Collection[str]
    code: Callable[[str], int]


def parse(
    text: str, names: Collection[str], wanted: Type, symbols: SymbolNames | None = None, *, decimals: bool = False
) -> Expression:
    """Parse a functional expression over `names`.

    This is the functional form of XCSP 2.1 with the extensions in Figure 2: an argument list in additional parentheses,
    infix `+ - *`, and `minus(i-j)` (docs/reference/format.md).

    Args:
        text: The text.
        names: The names that may occur in the expression.
        wanted: The type of the expression's value.
        symbols: The `names` that are symbols, if any; then other words, and words in quotes (`'red'`), are names
            of symbols. Only eq, ne and in compare symbols.
        decimals: True if decimals (`2.5`) are allowed. They become `DECIMAL` operators.

    Raises:
        ExpressionError: if the text is not a valid expression. It contains the position and a suggestion to the user.
    """
    if len(text) > MAX_TEXT:
        raise ExpressionError(
            f"the expression has {len(text)} characters", MAX_TEXT, f"use at most {MAX_TEXT}: split the predicate"
        )
    return _Parser(text, names, symbols, decimals=decimals).expression(wanted)


class _Token(NamedTuple):
    text: str
    position: int


class _Parsed(NamedTuple):
    """A parsed part of the text."""

    expression: Expression
    type: Type
    position: int
    depth: int = 1
    infix: str = ""
    """The sign if the part is an infix term outside parentheses."""
    operands: tuple[_Parsed, ...] = ()


_SIGNS = {
    "==": "eq",
    "=": "eq",
    "!=": "ne",
    "<>": "ne",
    "<=": "le",
    ">=": "ge",
    "<": "lt",
    ">": "gt",
    "&&": "and",
    "&": "and",
    "||": "or",
    "|": "or",
    "!": "not",
    "~": "not",
    "->": "imp",
    "=>": "imp",
    "<->": "iff",
    "<=>": "iff",
    "**": "pow",
    "^": "pow",
    "//": "div",
    "/": "div",
    "%": "mod",
}
"""The operators that other languages write with these signs."""
_SIGN = re.compile("|".join(re.escape(sign) for sign in sorted(_SIGNS, key=len, reverse=True)))
_TOKEN, _REAL_TOKEN = (
    re.compile(rf"\s*(?:([A-Za-z_][A-Za-z0-9_.]*|{number}|\*(?!\*)|-(?!>)|[+(),]|'[^'\s]+')|(\S))")
    for number in ("[0-9]+", r"[0-9]+(?:\.[0-9]+)?")
)
_INFIX = {operator.infix: name for name, operator in OPERATORS.items() if operator.infix and name != "dist"}


class _Parser:
    """Recursive descent: sum = product {+- product}; product = atom {* atom}; atom = integer, name, call or (sum)."""

    def __init__(
        self, text: str, names: Collection[str], symbols: SymbolNames | None = None, *, decimals: bool = False
    ) -> None:
        self._names = names
        self._symbols = symbols
        self._tokens = _tokens(text, _REAL_TOKEN if decimals else _TOKEN)
        self._closing = _parentheses(self._tokens)
        self._next = 0
        self._nodes = 0

    def expression(self, wanted: Type) -> Expression:
        parsed = self._sum(1)
        if self._peek().text == ",":
            raise ExpressionError("expected one expression, found a list", self._peek().position, "use and(..., ...)")
        if self._peek().text:
            raise ExpressionError(
                f"unexpected '{_shortened(self._peek().text)}' after the end of the expression",
                self._peek().position,
                _call_hint(self._peek().text) or "put an operator between the terms, or delete the rest",
            )
        _check_type(parsed, wanted, "the expression")
        return parsed.expression

    def _sum(self, level: int) -> _Parsed:
        left = self._product(level)
        while self._peek().text in {"+", "-"}:
            sign = self._advance()
            left = self._combined(sign, left, self._product(level))
        return left

    def _product(self, level: int) -> _Parsed:
        left = self._atom(level)
        while self._peek().text == "*":
            sign = self._advance()
            left = self._combined(sign, left, self._atom(level))
        return left

    def _combined(self, sign: _Token, left: _Parsed, right: _Parsed) -> _Parsed:
        for operand in (left, right):
            _check_type(operand, Type.INTEGER, f"an operand of '{sign.text}'")
        return self._applied(_INFIX[sign.text], (left, right), left.position)._replace(
            infix=sign.text, operands=(left, right)
        )

    def _atom(self, level: int) -> _Parsed:
        if level > MAX_DEPTH:
            raise _too_deep(self._peek().position)
        token = self._advance()
        if token.text == "(":
            return self._parenthesised(level)._replace(infix="", operands=(), position=token.position)
        if token.text == "-":
            return self._negative(token)
        if _is_number(token.text):
            return self._number(token, 1)
        if token.text in {"", ")", ",", "+", "*"}:
            what = f"'{token.text}'" if token.text else "the end"
            raise ExpressionError(f"expected a term, found {what}", token.position, "add an integer, a name or a call")
        if self._peek().text == "(":
            return self._set(token, level) if token.text == "set" else self._call(token, level)
        if self._symbols and token.text not in self._names:
            return self._symbol(token, self._symbols)
        if token.text not in self._names:
            known = f"known names: {_listed(self._names)}" if self._names else "no names are known here"
            hint = _call_hint(token.text) or _nearest(token.text, self._names) or known
            raise ExpressionError(f"unknown name '{_shortened(token.text)}'", token.position, hint)
        self._count(token.position)
        is_symbol = self._symbols is not None and token.text in self._symbols.names
        return _Parsed(Name(token.text), Type.SYMBOL if is_symbol else Type.INTEGER, token.position)

    def _symbol(self, token: _Token, symbols: SymbolNames) -> _Parsed:
        self._count(token.position)
        try:
            code = symbols.code(token.text.strip("'"))
        except ValueError as error:
            raise ExpressionError(str(error), token.position, _nearest(token.text, self._names)) from None
        return _Parsed(Constant(code), Type.SYMBOL, token.position)

    def _set(self, name: _Token, level: int) -> _Parsed:
        members = self._arguments(level)
        if not members:
            raise ExpressionError("the set has no members", name.position, "write set(1, 2)")
        for member in members[1:]:
            _check_type(member, members[0].type, "a member of the set")
        parsed = self._applied("in", members, name.position)
        return parsed._replace(type=Type.SET, operands=members)

    def _parenthesised(self, level: int) -> _Parsed:
        parsed = self._sum(level + 1)
        closing = self._advance()
        if closing.text == ",":
            raise ExpressionError(
                "expected one term in parentheses, found a list",
                closing.position,
                "extra parentheses are allowed only around all arguments of a function: and((a, b))",
            )
        if closing.text != ")":
            hint = _call_hint(closing.text) or "add ')'"
            raise ExpressionError(f"expected ')', found '{_shortened(closing.text)}'", closing.position, hint)
        return parsed

    def _negative(self, sign: _Token) -> _Parsed:
        if not _is_number(self._peek().text):
            raise ExpressionError("'-' must be followed by an integer", sign.position, "write neg(...)")
        return self._number(self._advance(), -1)._replace(position=sign.position)

    def _number(self, token: _Token, sign: int) -> _Parsed:
        whole, _, decimals = token.text.partition(".")
        if len(whole + decimals) > MAX_DIGITS:
            raise ExpressionError(
                f"an integer has {len(token.text)} digits", token.position, f"use at most {MAX_DIGITS} digits"
            )
        self._count(token.position)
        number: Expression = Constant(sign * int(whole + decimals))
        if decimals:
            number = Apply(DECIMAL, (number, Constant(len(decimals))))
        return _Parsed(number, Type.INTEGER, token.position)

    def _call(self, name: _Token, level: int) -> _Parsed:
        resolved = ALIASES.get(name.text, name.text)
        if resolved not in OPERATORS:
            known = [*OPERATORS, *ALIASES]
            hint = _nearest(name.text, known) or f"known operators: {' '.join(known)}"
            raise ExpressionError(f"unknown operator '{_shortened(name.text)}'", name.position, hint)
        operator = OPERATORS[resolved]
        arguments = self._arguments(level)
        if resolved == "in":
            return self._membership(name, arguments)
        if len(arguments) == 1 < len(operator.takes):
            arguments = _operands(name, operator, arguments[0])
        _check_arity(name, operator, len(arguments))
        wanted: Iterator[Type]
        if resolved in SYMBOLIC and any(argument.type == Type.SYMBOL for argument in arguments):
            wanted = itertools.repeat(Type.SYMBOL)
        else:
            wanted = itertools.chain(operator.takes, itertools.repeat(operator.takes[-1]))
        for number, (argument, type_) in enumerate(zip(arguments, wanted, strict=False), start=1):
            _check_type(argument, type_, f"argument {number} of '{name.text}'")
        return self._applied(resolved, arguments, name.position)

    def _membership(self, name: _Token, arguments: tuple[_Parsed, ...]) -> _Parsed:
        """Return `in(x, set(1, 2))`, with the members of the set as arguments."""
        if len(arguments) != 2:  # noqa: PLR2004 - a term and a set
            raise ExpressionError(f"'in' takes 2 arguments, not {len(arguments)}", name.position, "in(X, set(1, 2))")
        term, members = arguments
        _check_type(members, Type.SET, "argument 2 of 'in'")
        _check_type(term, members.operands[0].type, "argument 1 of 'in'")
        return self._applied("in", (term, *members.operands), name.position)

    def _arguments(self, level: int) -> tuple[_Parsed, ...]:
        """Return the arguments of a function. A second pair of parentheses around them is ignored."""
        closing = self._closing[self._next] + 1
        pairs = 0
        while self._closing.get(self._next) == closing - 1:
            closing -= 1
            self._next += 1
            pairs += 1
        arguments = []
        if self._peek().text != ")":
            arguments.append(self._sum(level + 1))
        while self._peek().text == ",":
            self._next += 1
            arguments.append(self._sum(level + 1))
        for _ in range(pairs):
            token = self._advance()
            if token.text != ")":
                raise ExpressionError(
                    f"expected ',' or ')', found '{_shortened(token.text)}'",
                    token.position,
                    _call_hint(token.text) or "separate arguments by ','",
                )
        return tuple(arguments)

    def _applied(self, operator: str, arguments: tuple[_Parsed, ...], position: int) -> _Parsed:
        depth = 1 + max(argument.depth for argument in arguments)
        if depth > MAX_DEPTH:
            raise _too_deep(position)
        self._count(position)
        expression = Apply(operator, tuple(argument.expression for argument in arguments))
        return _Parsed(expression, OPERATORS[operator].gives, position, depth)

    def _count(self, position: int) -> None:
        self._nodes += 1
        if self._nodes > MAX_NODES:
            raise ExpressionError(
                "the expression is too long",
                position,
                f"use at most {MAX_NODES} operators and terms: split the predicate",
            )

    def _peek(self) -> _Token:
        return self._tokens[self._next]

    def _advance(self) -> _Token:
        token = self._tokens[self._next]
        if token.text:
            self._next += 1
        return token


def _is_number(token: str) -> bool:
    return token[:1].isdecimal()


def _tokens(text: str, pattern: re.Pattern[str]) -> list[_Token]:
    """Return the tokens of `text`; the last one is empty and marks the end."""
    tokens = []
    for match in pattern.finditer(text):
        if match[2]:
            position = match.start(2)
            sign = _SIGN.match(text, position)
            if sign:
                raise ExpressionError(f"unknown sign '{sign[0]}'", position, _call_hint(_SIGNS[sign[0]]))
            numbers = "integers" if pattern is _TOKEN else "decimals such as 0.5"
            raise ExpressionError(
                f"unexpected character {match[2]!r}",
                position,
                f"expressions are made of names, {numbers} and ( ) , + - *",
            )
        tokens.append(_Token(match[1], match.start(1)))
    return [*tokens, _Token("", len(text))]


def _parentheses(tokens: Sequence[_Token]) -> dict[int, int]:
    """Return the index of the closing token for the index of each opening parenthesis."""
    closing: dict[int, int] = {}
    opened: list[int] = []
    for index, token in enumerate(tokens):
        if token.text == "(":
            opened.append(index)
        elif token.text == ")":
            if not opened:
                raise ExpressionError("')' has no matching '('", token.position, "delete it, or add '('")
            closing[opened.pop()] = index
    if opened:
        raise ExpressionError("'(' has no matching ')'", tokens[opened[-1]].position, "add the missing ')'")
    return closing


def _operands(name: _Token, operator: Operator, only: _Parsed) -> tuple[_Parsed, ...]:
    """Return the two arguments of a function whose only argument is an infix term: `minus(i-j)`."""
    if only.infix and only.infix == operator.infix:
        return only.operands
    shown = _shortened(text(only.expression))
    raise ExpressionError(
        f"'{name.text}' takes {_takes(operator)}, not 1", name.position, f"write {name.text}({shown}, ...)"
    )


def _check_arity(name: _Token, operator: Operator, given: int) -> None:
    enough = given >= len(operator.takes) if operator.variadic else given == len(operator.takes)
    if not enough:
        arguments = ", ".join("abc"[: len(operator.takes)])
        raise ExpressionError(
            f"'{name.text}' takes {_takes(operator)}, not {given}", name.position, f"write {name.text}({arguments})"
        )


def _takes(operator: Operator) -> str:
    number = len(operator.takes)
    return f"{number} argument{'s' * (number > 1)}{' or more' * operator.variadic}"


def _check_type(parsed: _Parsed, wanted: Type, what: str) -> None:
    if parsed.type is wanted:
        return
    hint = _TYPE_HINTS.get((wanted, parsed.type), "compare it: eq ne lt le gt ge")
    shown = _shortened(text(parsed.expression))
    raise ExpressionError(f"{what} must be {wanted}, but '{shown}' is {parsed.type}", parsed.position, hint)


_TYPE_HINTS = {
    (Type.INTEGER, Type.BOOLEAN): "convert it to a number: if(..., 1, 0)",
    (Type.INTEGER, Type.SYMBOL): "only eq, ne and in accept symbols",
    (Type.BOOLEAN, Type.SYMBOL): "compare it: eq ne in",
    (Type.SYMBOL, Type.INTEGER): "compare symbols with symbols",
    (Type.SYMBOL, Type.BOOLEAN): "compare symbols with symbols",
    **{(Type.SET, other): "write in(X, set(1, 2))" for other in Type},
    **{(other, Type.SET): "use a set only in in(X, set(1, 2))" for other in Type},
}


def _too_deep(position: int) -> ExpressionError:
    hint = f"use at most {MAX_DEPTH} levels; write a long sum as add(a, b, ...)"
    return ExpressionError("the expression is nested too deeply", position, hint)


def _call_hint(name: str) -> str:
    """Return how to write a call of the operator `name`: "write ne(X, Y)"; empty if there is no such operator."""
    operator = OPERATORS.get(ALIASES.get(name, name))
    if operator is None:
        return ""
    if name == "in":
        return "write in(X, set(1, 2))"
    letters = ("AB" if type_ == Type.BOOLEAN else "XY" for type_ in operator.takes[:2])
    arguments = ", ".join(pair[place] for place, pair in enumerate(letters))
    return f"write {name}({arguments}{', ...' * (len(operator.takes) > 2)})"  # noqa: PLR2004 - letters


def _nearest(word: str, known: Collection[str]) -> str:
    import difflib  # noqa: PLC0415 - start-up: only mistakes need it

    close = difflib.get_close_matches(word[:32], list(itertools.islice(known, 100)), n=1)
    return f"did you mean '{close[0]}'?" if close else ""


def _listed(known: Collection[str]) -> str:
    return _shortened(" ".join(itertools.islice(known, 20)))


def _shortened(text: str) -> str:
    return text if len(text) <= 40 else f"{text[:37]}..."  # noqa: PLR2004 - characters of a message
