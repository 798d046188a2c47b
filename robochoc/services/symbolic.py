r"""Symbolic expressions, the syntax of FIPA messages (FIPA00070) and of their contents in SL (FIPA00008).

`(df-agent-description :name (agent-identifier :name "Robot3.1@host:7447/robochoc"))` is a list of words, strings and
lists. Reading takes linear time, does not recurse, and stops at the limits in `Caps`.

FIPA00070 has only one escape in strings, `\"`, so that no string could end in a backslash. Therefore `\\` is also an
escape, as in Lisp; other backslashes are literal.
"""

from __future__ import annotations

import re
from dataclasses import field
from typing import NamedTuple, assert_never

from robochoc.system.errors import RobochocError
from robochoc.system.lazy_dataclass import dataclass


class SymbolicExpressionError(RobochocError, ValueError):
    """The text is not an expression, or not the expected expression. `at` is the index of the character, from 0."""

    def __init__(self, message: str, at: int) -> None:
        super().__init__(message)
        self.at = at


class Caps(NamedTuple):
    """Limits for a text: the numbers of characters, of words and strings, and of lists, and the depth of lists."""

    characters: int
    expressions: int
    depth: int


@dataclass(frozen=True, slots=True)
class Word:
    """A name, a keyword such as `:name`, or a number; `at` is its index in the source text."""

    text: str
    at: int = field(default=0, compare=False)


@dataclass(frozen=True, slots=True)
class String:
    """The content of a quoted string, without the quotes."""

    text: str
    at: int = field(default=0, compare=False)


@dataclass(frozen=True, slots=True)
class List:
    """A list of items between parentheses."""

    items: tuple[Expression, ...]
    at: int = field(default=0, compare=False)


Expression = Word | String | List

_SPACE = re.compile(r"[\x00-\x20]*")
_WORD = re.compile(r'[^\x00-\x20()"]+')
_SIZE = re.compile(r'#([0-9]{1,9})"')
_STRING = re.compile(r'"([^"\\]*+(?:\\.[^"\\]*+)*+)"', re.DOTALL)
"""Matches a string. With possessive quantifiers, the match neither backtracks nor uses memory for each escape."""
_SAFE_NAME = re.compile(r"[A-Za-z_][A-Za-z0-9_.:@/+*!?<>=-]*")
_SHOWN = 40


def read(text: str, caps: Caps) -> Expression:
    """Parse `text`, which must be a single expression.

    Raises `SymbolicExpressionError` with the error and its position.
    """
    if (size := len(text)) > caps.characters:
        raise SymbolicExpressionError(f"{size} characters are too many: at most {caps.characters}", caps.characters)
    opened: list[tuple[int, list[Expression]]] = []
    count = 0
    at = _after_space(text, 0)
    while at < len(text):
        count += 1
        if count > caps.expressions:
            raise SymbolicExpressionError(f"more than {caps.expressions} words, strings and lists", at)
        if text[at] == "(":
            if len(opened) == caps.depth:
                raise SymbolicExpressionError(f"lists within lists deeper than {caps.depth}", at)
            opened.append((at, []))
            at = _after_space(text, at + 1)
            continue
        done, at = _closed(text, at, opened) if text[at] == ")" else _atom(text, at)
        at = _after_space(text, at)
        if opened:
            opened[-1][1].append(done)
        elif at < len(text):
            raise SymbolicExpressionError("text after the end of the expression", at)
        else:
            return done
    raise SymbolicExpressionError("the text ends before its expression does" if opened else "no expression", len(text))


def text_form(expression: Expression) -> str:
    """Return the text of `expression`, on one line except for line breaks in strings. `read` is the inverse.

    Raises `ValueError` for an invalid word.
    """
    match expression:
        case Word(text):
            if not _WORD.fullmatch(text):
                raise ValueError(f"{text!r} is not a valid word")
            return text
        case String(text):
            escaped = text.replace("\\", "\\\\").replace('"', '\\"')
            return f'"{escaped}"'
        case List(items):
            return f"({' '.join(map(text_form, items))})"
        case never:
            assert_never(never)


def name(text: str) -> Word | String:
    """Return `text` as a word if possible, otherwise as a string, since a word must not begin with a digit."""
    return Word(text) if _SAFE_NAME.fullmatch(text) else String(text)


