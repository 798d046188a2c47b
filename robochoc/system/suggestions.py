"""Suggestions for misspelled names, and members of enums by their names."""

from __future__ import annotations

from collections.abc import Iterable
from enum import StrEnum
from typing import TypeVar

from robochoc.system.errors import OptionError

_Member = TypeVar("_Member", bound=StrEnum)


def did_you_mean(word: object, known: Iterable[object], fallback: str = "") -> str:
    """Return a hint with the known word most similar to `word`, or `fallback` if no word is similar."""
    import difflib  # noqa: PLC0415 - start-up: only needed for errors

    words = [str(one) for one in known]
    near = [one for one in words if one.endswith(f".{word}")] or difflib.get_close_matches(str(word), words, 1)
    if not near:
        folded = {one.lower(): one for one in words}
        near = [folded[one] for one in difflib.get_close_matches(str(word).lower(), folded, 1)]
    return f"did you mean {near[0]!r}?" if near else fallback


def member(choices: type[_Member], name: str, value: object) -> _Member:
    """Return the member of `choices` with this `value`. Otherwise raise `ValueError` with the most similar one."""
    try:
        return choices(value)  # type: ignore[arg-type]
    except ValueError:
        known = [str(one) for one in choices]
        hint = did_you_mean(value, known, f"expected {', '.join(known)}")
        raise OptionError(f"{name}={value!r} is not allowed; {hint}") from None
