"""The open teams: each is a `Project` that all its pages share."""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Sequence
from functools import cached_property, partial
from pathlib import Path
from threading import Lock
from typing import Any

from robochoc.app.imported.facts import ImportedFacts
from robochoc.app.jobs.job import Job, end_jobs_in
from robochoc.app.listeners import Listeners
from robochoc.app.log import USER_LOG
from robochoc.app.parts_owner import PartsOwner
from robochoc.app.runs.prepared_team import TeamFiles
from robochoc.app.sketch.edits import EditError
from robochoc.app.sketch.element_checks import is_sound
from robochoc.app.sketch.history import History
from robochoc.app.sketch.sketch import Sketch
from robochoc.app.store import TeamStore
from robochoc.app.texts import say

SAVE_S = 0.5
"""The time in seconds between an edit and saving it."""
AGAIN_S = 5.0
"""The time in seconds after which a failed attempt to save is repeated."""


class Project(PartsOwner):
    """A team that is being edited. Changes are saved automatically and reported to listeners."""

    def __init__(self, store: TeamStore, name: str) -> None:
        super().__init__()
        self.id = name
        self._store = store
        self._history = store.load(name)
        self._listeners = Listeners()
        self._saving: asyncio.TimerHandle | None = None
        self._writing = Lock()
        self.removed = False
        """True if the team was removed, which its open pages then show."""
        self.unsaved = ""
        """The error of the last attempt to save; empty if it succeeded."""

    @property
    def sketch(self) -> Sketch:
        """The current state of the team."""
        return self._history.now

    @property
    def folder(self) -> Path:
        """The folder with the team's runs and other files."""
        return self._store.path(self.id)

    @property
    def import_folder(self) -> Path | None:
        """The files of an imported team, which cannot be edited, or None if the team was drawn here."""
        return self._store.import_folder(self.id)

    @property
    def files(self) -> TeamFiles | None:
        """The files with which an imported team runs, or None if the team was drawn here and runs with its sketch."""
        folder = self.import_folder
        return None if folder is None else TeamFiles(folder, flies=self.facts.flies, maximised=self.facts.maximised)

    @cached_property
    def facts(self) -> ImportedFacts:
        """The facts about an imported team. Raises `ValueError` if its files are damaged."""
        return self._store.facts(self.id)

    @property
    def can_undo(self) -> bool:
        """True if there is an edit to undo."""
        return bool(self._history.before)

    @property
    def can_redo(self) -> bool:
        """True if there is an undone edit."""
        return bool(self._history.after)

    def edit(self, change: Callable[[Sketch], Sketch]) -> None:
        """Change the sketch. Raises `EditError` for an invalid change, which leaves the sketch unchanged."""
        if self.removed:
            raise EditError("app.removed")
        changed = change(self.sketch)
        if not is_sound(changed):  # a saved sketch must always be readable
            raise EditError("edit.unsound")
        self._update(self._history.edited(changed))

    def undo(self) -> None:
        """Undo the last edit."""
        self._update(self._history.undone())

    def redo(self) -> None:
        """Redo the edit that was undone last."""
        self._update(self._history.redone())

    def on_change(self, callback: Callable[[], None]) -> Callable[[], None]:
        """Call `callback` after each change. Returns a function that removes the callback."""
        return self._listeners.add(callback)

    def save(self) -> None:
        """Save the team now. If this fails, `unsaved` contains the error."""
        self._write()  # a scheduled save stays scheduled

    def mark_removed(self) -> None:
        """Mark the team as removed, and do not save it any more."""
        if self._saving is not None:
            self._saving.cancel()
        with self._writing:
            self.removed = True
        self._listeners()

    def _update(self, history: History) -> None:
        if history is self._history or self.removed:
            return
        self._history = history
        self._save_in(SAVE_S)
        self._listeners()

    def _save_in(self, seconds: float) -> None:
        if self._saving is None:
            self._saving = asyncio.get_running_loop().call_later(seconds, self._save_in_thread)

    def _save_in_thread(self) -> None:
        """Save in a thread, so that a slow disk does not block pages."""
        self._saving = None
        was = self.unsaved

        def done(_: object) -> None:
            if self.unsaved:
                self._save_in(AGAIN_S)
            if self.unsaved != was:
                self._listeners()

        asyncio.ensure_future(asyncio.get_running_loop().run_in_executor(None, self._write)).add_done_callback(done)

    def _write(self) -> None:
        with self._writing:  # one thread at a time writes the current state, so that the last file is the newest
            if self.removed:
                return
            try:
                self._store.save(self.id, self._history)
            except OSError as error:
                self.unsaved = error.strerror or type(error).__name__
            else:
                self.unsaved = ""


class Projects:
    """All teams in a store. Each open team exists once in memory."""

    def __init__(self, store: TeamStore) -> None:
        self.store = store
        self._open: dict[str, Project] = {}

    def open(self, name: str) -> Project:
        """Return the team with this id. Raises `KeyError` if it does not exist, `ValueError` if its file is damaged."""
        if name not in self._open:
            self._open[name] = Project(self.store, name)
        return self._open[name]

    def add(self, sketch: Sketch) -> Project:
        """Add a new team, and return it."""
        return self.open(self.store.add(sketch))

    def remove(self, name: str) -> None:
        """Remove a team and its runs, and end its jobs.

        Raises:
            KeyError: if the id is not valid.
            OSError: if the team cannot be removed. Its jobs are ended, but nothing else has changed.
        """
        folder = self.store.path(name)
        ended = end_jobs_in(folder)
        self.store.move_to_removed(name)
        project = self._open.pop(name, None)
        if project is not None:
            project.mark_removed()
        Job(f"removal of {name}", partial(self._remove_files, name, ended)).start()

    def sweep(self) -> None:
        """Remove the remaining files of teams whose removal was interrupted, in a thread."""
        Job("removal", lambda _: self.store.sweep()).start()

    def _remove_files(self, name: str, ended: Sequence[Job[Any]], job: Job[None]) -> None:
        """Remove the files after the ended jobs have finished, since these may still write files."""
        job.wait_for(ended)
        self.store.remove(name)

    def save(self) -> None:
        """Save all open teams. Errors are printed in the terminal."""
        for project in [*self._open.values()]:
            project.save()
            if project.unsaved:
                USER_LOG.error("%s", say("app.lost", name=project.sketch.name, why=project.unsaved))
