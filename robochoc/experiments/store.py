"""Stores the results of a study in a SQLite file, one row per run. docs/guides/experiments.md describes the columns.

The table `runs` contains every finished run by its unique key. The table `plan` contains the runs of the study in the
study's order; the view `results` joins both. So after a change or an interruption only missing runs are executed, and
the results are the same as those of an uninterrupted study.
"""

from __future__ import annotations

import fcntl
import os
import sqlite3
from collections.abc import Collection, Iterable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from types import TracebackType
from typing import Any, Self

import msgspec

from robochoc.experiments.database import COLUMNS, JSON, STRANGE, TRIED_AGAIN, invalid, make_tables, open_database
from robochoc.experiments.results import Results, results_of
from robochoc.experiments.study import Study
from robochoc.experiments.task import GIVEN, Row, Status, Task
from robochoc.system.errors import RobochocError
from robochoc.system.plain_text import on_one_line


class StudyInUseError(RobochocError):
    """Another process is running this study."""


class Store:
    """The file with a study's results, opened for writing by at most one process.

    Args:
        path: The file, which is created if it does not exist. None: results are stored in memory.

    Raises:
        InvalidInputError: if the file was written by another program.
        StudyInUseError: if another process writes to the file.
        OSError: if the file cannot be created.
    """

    def __init__(self, path: Path | None) -> None:
        self._path = path
        self._lock = -1
        if path is None:
            self._database = sqlite3.connect(":memory:")
            make_tables(self._database)
            return
        # Closed after the database, since closing any descriptor of a file releases SQLite's locks on the file.
        self._lock = os.open(path, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o644)
        try:
            try:
                fcntl.flock(self._lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except BlockingIOError:
                raise StudyInUseError(f"{path} is being written to by another 'robochoc experiment run'") from None
            self._database = open_database(path)
        except BaseException:
            os.close(self._lock)
            raise

    def __enter__(self) -> Self:
        """Return self."""
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Close the file."""
        self._database.close()
        if self._lock >= 0:
            os.close(self._lock)

    def start(self, study: Study, plan: Mapping[str, Task], again: Collection[Status] = ()) -> set[str]:
        """Store the plan, and return the keys of the stored runs.

        Args:
            study: The study.
            plan: The study's runs.
            again: The statuses of runs to repeat, in addition to those that are always repeated.
        """
        rows = [_planned(place, key, task) for place, (key, task) in enumerate(plan.items(), 1)]
        with self._writing() as writing:
            writing.execute(
                "INSERT OR REPLACE INTO study VALUES (1, ?, ?, ?, '')", (study.name, study.title, study.text)
            )
            writing.execute("DELETE FROM plan")
            writing.executemany(f"INSERT INTO plan VALUES ({', '.join('?' * 16)})", rows)  # noqa: S608 - question marks
            ended = [*TRIED_AGAIN, *again]
            marks = ", ".join("?" * len(ended))
            writing.execute(f"DELETE FROM runs WHERE status IN ({marks})", ended)  # noqa: S608 - as above
            writing.execute("DELETE FROM journals WHERE key NOT IN (SELECT key FROM runs)")
        return {key for (key,) in self._database.execute("SELECT key FROM runs")}

    def add(self, rows: Iterable[tuple[str, Row]]) -> None:
        """Write rows of runs with their keys. Existing rows are not changed."""
        marks = ", ".join("?" * (1 + len(COLUMNS)))
        several = list(rows)
        journals = [(key, row.journal) for key, row in several if row.journal]
        with self._writing() as writing:
            writing.executemany("INSERT OR IGNORE INTO journals VALUES (?, ?)", journals)
            writing.executemany(
                f"INSERT OR IGNORE INTO runs VALUES ({marks})",  # noqa: S608 - question marks
                [(key, *(_stored(name, getattr(row, name)) for name in COLUMNS)) for key, row in several],
            )

    @contextmanager
    def _writing(self) -> Iterator[sqlite3.Connection]:
        """Commit all statements in the context, or none. Raises `InvalidInputError` if that is not possible."""
        try:
            with self._database as writing:
                yield writing
        except sqlite3.Error as error:
            raise invalid(self._path or Path("results"), f"cannot be written to: {error}") from None

    def mark_stopped(self, why: str) -> None:
        """Store the reason for stopping the study."""
        with self._writing() as writing:
            writing.execute("UPDATE study SET stopped = ?", (why,))

    def check_place(self) -> None:
        """Raise `InvalidInputError` if the file has been removed."""
        if self._path is not None and not self._path.exists():
            raise invalid(self._path, "was removed while it was written to; its results are lost", "run it again")

    def results(self) -> Results:
        """Return the results so far.

        Raises:
            InvalidInputError: if another program has modified the file.
        """
        try:
            return results_of(self._database)
        except STRANGE as error:
            text = f"contains no results of a study: {on_one_line(str(error))}"
            raise invalid(self._path or Path("results"), text) from None


def _planned(place: int, key: str, task: Task) -> tuple[Any, ...]:
    setup, problem = task.setup, task.problem
    scenario = {f"scenario_{name}": value for name, value in problem.scenario.items()}
    return (
        place, key, problem.group, setup.label, setup.protocol, msgspec.json.encode(setup.settings).decode(),
        setup.order or GIVEN, setup.schedule, setup.delay, setup.withdraw, setup.runtime,
        setup.channel and setup.channel.name, task.seed, task.repetition,
        msgspec.json.encode({**problem.parameters, **scenario}).decode(), msgspec.json.encode(task).decode(),
    )  # fmt: skip


def _stored(name: str, value: object) -> Any:  # noqa: ANN401 - what SQLite takes
    return msgspec.json.encode(value).decode() if name in JSON else str(value) if name == "status" else value
