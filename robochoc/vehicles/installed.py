"""Looks for a library without importing it: only the guard's process imports it, not the one that starts the guard."""

from __future__ import annotations

import importlib.util


def require(library: str) -> None:
    """Raise `ModuleNotFoundError` where `library` is not installed."""
    if importlib.util.find_spec(library) is None:
        raise ModuleNotFoundError(f"No module named {library!r}", name=library)
