"""The conversation of a run that is over, from its journal: for as long as somebody looks at it."""

from __future__ import annotations

from collections.abc import Callable

from robochoc.app.runs.options import JOURNAL
from robochoc.app.runs.prepared_team import from_run
from robochoc.app.runs.run import Run
from robochoc.app.runs.tape import Tape, recorded
from robochoc.formats import InvalidInputError
from robochoc.journal.entries import JournalError
from robochoc.modelling.errors import ModelError


def conversation_of(run: Run, wanted: Callable[[], bool] = lambda: True) -> Tape | None:
    """Return what was said in a run; None: it is not there (any more), or nobody waits for it.

    It takes a while: call it in a thread.
    """
    try:
        ready = from_run(run)
        tape = recorded(run.folder / JOURNAL, Tape(ready.robots, ready.label, ready.called), wanted)
    except (OSError, JournalError, ModelError, InvalidInputError, ValueError, TypeError, KeyError):
        return None
    return tape if tape.messages and wanted() else None
