"""Warnings about deprecated names. The policy is in docs/reference/stability.md."""

from __future__ import annotations

import functools
import warnings
from collections.abc import Callable
from typing import ParamSpec, TypeVar

P = ParamSpec("P")
R = TypeVar("R")


def warn_deprecated(old: str, instead: str, removed_in: str, stacklevel: int = 3) -> None:
    """Warn about a deprecated name or value.

    Args:
        old: The name or value, as written by users.
        instead: Its replacement.
        removed_in: The version in which the name is removed.
        stacklevel: As in `warnings.warn`: 3 is the caller of the function that calls this function.
    """
    text = f"{old} is deprecated and will be removed in robochoc {removed_in}; use {instead}"
    warnings.warn(text, DeprecationWarning, stacklevel=stacklevel)


def deprecated(instead: str, removed_in: str) -> Callable[[Callable[P, R]], Callable[P, R]]:
    """Return a decorator for a deprecated function or method. For the arguments see `warn_deprecated`."""

    def decorate(function: Callable[P, R]) -> Callable[P, R]:
        @functools.wraps(function)
        def call(*args: P.args, **kwargs: P.kwargs) -> R:
            warn_deprecated(f"{function.__qualname__}()", instead, removed_in)
            return function(*args, **kwargs)

        return call

    return decorate
