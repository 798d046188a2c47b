"""The SQLite database with a study's results: creates and opens it."""

from __future__ import annotations

import os
import sqlite3
from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any

import msgspec

from robochoc.experiments.task import CostPoint, RobotLoad, Status
from robochoc.formats.diagnostics import InvalidInputError, invalid_input

APPLICATION_ID = 0x726F626F
"""The `PRAGMA application_id` of SQLite files with results: `robo` in ASCII."""
VERSION = 4
COLUMNS: Mapping[str, str] = {
    "status": "TEXT", "reason": "TEXT", "team": "TEXT", "digest": "TEXT", "robots": "INTEGER", "variables": "INTEGER",
    "constraints": "INTEGER", "verdict": "TEXT", "cost": "TEXT", "bound": "TEXT", "maximises": "INTEGER",
    "withdrawn": "INTEGER", "verified": "INTEGER", "confirmed": "INTEGER", "messages": "INTEGER",
    "messages_by_type": "TEXT", "bytes": "INTEGER", "largest": "INTEGER", "ncccs": "INTEGER", "checks": "INTEGER",
    "simulated_s": "REAL", "cycles": "INTEGER", "wall_s": "REAL", "compile_s": "REAL", "total_s": "REAL",
    "cpu_s": "REAL", "memory": "INTEGER", "cost_over_time": "TEXT", "loads": "TEXT", "machine": "TEXT",
    "version": "TEXT", "removed": "INTEGER", "removing_messages": "INTEGER", "removing_ncccs": "INTEGER",
}  # fmt: skip
"""The columns of a row, and their SQL types."""
NUMBERS = [name for name, kind in COLUMNS.items() if kind != "TEXT"]
JSON: Mapping[str, Any] = {
    "messages_by_type": dict[str, int], "cost_over_time": list[CostPoint], "loads": list[RobotLoad],
}  # fmt: skip
_TABLES = f"""
CREATE TABLE IF NOT EXISTS study
    (id INTEGER PRIMARY KEY CHECK (id = 1), name TEXT, title TEXT, text TEXT, stopped TEXT);
CREATE TABLE IF NOT EXISTS runs (key TEXT PRIMARY KEY, {", ".join(f"{n} {t}" for n, t in COLUMNS.items())})
    WITHOUT ROWID;
CREATE TABLE IF NOT EXISTS journals (key TEXT PRIMARY KEY, content BLOB) WITHOUT ROWID;
CREATE TABLE IF NOT EXISTS plan (
    position INTEGER PRIMARY KEY, key TEXT UNIQUE, problems TEXT, label TEXT, protocol TEXT, settings TEXT,
    "order" TEXT, schedule TEXT, delay INTEGER, withdraw TEXT, runtime TEXT, channel TEXT, seed INTEGER,
    repetition INTEGER, parameters TEXT, task TEXT
);
CREATE VIEW IF NOT EXISTS results AS
    SELECT plan.*, {", ".join(f"runs.{name}" for name in COLUMNS)} FROM plan JOIN runs USING (key) ORDER BY position;
"""  # noqa: S608 - our own names

TRIED_AGAIN = (Status.CRASHED, Status.LOST, Status.INVALID, Status.ERROR)
"""The statuses of runs that are repeated when the study is run again, since their cause may be gone."""
STRANGE = (sqlite3.Error, msgspec.MsgspecError, TypeError, ValueError, KeyError, OverflowError, ArithmeticError)
"""The errors from reading a file that another program has modified."""


def open_database(path: Path, *, writing: bool = True) -> sqlite3.Connection:
    """Return the database at `path`. Raises `InvalidInputError`."""
    if not writing and not path.is_file():
        raise invalid(path, "is not a file")
    try:
        # With write access, SQLite removes the two additional files that it needs while a file is read.
        mode = "rwc" if writing else "rw" if os.access(path, os.W_OK) else "ro"
        address = f"{path.absolute().as_uri()}?mode={mode}"
        database = sqlite3.connect(address, uri=True, timeout=60)
        if mode == "ro" and not _is_readable(database):  # SQLite cannot create its additional files in the folder
            database.close()
            database = sqlite3.connect(f"{path.absolute().as_uri()}?immutable=1", uri=True)
        try:
            _check(database, path, writing=writing)
        except BaseException:
            database.close()
            raise
    except sqlite3.Error as error:
        raise invalid(path, f"contains no results of a study: {error}") from None
    return database


def _is_readable(database: sqlite3.Connection) -> bool:
    try:
        database.execute("SELECT count(*) FROM sqlite_master")
    except sqlite3.OperationalError:
        return False
    return True


def _check(database: sqlite3.Connection, path: Path, *, writing: bool) -> None:
    """Create the tables in a new file, and reject a file of another program."""
    (application,) = database.execute("PRAGMA application_id").fetchone()
    (tables,) = database.execute("SELECT count(*) FROM sqlite_master").fetchone()
    (version,) = database.execute("PRAGMA user_version").fetchone()
    if tables and (application != APPLICATION_ID or version != VERSION):
        raise invalid(path, "is a database, but not written by 'robochoc experiment run' of this version")
    if not tables:
        if not writing:
            raise invalid(path, "contains no results yet")
        database.execute("PRAGMA journal_mode = WAL")
        make_tables(database)
    if writing:
        database.execute("PRAGMA synchronous = NORMAL")
        with suppress(sqlite3.OperationalError):
            database.execute("PRAGMA wal_checkpoint")


def make_tables(database: sqlite3.Connection) -> None:
    """Create all tables, or none if the process is killed in between."""
    with database:
        database.execute("BEGIN IMMEDIATE")
        for statement in filter(str.strip, _TABLES.split(";\n")):
            database.execute(statement)
        database.execute(f"PRAGMA application_id = {APPLICATION_ID}")
        database.execute(f"PRAGMA user_version = {VERSION}")


def invalid(
    path: Path, message: str, hint: str = "give the file that 'robochoc experiment run' writes"
) -> InvalidInputError:
    """Return the error for an invalid file."""
    return invalid_input(path, message, hint)
