"""Suggestions for mistyped names."""

from __future__ import annotations

from collections.abc import Iterable


def did_you_mean(word: object, known: Iterable[object], fallback: str = "") -> str:
    """Return a hint that names the known word nearest to `word`; if none is near, `fallback`."""
    import difflib  # noqa: PLC0415 - start-up: only mistakes need it

    words = [str(one) for one in known]
    near = [one for one in words if one.endswith(f".{word}")] or difflib.get_close_matches(str(word), words, 1)
    if not near:
        folded = {one.lower(): one for one in words}
        near = [folded[one] for one in difflib.get_close_matches(str(word).lower(), folded, 1)]
    return f"did you mean {near[0]!r}?" if near else fallback
