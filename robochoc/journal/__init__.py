"""The events of a run, and the journal that records them."""

from __future__ import annotations

from robochoc.system.lazy_names import lazy_names

TYPE_CHECKING = False  # start-up: `typing` and the reader of journals are imported on first use
if TYPE_CHECKING:
    from robochoc.journal.as_rows import by_column, rows
    from robochoc.journal.events import Observer
    from robochoc.journal.journal import Journal, JournalError, read_journal

__all__ = ["Journal", "JournalError", "Observer", "by_column", "read_journal", "rows"]

__getattr__, __dir__ = lazy_names(
    __name__,
    {
        "JournalError": "robochoc.journal.journal",
        "Observer": "robochoc.journal.events",
        "Journal": "robochoc.journal.journal",
        "by_column": "robochoc.journal.as_rows",
        "read_journal": "robochoc.journal.journal",
        "rows": "robochoc.journal.as_rows",
    },
)
