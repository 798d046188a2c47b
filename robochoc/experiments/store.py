"""What came of a study: one SQLite file, one row a run. docs/guides/experiments.md describes its tables.

The table `runs` has every run that was ever made, by its key: a run is never there twice. The table `plan` has the runs
of the study as it is now, in its order; the view `results` is both together. So a study that is changed, or was broken
off, runs what is new, and its results are the same as if it had been run in one go.
"""

from __future__ import annotations

import fcntl
import os
import sqlite3
from collections.abc import Iterable, Iterator, Mapping
from contextlib import closing, contextmanager, suppress
from pathlib import Path
from types import NoneType, TracebackType
from typing import Any, NamedTuple, Self

import msgspec

from robochoc.experiments.study import Study
from robochoc.experiments.task import GIVEN, KEY, Row, Status, Task
from robochoc.formats.diagnostics import Diagnostic, InvalidInputError, encodable, shortened

APPLICATION_ID = 0x726F626F
"""What marks the file as one of ours (SQLite, `PRAGMA application_id`): `robo`."""
VERSION = 2
_COLUMNS: Mapping[str, str] = {
    "status": "TEXT", "reason": "TEXT", "team": "TEXT", "digest": "TEXT", "robots": "INTEGER", "variables": "INTEGER",
    "constraints": "INTEGER", "verdict": "TEXT", "cost": "NUMERIC", "bound": "NUMERIC", "maximises": "INTEGER",
    "withdrawn": "INTEGER", "verified": "INTEGER", "confirmed": "INTEGER", "messages": "INTEGER",
    "messages_by_type": "TEXT", "bytes": "INTEGER", "largest": "INTEGER", "ncccs": "INTEGER", "checks": "INTEGER",
    "simulated_s": "REAL", "cycles": "INTEGER", "wall_s": "REAL", "compile_s": "REAL", "total_s": "REAL",
    "cpu_s": "REAL", "memory": "INTEGER", "cost_over_time": "TEXT", "loads": "TEXT", "machine": "TEXT",
    "version": "TEXT",
}  # fmt: skip
"""The columns of a row, and their types."""
_NUMBERS = [name for name, kind in _COLUMNS.items() if kind != "TEXT"]
_JSON = ("messages_by_type", "cost_over_time", "loads")
_TABLES = f"""
CREATE TABLE IF NOT EXISTS study (id INTEGER PRIMARY KEY CHECK (id = 1), name TEXT, title TEXT, text TEXT);
CREATE TABLE IF NOT EXISTS runs (key TEXT PRIMARY KEY, {", ".join(f"{n} {t}" for n, t in _COLUMNS.items())})
    WITHOUT ROWID;
CREATE TABLE IF NOT EXISTS journals (key TEXT PRIMARY KEY, content BLOB) WITHOUT ROWID;
CREATE TABLE IF NOT EXISTS plan (
    position INTEGER PRIMARY KEY, key TEXT UNIQUE, problems TEXT, label TEXT, protocol TEXT, settings TEXT,
    "order" TEXT, schedule TEXT, delay INTEGER, withdraw TEXT, runtime TEXT, channel TEXT, seed INTEGER,
    repetition INTEGER, parameters TEXT, task TEXT
);
CREATE VIEW IF NOT EXISTS results AS
    SELECT plan.*, {", ".join(f"runs.{name}" for name in _COLUMNS)} FROM plan JOIN runs USING (key) ORDER BY position;
"""  # noqa: S608 - our own names
TRIED_AGAIN = (Status.CRASHED, Status.LOST)
"""Runs that ended so are repeated when the study is run again: what was wrong may have been the machine."""


class Results(NamedTuple):
    """The results of a study.

    Attributes:
        name: The name of the study's file, without the ending.
        title: What the study is called.
        text: The study's file.
        planned: How many runs it has, made or not.
        rows: Those that were made, as `read` returns them.
    """

    name: str
    title: str
    text: str
    planned: int
    rows: tuple[dict[str, Any], ...]


class StudyInUseError(Exception):
    """Another process carries out this study."""


