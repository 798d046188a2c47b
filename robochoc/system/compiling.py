"""Attributes for compiled modules (docs/explanation/design/development.md, "Compiled core"). It is not compiled itself.

mypyc knows `mypyc_attr` by its place in `mypy_extensions`. Users of robochoc do not need that package.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, TypeVar

T = TypeVar("T")

__all__ = ["answer_signals", "mypyc_attr"]

if TYPE_CHECKING:
    from mypy_extensions import mypyc_attr
else:

    def mypyc_attr(**_: object) -> Callable[[T], T]:
        """Return a decorator that does nothing: only mypyc reads what it is given."""
        return lambda decorated: decorated


def answer_signals() -> None:
    """Let Python run the handlers of signals: it does so where a function of plain Python begins, such as this one."""
