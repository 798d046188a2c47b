"""Attributes for compiled modules (docs/explanation/design/development.md, "Compiled core"). Not compiled itself.

mypyc recognizes `mypyc_attr` by its module `mypy_extensions`. Users of robochoc do not need that package.
"""

from __future__ import annotations

import abc
from collections.abc import Callable
from typing import TYPE_CHECKING, TypeVar

T = TypeVar("T")

__all__ = ["answer_signals", "mypyc_attr", "separate_subclass_cache"]

if TYPE_CHECKING:
    from mypy_extensions import mypyc_attr
else:

    def mypyc_attr(**_: object) -> Callable[[T], T]:
        """Return a decorator without effect. Only mypyc reads its arguments."""
        return lambda decorated: decorated


def answer_signals() -> None:
    """Let Python run pending signal handlers: it does so when a function in plain Python, such as this one, starts."""


def separate_subclass_cache(kind: type) -> None:
    """Give a subclass of `ABC` its own cache for `issubclass`: a compiled class would share that of its base class."""
    if "_abc_impl" not in vars(kind):
        abc._abc_init(kind)  # type: ignore[attr-defined] # noqa: SLF001 - as `ABCMeta` does for a class of plain Python
