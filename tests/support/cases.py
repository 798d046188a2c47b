"""Many cases in one test: every failing case is named, not only the first."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager

import pytest

CASES_SHOWN = 20


@contextmanager
def cases() -> Iterator[Callable[[object], AbstractContextManager[None]]]:
    """Yield `each`: `with each(name): ...` is one case. Raise the failures of all cases together at the end.

    Raises:
        ExceptionGroup: one exception for each failed case, with the name of the case as a note.
    """
    failures: list[Exception] = []
    count = 0

    @contextmanager
    def each(name: object) -> Iterator[None]:
        nonlocal count
        count += 1
        try:
            yield
        except (Exception, pytest.fail.Exception) as failure:  # noqa: BLE001 - raised at the end
            error = failure if isinstance(failure, Exception) else AssertionError(str(failure))
            error.add_note(f"case: {name}")
            failures.append(error)

    yield each
    assert count, "no case was tried"
    if failures:
        names = ", ".join(error.__notes__[-1].removeprefix("case: ") for error in failures[:CASES_SHOWN])
        message = f"{len(failures)} of {count} cases failed: {names}"
        raise ExceptionGroup(message, failures)
