"""Reads the results of a study from its file."""

from __future__ import annotations

import math
import sqlite3
from collections.abc import Collection, Iterator
from contextlib import closing, suppress
from decimal import Decimal
from pathlib import Path
from typing import Any, NamedTuple

import msgspec

from robochoc.experiments.database import JSON, NUMBERS, STRANGE, TRIED_AGAIN, invalid, open_database
from robochoc.experiments.study import report_settings
from robochoc.experiments.task import KEY, Status
from robochoc.formats.diagnostics import shortened
from robochoc.system.plain_text import on_one_line

_MOST_DIGITS = 300
"""The most digits before and after the point. Floats and costs have no more; `1e999999999` would take for ever."""


class Results(NamedTuple):
    """The results of a study.

    Attributes:
        name: The name of the study's file, without the extension.
        title: The title of the study.
        text: The content of the study's file.
        stopped: The reason why the study was stopped, with commands that repeat the runs: two answers contradict each
            other, or the checker found an answer wrong. Empty: it was not stopped.
        planned: The number of all runs in the study, finished or not.
        rows: The finished runs, as `read` returns them.
    """

    name: str
    title: str
    text: str
    stopped: str
    planned: int
    rows: tuple[dict[str, Any], ...]


def read(path: Path | str) -> list[dict[str, Any]]:
    """Return the results of a study: a dictionary for each run, in the order of the study's file.

    Args:
        path: The SQLite file written by `robochoc experiment run`. The study may still be running.

    Returns:
        Rows for `pandas.DataFrame(rows)` or `polars.DataFrame(rows)`. The problem's parameters are columns with the
        parameters' names, preceded by `problem_` if another column has the same name.

    Raises:
        InvalidInputError: if the file contains no results of a study.
    """
    return list(read_results(Path(path)).rows)


def read_results(path: Path) -> Results:
    """Return the results of a study, and the study itself, which may still be running.

    Raises:
        InvalidInputError: if the file contains no results of a study.
    """
    with closing(open_database(path, writing=False)) as database:
        try:
            return results_of(database)
        except STRANGE as error:
            raise invalid(path, f"contains no results of a study: {on_one_line(str(error))}") from None


def journals(path: Path) -> Iterator[tuple[str, bytes]]:
    """Yield the keys and journals of the study's runs, if the study records journals.

    Raises:
        InvalidInputError: if the file contains no results of a study.
    """
    with closing(open_database(path, writing=False)) as database:
        try:
            found = "SELECT key, content FROM plan JOIN journals USING (key) ORDER BY position"
            yield from map(_journal, database.execute(found))
        except (sqlite3.Error, TypeError) as error:
            raise invalid(path, f"contains no results of a study: {error}") from None


def _journal(found: tuple[object, object]) -> tuple[str, bytes]:
    """Return a key and a journal. Raises `TypeError` if one is invalid, since the key becomes a file name."""
    key, content = found
    if isinstance(key, str) and KEY.fullmatch(key) and isinstance(content, bytes):
        return key, content
    raise TypeError(f"{shortened(str(key))} is not the key of a run, or has no journal")


def results_of(database: sqlite3.Connection) -> Results:
    """Return the results in an open database. Raises an exception in `STRANGE` for modified content."""
    found = database.execute("SELECT name, title, text, stopped FROM study").fetchone() or ("",) * 4
    if not all(isinstance(one, str) for one in found):
        raise TypeError("the study has no name")
    name, title, text, stopped = map(str, found)
    report_settings(text)  # raises if the text is not a study
    (planned,) = database.execute("SELECT count(*) FROM plan").fetchone()
    return Results(name, title, text, stopped, planned, tuple(_results(database)))


def finished_keys(path: Path, again: Collection[str] = ()) -> set[str]:
    """Return the keys of the finished runs that need not be repeated.

    Args:
        path: The file with the results.
        again: The statuses of runs to repeat, in addition to those that are always repeated.

    Raises:
        InvalidInputError: if the file contains no results of a study.
    """
    with closing(open_database(path, writing=False)) as database:
        try:
            found = database.execute("SELECT key, status FROM runs").fetchall()
        except sqlite3.Error as error:
            raise invalid(path, f"contains no results of a study: {error}") from None
    return {key for key, status in found if status not in {*TRIED_AGAIN, *again}}


def _results(database: sqlite3.Connection) -> Iterator[dict[str, Any]]:
    cursor = database.execute("SELECT * FROM results")
    names = [column[0] for column in cursor.description]
    for values in cursor:
        row = dict(zip(names, values, strict=True))
        parameters = msgspec.json.decode(row.pop("parameters"), type=dict[str, str | int | float | bool])
        row["status"] = str(Status(row["status"]))
        del row["task"], row["position"]
        settings = msgspec.json.decode(row["settings"], type=dict[str, str])
        row["settings"] = {name: _number(one) for name, one in settings.items()}
        for name, kind in JSON.items():
            row[name] = msgspec.json.decode(row[name], type=kind)
        row["cost_over_time"] = [[one.messages, one.ncccs, one.time, _exact(one.cost)] for one in row["cost_over_time"]]
        row["loads"] = [[one.robot, one.messages, one.bytes] for one in row["loads"]]
        for name in ("cost", "bound"):
            row[name] = None if row[name] is None else _exact(row[name])
        for name in ("maximises", "verified", "confirmed"):
            row[name] = bool(row[name])
        if strange := [name for name in NUMBERS if not _is_number(row[name])]:
            raise TypeError(f"{strange[0]} is not a number in run {row['key']}")
        yield {**{(f"problem_{name}" if name in row else name): value for name, value in parameters.items()}, **row}


def _is_number(value: object) -> bool:
    return value is None or (isinstance(value, (int, float)) and math.isfinite(value))


def _exact(text: str) -> int | float | Decimal:
    """Return the number in a text: an integer, a float if that is exact, otherwise a decimal."""
    exact = Decimal(text)
    if not exact.is_finite() or abs(exact.adjusted()) > _MOST_DIGITS:
        raise TypeError(f"{shortened(text)} is not a cost")
    if exact == int(exact):
        return int(exact)
    return float(text) if Decimal(repr(float(text))) == exact else exact


def _number(text: str) -> str | int | float:
    """Return the number in a text, or the text itself if it is not a number."""
    for kind in (int, float):
        with suppress(ValueError):
            return kind(text)
    return text
