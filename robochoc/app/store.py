"""Stores teams on disk: each team is a folder with its sketch, and is saved atomically.

FOLDER/ID/history.json    the sketch, with undo and redo steps
FOLDER/ID/team/           the files of an imported team; foreign.json: the facts about it
FOLDER/ID/runs/           runs and flights
FOLDER/.removed-...       a team that is being removed
FOLDER/.new-...           a team that is being written
FOLDER/.lock              locked by the application that has opened the folder
"""

from __future__ import annotations

import fcntl
import os
import secrets
import shutil
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import TypeVar

import msgspec

from robochoc.app.imported.facts import ImportedFacts, facts_of
from robochoc.app.imported.picture import picture_sketch
from robochoc.app.sketch.element_checks import is_sound
from robochoc.app.sketch.history import History
from robochoc.app.sketch.open_from_disk import ImportedTeam
from robochoc.app.sketch.sketch import Sketch
from robochoc.formats import InvalidInputError, read_team
from robochoc.system.errors import RobochocError

_HISTORY = "history.json"
FILES = "team"
"""The folder with an imported team's files."""
_FACTS = "foreign.json"
_LOCK = ".lock"
_REMOVED = ".removed-"
_NEW = ".new-"
_ID_BYTES = 6
MAX_BYTES = 64 << 20
"""The maximum size of a file in bytes. Of a larger history, fewer undo steps are saved."""


class InUseError(RobochocError, OSError):
    """Another application has opened the folder."""


class _Now(msgspec.Struct):
    """The part of a history that the gallery needs."""

    now: Sketch


_Read = TypeVar("_Read", History, _Now)


