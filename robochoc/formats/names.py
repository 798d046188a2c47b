"""Rules for names and numbers in a robot's data (docs/reference/format.md, "One robot")."""

from __future__ import annotations

import re
from collections.abc import Collection

from robochoc.formats.diagnostics import MistakeError, shortened
from robochoc.model.problem import INFINITE

MAX_WEIGHT = 1_000_000
"""The maximum weight of a robot."""
BEYOND = 10**18
"""Integers have at most 18 digits."""
MAX_NAME = 251
"""The maximum length of a robot's name. With `.xml` it is a file name, and file systems allow no longer names."""
_WRITABLE = 2000
"""Python can always convert integers of up to 2000 bits to text; longer ones may exceed its limit."""
RESERVED = "scenario"
"""A name that no robot may have: `scenario.xml` contains the changes of a team."""

_NAME = re.compile(r"[A-Za-z][A-Za-z0-9_.]*")
_WORD = re.compile(r"[^ \t\r\n]+")
_NO_XML = re.compile("[\0-\x08\x0b\x0c\x0e-\x1f\ud800-\udfff\ufffe\uffff]")
"""Characters that XML does not allow."""


def is_name(word: str) -> bool:
    """Return whether `word` is a valid name for a robot or a variable."""
    return _NAME.fullmatch(word) is not None


def check_name(name: str) -> None:
    """Raise `MistakeError` unless `name` is a valid name for a variable or a neighbour."""
    if not is_name(name):
        hint = "expected a name: a letter, then letters, digits, '.' and '_'"
        raise MistakeError(f"the name '{shortened(name)}' is not allowed", hint)


def check_robot_name(name: str, hint: str = "rename it") -> None:
    """Raise `MistakeError` unless `name` is a valid name for a robot. `hint` is the suggestion to the user."""
    if not is_name(name) or name == RESERVED or len(name) > MAX_NAME:
        what = f"'{shortened(name)}' cannot be a robot's name"
        raise MistakeError(what, f"{hint}: a letter, then letters, digits, '.' and '_'")


def check_word(word: str) -> None:
    """Raise `MistakeError` unless `word` is a valid name for another part: a domain, a definition, a constraint."""
    if not _WORD.fullmatch(word) or _NO_XML.search(word):
        raise MistakeError(f"the name '{shortened(word)}' is not allowed", "expected a name without blanks")


def check_integer(value: int) -> None:
    """Raise `MistakeError` if `value` has more than 18 digits."""
    if not -BEYOND < value < BEYOND:
        raise MistakeError(f"an integer has {digits(value)} digits", "use at most 18 digits")


def check_cost(cost: float) -> None:
    """Raise `MistakeError` unless `cost` is an integer, or infinite."""
    if cost == INFINITE:
        return
    if not isinstance(cost, int):
        hint = "use integers in the unit of `Robot.costs`, or INFINITE to forbid, also when maximising"
        raise MistakeError(f"the cost {cost} is not an integer", hint)
    check_integer(cost)


def check_weight(weight: int) -> None:
    """Raise `MistakeError` unless `weight` is a valid weight of a robot."""
    if not 1 <= weight <= MAX_WEIGHT:
        hint = f"expected an integer from 1 to {MAX_WEIGHT}"
        raise MistakeError(f'weight="{in_short(weight)}" in <presentation> is not allowed', hint)


def check_unique(what: str, name: str, known: Collection[str]) -> None:
    """Raise `MistakeError` if `name` is already in `known`. `what` is the kind of the named part."""
    if name in known:
        raise MistakeError(f"a second {what} '{shortened(name)}'", "names are unique in a file: rename one of them")


def digits(value: int) -> int:
    """Return the number of digits in `value`; an estimate for very long integers, which Python does not print."""
    bits = value.bit_length()
    return len(str(abs(value))) if bits < _WRITABLE else int(bits * 0.30103) + 1


def in_short(term: str | int) -> str:
    """Return a name or an integer as text for a message. A long integer is replaced by its number of digits."""
    return term if isinstance(term, str) else str(term) if -BEYOND < term < BEYOND else f"({digits(term)} digits)"