def list_of(head: str, *items: Expression) -> List:
    """Return a list beginning with the word `head`."""
    return List((Word(head), *items))


def text_of(expression: Expression, what: str) -> str:
    """Return the text of a word or a string. Raises `SymbolicExpressionError`, which names the expression `what`."""
    if isinstance(expression, List):
        raise SymbolicExpressionError(f"{what} must be a word or a string, not a list", expression.at)
    return expression.text


def head_of(expression: Expression, what: str) -> str:
    """Return the first word of a list in lower case.

    Raises `SymbolicExpressionError` if there is no such word.
    """
    if not isinstance(expression, List) or not expression.items or not isinstance(expression.items[0], Word):
        raise SymbolicExpressionError(f"{what} must be a list that begins with a word", expression.at)
    return expression.items[0].text.lower()


def items_of(expression: Expression, heads: tuple[str, ...], what: str) -> tuple[Expression, ...]:
    """Return the rest of a list that begins with one of `heads`.

    Raises `SymbolicExpressionError` for any other expression.
    """
    head = head_of(expression, what)
    if head not in heads or not isinstance(expression, List):
        raise SymbolicExpressionError(
            f"{what} must begin with {' or '.join(heads)}, not with {_shown(head)}", expression.at
        )
    return expression.items[1:]


def parameters(items: tuple[Expression, ...], what: str) -> dict[str, Expression]:
    """Parse `:key value :key value ...`; returned keys are in lower case, without colons.

    Raises `SymbolicExpressionError`.
    """
    found: dict[str, Expression] = {}
    for key, value in zip(items[::2], items[1::2], strict=False):
        if not isinstance(key, Word) or not key.text.startswith(":"):
            raise SymbolicExpressionError(f"a parameter of {what} must begin with a colon", key.at)
        known = key.text[1:].lower()
        if known in found:
            raise SymbolicExpressionError(f"{what} has {_shown(key.text)} twice", key.at)
        found[known] = value
    if len(items) % 2:
        raise SymbolicExpressionError(f"the last parameter of {what} has no value", items[-1].at)
    return found


def _after_space(text: str, at: int) -> int:
    found = _SPACE.match(text, at)
    return found.end() if found else at


def _closed(text: str, at: int, opened: list[tuple[int, list[Expression]]]) -> tuple[List, int]:
    if not opened:
        raise SymbolicExpressionError(f"{text[at]} closes nothing", at)
    began, items = opened.pop()
    return List(tuple(items), began), at + 1


def _atom(text: str, at: int) -> tuple[Word | String, int]:
    """Return the word or string that begins at the index `at`, and the index of its end."""
    if text[at] == '"':
        return _string(text, at)
    if sized := _SIZE.match(text, at):
        return _sized_string(text, at, sized.end(), int(sized[1]))
    found = _WORD.match(text, at)
    if not found:
        raise SymbolicExpressionError("no expression begins here", at)
    return Word(found[0], at), found.end()


def _string(text: str, began: int) -> tuple[String, int]:
    found = _STRING.match(text, began)
    if not found:
        raise SymbolicExpressionError("a string is never closed", began)
    # Double backslashes are split first, so that the parts have no escaped backslashes.
    content = "\\".join(part.replace('\\"', '"') for part in found[1].split("\\\\"))
    return String(content, began), found.end()


def _sized_string(text: str, began: int, start: int, size: int) -> tuple[String, int]:
    """Return a string with a declared number of UTF-8 bytes (FIPA00070, ByteLengthEncodedString)."""
    content = text[start : start + size].encode("utf-8", "surrogatepass")[:size]
    try:
        decoded = content.decode()
    except UnicodeDecodeError:
        raise SymbolicExpressionError(f"{size} bytes are not complete characters of UTF-8", began) from None
    if len(content) < size:
        raise SymbolicExpressionError(f"a string must have {size} bytes, but the text ends before", began)
    return String(decoded, began), start + len(decoded)


def _shown(text: str) -> str:
    """Return a word, shortened for an error message."""
    return text if len(text) <= _SHOWN else f"{text[:_SHOWN]}..."