class Store:
    """The file of a study's results, opened for writing. One process may have it open so.

    Args:
        path: The file. It is made if it does not exist. None: results are kept in memory.

    Raises:
        InvalidInputError: if the file is none of ours.
        StudyInUseError: if another process writes to it.
        OSError: if it cannot be made.
    """

    def __init__(self, path: Path | None) -> None:
        self._path = path
        self._lock = -1
        if path is None:
            self._database = sqlite3.connect(":memory:")
            _make_tables(self._database)
            return
        # Closed after the database: to close any descriptor of a file drops SQLite's own locks on it.
        self._lock = os.open(path, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o644)
        try:
            try:
                fcntl.flock(self._lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except BlockingIOError:
                raise StudyInUseError(f"{path} is being written to by another 'robochoc experiment run'") from None
            self._database = _opened(path)
        except BaseException:
            os.close(self._lock)
            raise

    def __enter__(self) -> Self:
        """Return itself."""
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Close the file."""
        self._database.close()
        if self._lock >= 0:
            os.close(self._lock)

    def begin(self, study: Study, plan: Mapping[str, Task]) -> set[str]:
        """Set the plan, and return the keys of the runs that are there already."""
        rows = [_planned(place, key, task) for place, (key, task) in enumerate(plan.items(), 1)]
        with self._writing() as writing:
            writing.execute("INSERT OR REPLACE INTO study VALUES (1, ?, ?, ?)", (study.name, study.title, study.text))
            writing.execute("DELETE FROM plan")
            writing.executemany(f"INSERT INTO plan VALUES ({', '.join('?' * 16)})", rows)  # noqa: S608 - question marks
            again = ", ".join("?" * len(TRIED_AGAIN))
            writing.execute(f"DELETE FROM runs WHERE status IN ({again})", TRIED_AGAIN)  # noqa: S608 - as above
        return {key for (key,) in self._database.execute("SELECT key FROM runs")}

    def add(self, rows: Iterable[tuple[str, Row]]) -> None:
        """Write the rows of runs, by their keys. One that is there already stays."""
        marks = ", ".join("?" * (1 + len(_COLUMNS)))
        several = list(rows)
        journals = [(key, row.journal) for key, row in several if row.journal]
        with self._writing() as writing:
            writing.executemany("INSERT OR IGNORE INTO journals VALUES (?, ?)", journals)
            writing.executemany(
                f"INSERT OR IGNORE INTO runs VALUES ({marks})",  # noqa: S608 - question marks
                [(key, *(_stored(name, getattr(row, name)) for name in _COLUMNS)) for key, row in several],
            )

    @contextmanager
    def _writing(self) -> Iterator[sqlite3.Connection]:
        """Write all that is written within, or nothing. Raises `InvalidInputError` where that is not possible."""
        try:
            with self._database as writing:
                yield writing
        except sqlite3.Error as error:
            raise _invalid(self._path or Path("results"), f"cannot be written to: {error}") from None

    def results(self) -> Results:
        """Return the results so far."""
        return _read(self._database)


def read(path: Path | str) -> list[dict[str, Any]]:
    """Return the results of a study: one dictionary a run, in the order of the study's file.

    Args:
        path: The SQLite file that `robochoc experiment run` writes; it may be running.

    Returns:
        Rows for `pandas.DataFrame(rows)` or `polars.DataFrame(rows)`. The problem's parameters have columns of their
        own names; those that others have, too, begin with `problem_`.

    Raises:
        InvalidInputError: if the file holds no results of a study.
    """
    return list(read_results(Path(path)).rows)


def read_results(path: Path) -> Results:
    """Return the results of a study with the study itself; it may be running.

    Raises:
        InvalidInputError: if the file holds no results of a study.
    """
    with closing(_opened(path, writing=False)) as database:
        try:
            return _read(database)
        except (sqlite3.Error, msgspec.MsgspecError, TypeError) as error:
            raise _invalid(path, f"holds no results of a study: {error}") from None


def journals(path: Path) -> Iterator[tuple[str, bytes]]:
    """Yield the journals of the study's runs, by their keys, where the study records them.

    Raises:
        InvalidInputError: if the file holds no results of a study.
    """
    with closing(_opened(path, writing=False)) as database:
        try:
            found = "SELECT key, content FROM plan JOIN journals USING (key) ORDER BY position"
            yield from map(_journal, database.execute(found))
        except (sqlite3.Error, TypeError) as error:
            raise _invalid(path, f"holds no results of a study: {error}") from None


def _journal(found: tuple[object, object]) -> tuple[str, bytes]:
    """Return a key and a journal. Raises `TypeError`: the key will be the name of a file."""
    key, content = found
    if isinstance(key, str) and KEY.fullmatch(key) and isinstance(content, bytes):
        return key, content
    raise TypeError(f"{shortened(str(key))} is no key of a run, or has no journal")


def _read(database: sqlite3.Connection) -> Results:
    name, title, text = database.execute("SELECT name, title, text FROM study").fetchone() or ("", "", "")
    (planned,) = database.execute("SELECT count(*) FROM plan").fetchone()
    return Results(name, title, text, planned, tuple(_results(database)))


def _results(database: sqlite3.Connection) -> Iterator[dict[str, Any]]:
    cursor = database.execute("SELECT * FROM results")
    names = [column[0] for column in cursor.description]
    for values in cursor:
        row = dict(zip(names, values, strict=True))
        parameters = msgspec.json.decode(row.pop("parameters"), type=dict[str, str | int | float | bool])
        del row["task"], row["position"]
        for name in ("settings", *_JSON):
            row[name] = msgspec.json.decode(row[name])
        for name in ("maximises", "verified", "confirmed"):
            row[name] = bool(row[name])
        if strange := [name for name in _NUMBERS if not isinstance(row[name], (int, float, NoneType))]:
            raise TypeError(f"{strange[0]} is no number in run {row['key']}")
        yield {**{(f"problem_{name}" if name in row else name): value for name, value in parameters.items()}, **row}


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
    return msgspec.json.encode(value).decode() if name in _JSON else str(value) if name == "status" else value


def _opened(path: Path, *, writing: bool = True) -> sqlite3.Connection:
    """Return the database at `path`. Raises `InvalidInputError`."""
    if not writing and not path.is_file():
        raise _invalid(path, "is no file")
    try:
        # A reader that may write tidies up behind itself: SQLite keeps two files beside one that is being read.
        mode = "rwc" if writing else "rw" if os.access(path, os.W_OK) else "ro"
        address = f"{path.absolute().as_uri()}?mode={mode}"
        database = sqlite3.connect(address, uri=True, timeout=60)
        try:
            _check(database, path, writing=writing)
        except BaseException:
            database.close()
            raise
    except sqlite3.Error as error:
        raise _invalid(path, f"holds no results of a study: {error}") from None
    return database


def _check(database: sqlite3.Connection, path: Path, *, writing: bool) -> None:
    """Make the tables of a new file, and refuse one that is none of ours."""
    (application,) = database.execute("PRAGMA application_id").fetchone()
    (tables,) = database.execute("SELECT count(*) FROM sqlite_master").fetchone()
    (version,) = database.execute("PRAGMA user_version").fetchone()
    if tables and (application != APPLICATION_ID or version != VERSION):
        raise _invalid(path, "is a database, but none of 'robochoc experiment run' of this version")
    if not tables:
        if not writing:
            raise _invalid(path, "holds no results yet")
        database.execute("PRAGMA journal_mode = WAL")
        _make_tables(database)
    if writing:
        database.execute("PRAGMA synchronous = NORMAL")
        with suppress(sqlite3.OperationalError):
            database.execute("PRAGMA wal_checkpoint")


def _make_tables(database: sqlite3.Connection) -> None:
    """Make all tables, or none if the process is killed meanwhile."""
    with database:
        database.execute("BEGIN IMMEDIATE")
        for statement in filter(str.strip, _TABLES.split(";\n")):
            database.execute(statement)
        database.execute(f"PRAGMA application_id = {APPLICATION_ID}")
        database.execute(f"PRAGMA user_version = {VERSION}")


def _invalid(path: Path, message: str) -> InvalidInputError:
    hint = "name the file that 'robochoc experiment run' writes"
    return InvalidInputError([Diagnostic(encodable(str(path)), 0, message, hint)])
