"""What has happened to a team, one thing after the other, and how it decided again. All tabs of a team share it.

It is kept in the team's folder (`whatif.json`), and with each run what belongs to it (`change.json`).
"""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from contextlib import suppress

import msgspec

from robochoc.app.listeners import Listeners
from robochoc.app.log import log_error
from robochoc.app.pages.background_query import ErrorText, run_query
from robochoc.app.pages.whatif.outcome import Outcome, Part, outcome, part_of, parts_of_epochs
from robochoc.app.projects import Project
from robochoc.app.runs.options import RunOptions
from robochoc.app.runs.run import CHANGE, Run, State
from robochoc.app.runs.runs import runs_of
from robochoc.app.sketch.building import model_of
from robochoc.app.sketch.changes import AnyChange, changed, told
from robochoc.app.sketch.differences import AnewError, changing_model
from robochoc.app.sketch.edits import EditError
from robochoc.app.sketch.sketch import Sketch
from robochoc.app.texts import say
from robochoc.formats import InvalidInputError
from robochoc.model.problem import Team
from robochoc.modelling.errors import ModelError
from robochoc.modelling.model import Model
from robochoc.run.registry import UnknownProtocolError, protocol_named

PURPOSE = "whatif"
"""What the run is for that decides before and after the change."""
BESIDE = "whatif-anew"
"""What the run beside it is for: the changed team alone, which decides anew."""
_STORY = "whatif.json"
MOST_CHANGES = 50


class Kept(msgspec.Struct):
    """What belongs to a run: the team after the change, what has happened, and why it decides anew, if it does."""

    after: Sketch
    happened: list[str]
    anew: str = ""
    beside: str = ""


