"""The teams that are open: one `Project` each, which all pages that show it share."""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Sequence
from functools import cached_property, partial
from pathlib import Path
from threading import Lock
from typing import Any

from robochoc.app.foreign.facts import Facts
from robochoc.app.jobs.job import Job, end_jobs_in
from robochoc.app.listeners import Listeners
from robochoc.app.log import TOLD
from robochoc.app.parts import HasParts
from robochoc.app.runs.prepared import TeamFiles
from robochoc.app.sketch.edits import EditError
from robochoc.app.sketch.history import History
from robochoc.app.sketch.shape import is_sound
from robochoc.app.sketch.sketch import Sketch
from robochoc.app.store import Store
from robochoc.app.texts import say

SAVE_S = 0.5
"""An edit is on disk after so long."""
AGAIN_S = 5.0
"""What could not be saved is tried again after so long."""


class Project(HasParts):
    """A team that somebody edits. It is saved by itself, and tells whoever listens that it has changed."""

    def __init__(self, store: Store, name: str) -> None:
        super().__init__()
        self.id = name
        self._store = store
        self._history = store.load(name)
        self._listeners = Listeners()
        self._saving: asyncio.TimerHandle | None = None
        self._writing = Lock()
        self.removed = False
        """Somebody removed the team. Pages that still show it say so."""
        self.unsaved = ""
        """Why it could not be saved last time; empty: it could."""

    @property
    def sketch(self) -> Sketch:
        """The team as it stands."""
        return self._history.now

    @property
    def folder(self) -> Path:
        """Where runs and what else belongs to it are kept."""
        return self._store.path(self.id)

    @property
    def foreign(self) -> Path | None:
        """The files of a team that was not drawn here, and cannot be edited by hand. None: it was."""
        return self._store.foreign(self.id)

    @property
    def files(self) -> TeamFiles | None:
        """What decides, of a team that was not drawn here. None: its sketch does."""
        folder = self.foreign
        return None if folder is None else TeamFiles(folder, flies=self.facts.flies, maximised=self.facts.maximised)

    @cached_property
    def facts(self) -> Facts:
        """What is known of a team that was not drawn here. Raises `ValueError` if its files are damaged."""
        return self._store.facts(self.id)

    @property
    def can_undo(self) -> bool:
        """Whether there is something to undo."""
        return bool(self._history.before)

    @property
    def can_redo(self) -> bool:
        """Whether something was undone."""
        return bool(self._history.after)

    def edit(self, change: Callable[[Sketch], Sketch]) -> None:
        """Change the sketch. Raises `EditError` if that cannot be; it stays as it was then."""
        if self.removed:
            raise EditError("app.removed")
        made = change(self.sketch)
        if not is_sound(made):  # whoever asked for it: what is kept can be read again
            raise EditError("edit.unsound")
        self._become(self._history.edited(made))

    def undo(self) -> None:
        """Take the last edit back."""
        self._become(self._history.undone())

    def redo(self) -> None:
        """Make the edit that was undone last again."""
        self._become(self._history.redone())

    def on_change(self, callback: Callable[[], None]) -> Callable[[], None]:
        """Call `callback` after each change; return what ends that."""
        return self._listeners.add(callback)

    def save(self) -> None:
        """Keep it on disk now. `unsaved` tells why, if that cannot be."""
        self._write()  # what is to be saved a little later, or again, still is

    def forget(self) -> None:
        """Keep nothing of it any more: it was removed."""
        if self._saving is not None:
            self._saving.cancel()
        with self._writing:
            self.removed = True
        self._listeners()

    def _become(self, history: History) -> None:
        if history is self._history or self.removed:
            return
        self._history = history
        self._save_in(SAVE_S)
        self._listeners()

    def _save_in(self, seconds: float) -> None:
        if self._saving is None:
            self._saving = asyncio.get_running_loop().call_later(seconds, self._save_beside)

    def _save_beside(self) -> None:
        """Save in a thread: a disk may be slow, and nobody shall wait for it."""
        self._saving = None
        was = self.unsaved

        def done(_: object) -> None:
            if self.unsaved:
                self._save_in(AGAIN_S)
            if self.unsaved != was:
                self._listeners()

        asyncio.ensure_future(asyncio.get_running_loop().run_in_executor(None, self._write)).add_done_callback(done)

    def _write(self) -> None:
        with self._writing:  # one at a time, each what stands then: the last one is the newest
            if self.removed:
                return
            try:
                self._store.save(self.id, self._history)
            except OSError as error:
                self.unsaved = error.strerror or type(error).__name__
            else:
                self.unsaved = ""


class Projects:
    """All teams of a store; those that are open are in memory once."""

    def __init__(self, store: Store) -> None:
        self.store = store
        self._open: dict[str, Project] = {}

    def open(self, name: str) -> Project:
        """Return the team of that id. Raises `KeyError` if there is none, `ValueError` if its file is damaged."""
        if name not in self._open:
            self._open[name] = Project(self.store, name)
        return self._open[name]

    def add(self, sketch: Sketch) -> Project:
        """Return a new team."""
        return self.open(self.store.add(sketch))

    def remove(self, name: str) -> None:
        """Remove a team, and all that was decided by it. All that it does at present is ended.

        Raises:
            KeyError: for what is no id.
            OSError: if that cannot be. Nothing has changed then, but that nothing runs any more.
        """
        folder = self.store.path(name)
        ended = end_jobs_in(folder)
        self.store.put_away(name)
        project = self._open.pop(name, None)
        if project is not None:
            project.forget()
        Job(f"removal of {name}", partial(self._swept, name, ended)).start()

    def sweep(self) -> None:
        """Remove, in a thread, what is left of teams whose removal was broken off."""
        Job("removal", lambda _: self.store.sweep()).start()

    def _swept(self, name: str, ended: Sequence[Job[Any]], job: Job[None]) -> None:
        """Remove the files once nobody writes them any more; a thread that was at work may have written some anew."""
        job.wait_for(ended)
        self.store.remove(name)

    def save(self) -> None:
        """Keep all that is open on disk. What cannot be kept is told in the terminal."""
        for project in [*self._open.values()]:
            project.save()
            if project.unsaved:
                TOLD.error("%s", say("app.lost", name=project.sketch.name, why=project.unsaved))
