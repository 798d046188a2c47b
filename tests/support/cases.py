"""Many cases in one test: every failing case is named, not only the first."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import AbstractContextManager, ExitStack, contextmanager
from functools import wraps
from pathlib import Path
from typing import Any

import pytest

CASES_SHOWN = 20
NAME_LENGTH = 80


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

    try:
        yield each
    except pytest.skip.Exception:  # of one case: it hides no failure of those before it
        if not failures:
            raise
    assert count, "no case was tried"
    if failures:
        names = ", ".join(error.__notes__[-1].removeprefix("case: ") for error in failures[:CASES_SHOWN])
        message = f"{len(failures)} of {count} cases failed: {names}"
        raise ExceptionGroup(message, failures)


def looped(
    names: str | Sequence[str], rows: Iterable[Any] | Callable[[], Iterable[Any]]
) -> Callable[[Callable[..., None]], Callable[..., None]]:
    """Let one test try all rows of a table: `pytest.mark.parametrize` would make a test of each.

    Each row has an empty `tmp_path` and a `monkeypatch` of its own. Other fixtures are shared by the rows.

    Args:
        names: parameters of the test, each of which has a column. With a text, the values themselves are the rows.
        rows: the table, or a function that makes it when the test is run.
    """
    columns = (names,) if isinstance(names, str) else tuple(names)

    def decorate(test: Callable[..., None]) -> Callable[..., None]:
        signature = inspect.signature(test)

        @wraps(test)
        def run(**fixtures: object) -> None:
            table = rows() if callable(rows) else rows
            with cases() as each:
                for number, row in enumerate(table):
                    values = (row,) if isinstance(names, str) else row
                    with each(row_name(number, values)), own_fixtures(fixtures, number) as own:
                        test(**own, **dict(zip(columns, values, strict=True)))

        fixtures = [one for name, one in signature.parameters.items() if name not in columns]
        run.__signature__ = signature.replace(parameters=fixtures)  # type: ignore[attr-defined]
        return run

    return decorate


def row_name(number: int, values: Iterable[object]) -> str:
    """Return the number of a row and its first values."""
    return " ".join([str(number), *(_text(value) for value in values if not callable(value))])[:NAME_LENGTH]


def _text(value: object) -> str:
    try:
        return str(value)
    except ValueError:  # a number of thousands of digits
        return type(value).__name__


@contextmanager
def own_fixtures(fixtures: dict[str, Any], row: int) -> Iterator[dict[str, Any]]:
    """Yield the fixtures of one row."""
    with ExitStack() as stack:
        own = dict(fixtures)
        if isinstance(own.get("tmp_path"), Path):
            own["tmp_path"] = fixtures["tmp_path"] / str(row)
            own["tmp_path"].mkdir()
        if "monkeypatch" in own:
            own["monkeypatch"] = stack.enter_context(fixtures["monkeypatch"].context())
        yield own