class TeamStore:
    """The teams in `folder`, which is created if it does not exist."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder = folder.absolute()  # the processes of jobs have other working directories
        folder.mkdir(parents=True, exist_ok=True, mode=0o700)

    @contextmanager
    def locked(self) -> Iterator[None]:
        """Lock the folder, since two applications would overwrite each other's edits.

        The kernel releases the lock when the process ends.

        Raises:
            InUseError: if another application has locked the folder.
        """
        lock = os.open(self.folder / _LOCK, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o600)
        try:
            try:
                fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except BlockingIOError:
                why = "use its page, end it, or choose another folder with --folder"
                raise InUseError(f"{self.folder} is open in another 'robochoc app': {why}") from None
            self._sweep(_NEW)
            yield
        finally:
            os.close(lock)

    def ids(self) -> list[str]:
        """Return the ids of the teams, the most recently changed first."""
        found: list[tuple[int, str]] = []
        for file in self.folder.glob(f"*/{_HISTORY}"):
            with suppress(OSError, KeyError):  # the team is being removed, or the folder is not a team
                self.path(file.parent.name)
                found.append((file.stat().st_mtime_ns, file.parent.name))
        return [name for _, name in sorted(found, reverse=True)]

    def add(self, sketch: Sketch) -> str:
        """Save a sketch as a new team, and return its id."""
        with self._new_team() as (name, folder):
            _write(folder / _HISTORY, History(sketch))
        return name

    @contextmanager
    def _new_team(self) -> Iterator[tuple[str, Path]]:
        """Yield the id of a new team, and a folder for its files. The team exists once the files are complete."""
        name = secrets.token_hex(_ID_BYTES)
        while (self.folder / name).exists():
            name = secrets.token_hex(_ID_BYTES)
        folder = self.folder / f"{_NEW}{name}"
        folder.mkdir(mode=0o700)
        try:
            yield name, folder
            folder.rename(self.folder / name)
        except BaseException:
            shutil.rmtree(folder, ignore_errors=True)
            raise

    def import_folder(self, name: str) -> Path | None:
        """Return the files of an imported team, or None if it was drawn here. Raises `KeyError` for an invalid id."""
        files = self.path(name) / FILES
        return files if files.is_dir() else None

    def add_imported(self, team: ImportedTeam) -> str:
        """Save an imported team, and return its id."""
        facts = facts_of(team.team, files=team.changed, notes=team.notes, origin=team.path.name)
        with self._new_team() as (name, folder):
            _write(folder / _HISTORY, History(picture_sketch(team)))
            team.save(folder / FILES)
            (folder / _FACTS).write_bytes(msgspec.json.encode(facts))
        return name

    def facts(self, name: str) -> ImportedFacts:
        """Return the facts about an imported team.

        Raises:
            KeyError: if the id is not valid.
            ValueError: if the team's files are damaged.
        """
        file = self.path(name) / _FACTS
        try:
            if file.stat().st_size <= MAX_BYTES:
                return msgspec.json.decode(file.read_bytes(), type=ImportedFacts)
        except (OSError, msgspec.DecodeError, RecursionError):  # for example, the team was saved by an earlier version
            pass
        try:
            facts = facts_of(read_team(self.path(name) / FILES))
        except InvalidInputError as damaged:
            raise ValueError(str(damaged)) from None
        with suppress(OSError):
            file.write_bytes(msgspec.json.encode(facts))
        return facts

    def load(self, name: str) -> History:
        """Return a team with its history. Undo steps that exceed the bounds for edits are dropped.

        Raises:
            KeyError: if there is no team with this id.
            ValueError: if the team's file is damaged.
        """
        history = self._read(name, History)
        if all(is_sound(sketch) for sketch in (*history.before, *history.after)):
            return history
        return History(history.now)

    def now(self, name: str) -> Sketch:
        """Return a team without its undo steps, which is faster. Raises the exceptions of `load`."""
        return self._read(name, _Now).now

    def _read(self, name: str, kind: type[_Read]) -> _Read:
        file = self.path(name) / _HISTORY
        if not file.is_file():
            raise KeyError(name)
        try:
            if file.stat().st_size > MAX_BYTES:
                raise ValueError(f"{file}: the file has more than {MAX_BYTES:,} bytes")
            read = msgspec.json.decode(file.read_bytes(), type=kind)
        except (msgspec.DecodeError, RecursionError, OSError) as damaged:
            raise ValueError(f"{file}: {damaged}") from None
        if not is_sound(read.now):
            raise ValueError(f"{file}: the sketch exceeds the limits of the application")
        return read

    def save(self, name: str, history: History) -> None:
        """Save the current state of a team."""
        _write(self.path(name) / _HISTORY, history)

    def remove(self, name: str) -> None:
        """Remove a team and its runs. Raises `KeyError` for an invalid id."""
        self.move_to_removed(name)
        self.sweep()

    def move_to_removed(self, name: str) -> None:
        """Remove a team at once. Its files, of which there may be many, are deleted later by `sweep`.

        Raises:
            KeyError: if the id is not valid.
            OSError: if the team cannot be removed.
        """
        with suppress(FileNotFoundError):
            self.path(name).rename(self.folder / f"{_REMOVED}{name}-{secrets.token_hex(_ID_BYTES)}")

    def sweep(self) -> None:
        """Delete the files of removed teams. Deleting the files that remain is attempted again next time."""
        self._sweep(_REMOVED)

    def _sweep(self, prefix: str) -> None:
        for left in self.folder.glob(f"{prefix}*"):
            shutil.rmtree(left, ignore_errors=True)

    def path(self, name: str) -> Path:
        """Return a team's folder. Raises `KeyError` for an invalid id."""
        if not (name.isascii() and name.isalnum() and len(name) == 2 * _ID_BYTES):
            raise KeyError(name)
        return self.folder / name


def _write(file: Path, history: History) -> None:
    fresh = file.with_suffix(f".{os.getpid()}.new")
    try:
        with fresh.open("wb") as out:
            out.write(_within_bounds(history))
            out.flush()
            os.fsync(out.fileno())
        fresh.replace(file)
    except BaseException:
        with suppress(OSError):
            fresh.unlink(missing_ok=True)
        raise


def _within_bounds(history: History) -> bytes:
    """Return a history as JSON, without its oldest steps if it would be too large."""
    while len(content := msgspec.json.encode(history)) > MAX_BYTES and (history.before or history.after):
        before, after = history.before, history.after
        history = History(history.now, before[(len(before) + 1) // 2 :], after[(len(after) + 1) // 2 :])
    return content