class Story:
    """What has happened to a team."""

    def __init__(self, project: Project) -> None:
        self._project = project
        self._listeners = Listeners()
        self.changes: tuple[AnyChange, ...] = self._loaded()
        self.kept: Kept | None = None
        self.run: Run | None = None
        self.beside: Run | None = None
        self.outcome: Outcome | None = None
        self.message = ""
        """Why it could not decide."""
        self.preparing = False
        self._model: Model | None = None
        self._task: asyncio.Task[None] | None = None
        self._find_last()

    # What happens

    def after(self) -> Sketch:
        """Return the team after all that has happened. Raises `EditError` if that can no longer happen."""
        return changed(self._project.sketch, self.changes)

    def words(self) -> list[str]:
        """Return what has happened, in words. What can no longer happen, since the team was edited, is let go."""
        while True:
            try:
                return told(self._project.sketch, self.changes)
            except EditError:
                self.changes = self._possible()

    def add(self, change: AnyChange) -> None:
        """Let something more happen. Raises `EditError` if it cannot."""
        if len(self.changes) >= MOST_CHANGES:
            raise EditError("whatif.too-many", most=MOST_CHANGES)
        after = changed(self._project.sketch, (*self._possible(), change))
        if not after.robots:
            raise EditError("whatif.nobody-left")
        self.changes = (*self._possible(), change)
        self._changed()

    def take_back(self, place: int) -> None:
        """Take one change back, and what can no longer happen without it."""
        self.changes = self.changes[:place] + self.changes[place + 1 :]
        self.changes = self._possible()
        self._changed()

    def clear(self) -> None:
        """Take all back."""
        self.changes = ()
        self._changed()

    def keep(self) -> None:
        """Make the changed team the team: one step, that can be undone."""
        after = self.after()
        self._project.edit(lambda _: after)
        self.clear()

    # How the team decides again

    @property
    def running(self) -> bool:
        """Whether it decides at present."""
        return self.preparing or any(run.state == State.RUNNING for run in (self.run, self.beside) if run)

    async def decide(self) -> None:
        """Let the team decide, before and after what has happened. Returns as soon as it has begun."""
        if self.running:
            return
        before, after, words = self._project.sketch, self.after(), self.words()
        self.preparing, self.outcome, self.message, self.beside, self._task = True, None, "", None, None
        self._tell()
        try:
            self.kept = Kept(after, words)
            try:
                self._model = await asyncio.to_thread(_checked, before, after)
            except AnewError as anew:
                self._model, self.kept.anew = None, say(anew.key, **anew.named)
            model = self._model
            self.run = runs_of(self._project).start(
                sketch=before, model=model_of if model is None else lambda _: model, purpose=PURPOSE
            )
            self._keep()
            self.run.on_change(self._followed)
        except (ModelError, InvalidInputError) as mistake:
            self.run, self.message = None, str(mistake)
        except Exception as fault:  # noqa: BLE001 - told, and kept in the file of errors
            self.run, self.message = None, log_error(fault, "what if")
        finally:
            self.preparing = False
            self._tell()

    def stop(self) -> None:
        """Stop deciding."""
        for run in (self.run, self.beside):
            if run:
                run.stop()

    def on_change(self, callback: Callable[[], None]) -> Callable[[], None]:
        """Call `callback` when something has changed; return what ends that."""
        return self._listeners.add(callback)

    def _followed(self) -> None:
        """Follow both runs, and say if that goes wrong."""
        try:
            self._follow()
        except Exception as fault:  # noqa: BLE001 - told, and kept in the file of errors
            self.message = log_error(fault, "what if")
        self._tell()

    def _follow(self) -> None:
        """Begin the second run when the first one has ended, and find the outcome when both have."""
        run, kept = self.run, self.kept
        if run and kept and run.state != State.RUNNING:
            if self.beside is None and run.state == State.ENDED and run.result and self._wants_beside(run):
                protocol = run.result.protocol
                options = RunOptions(protocol=protocol) if not kept.anew else RunOptions()
                self.beside = runs_of(self._project).start(options, sketch=kept.after, purpose=BESIDE)
                kept.beside = self.beside.id
                self._keep()
                self.beside.on_change(self._followed)
            elif self.outcome is None and self._task is None and not self.running:
                self._later(self._conclude)

    def _later(self, work: Callable[[], Outcome | None]) -> None:
        """Find the outcome beside the event loop: of a large team it takes its time."""

        async def concluded() -> None:
            found = await run_query(work)
            if isinstance(found, ErrorText):
                self.message = found
            else:
                self.outcome = found
            self.preparing = False
            self._tell()

        self.preparing = True
        self._task = asyncio.get_running_loop().create_task(concluded())

    def _wants_beside(self, run: Run) -> bool:
        """Return whether deciding anew is still to be measured: for a protocol that goes on, or where none can."""
        return bool(self.kept and self.kept.anew) or bool(run.result and goes_on(run.result.protocol))

    def _conclude(self) -> Outcome | None:
        run, kept, beside = self.run, self.kept, self.beside
        if run is None or kept is None or run.result is None:
            return None
        with suppress(ModelError, OSError, ValueError):
            before = run.sketch
            if not kept.anew:
                model = self._model or changing_model(before, kept.after)
                found = parts_of_epochs(before, kept.after, model, run.result)
                return _side_by_side(before, kept.after, found, run.result.protocol) if found else None
            if beside and beside.result:
                parts = part_of(before, None, run.result), part_of(kept.after, None, beside.result)
                return _side_by_side(before, kept.after, parts, beside.result.protocol)
        return None

    def _find_last(self) -> None:
        """Find what was decided before the server ended."""
        runs = runs_of(self._project)
        run = runs.latest_for(PURPOSE)
        if run is None or run.state == State.RUNNING:
            return
        with suppress(OSError, msgspec.DecodeError, ValueError, RecursionError):
            self.kept = msgspec.json.decode((run.folder / CHANGE).read_bytes(), type=Kept)
            self.run, self.beside = run, runs.find(self.kept.beside) if self.kept.beside else None
            self._later(self._conclude)

    def _keep(self) -> None:
        if self.run and self.kept:
            with suppress(OSError):
                (self.run.folder / CHANGE).write_bytes(msgspec.json.encode(self.kept))

    def _possible(self) -> tuple[AnyChange, ...]:
        """Return the changes that can happen to the team as it is now."""
        found: list[AnyChange] = []
        sketch = self._project.sketch
        for change in self.changes:
            with suppress(EditError):
                sketch = change.after(sketch)
                found.append(change)
        return tuple(found)

    def _loaded(self) -> tuple[AnyChange, ...]:
        try:
            return msgspec.json.decode((self._project.folder / _STORY).read_bytes(), type=tuple[AnyChange, ...])
        except (OSError, msgspec.DecodeError, RecursionError):
            return ()

    def _changed(self) -> None:
        with suppress(OSError):
            (self._project.folder / _STORY).write_bytes(msgspec.json.encode(self.changes))
        self._tell()

    def _tell(self) -> None:
        self._listeners()


def story_of(project: Project) -> Story:
    """Return what has happened to a team, the same object for all pages that show it."""
    return project.part(Story)


def goes_on(protocol: str) -> bool:
    """Return whether a protocol goes on with what still holds when the problem changes."""
    try:
        return protocol_named(protocol).traits.dynamic
    except (UnknownProtocolError, ImportError):
        return False


def _side_by_side(before: Sketch, after: Sketch, parts: tuple[Part, Part], protocol: str) -> Outcome:
    return outcome((before, parts[0]), (after, parts[1]), protocol)


def _checked(before: Sketch, after: Sketch) -> Model:
    """Return the model that changes, or say what is wrong with either team."""
    _built(model_of(after))
    return changing_model(before, after)


def _built(model: Model) -> Team:
    return model.team
