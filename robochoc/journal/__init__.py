"""The events of a run, and the journal that records them."""

from __future__ import annotations

TYPE_CHECKING = False  # start-up: `typing` and the reader of journals are imported on first use
if TYPE_CHECKING:
    from robochoc.journal.as_rows import by_column, rows

__all__ = ["by_column", "rows"]


def __getattr__(name: str) -> object:
    """Import a function on first use."""
    if name in __all__:
        from robochoc.journal import as_rows  # noqa: PLC0415 - start-up

        return getattr(as_rows, name)
    raise AttributeError(f"module 'robochoc.journal' has no attribute {name!r}")
