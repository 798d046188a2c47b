"""Events of a run and the journal that keeps them: what happened, from which everything else is computed."""

from __future__ import annotations

TYPE_CHECKING = False  # start-up: `typing` and what reads journals are imported when they are asked for
if TYPE_CHECKING:
    from robochoc.journal.as_rows import by_column, rows

__all__ = ["by_column", "rows"]


def __getattr__(name: str) -> object:
    """Import what is asked for."""
    if name in __all__:
        from robochoc.journal import as_rows  # noqa: PLC0415 - start-up

        return getattr(as_rows, name)
    raise AttributeError(f"module 'robochoc.journal' has no attribute {name!r}")
