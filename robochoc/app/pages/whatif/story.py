"""The changes made to a team on the page "What if", and its decisions before and after, shared by all tabs.

The changes are saved in the team's folder (`whatif.json`), and the changes in a run in its folder (`change.json`).
"""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from contextlib import suppress

import msgspec

from robochoc.app.listeners import Listeners
from robochoc.app.log import log_error
from robochoc.app.pages.background_query import ErrorText, run_query
from robochoc.app.pages.whatif.outcome import DecisionComparison, TeamDecision, compare, part_of, parts_of_epochs
from robochoc.app.projects import Project
from robochoc.app.runs.options import RunOptions
from robochoc.app.runs.rule_costs import rules_with_costs
from robochoc.app.runs.run import CHANGE, Run, RunState
from robochoc.app.runs.runs import runs_of
from robochoc.app.sketch.building import model_of
from robochoc.app.sketch.changing_model import FromScratchError, changing_model
from robochoc.app.sketch.edits import EditError
from robochoc.app.sketch.palette import Links
from robochoc.app.sketch.rules import PALETTE
from robochoc.app.sketch.sketch import Sketch
from robochoc.app.sketch.team_changes import AnyTeamChange, changed, sentences_of
from robochoc.app.texts import say
from robochoc.formats import InvalidInputError
from robochoc.model.problem import Team
from robochoc.modelling.errors import ModelError
from robochoc.modelling.model import Model
from robochoc.run.choice import choose
from robochoc.run.options import Options, Runtime
from robochoc.run.registry import UnknownProtocolError, protocol_named
from robochoc.solver.errors import UnsupportedError

PURPOSE = "whatif"
"""The purpose of the run that decides before and after the change."""
BESIDE = "whatif-anew"
"""The purpose of the second run, in which the changed team decides from scratch."""
_STORY = "whatif.json"
MOST_CHANGES = 50


class SavedChange(msgspec.Struct):
    """The change in a run: the resulting team, its events in words, and why it decides from scratch, if it does.

    `beside`: the id of the second run.
    """

    after: Sketch
    happened: list[str]
    anew: str = ""
    beside: str = ""


class Story:
    """The changes to a team, and the runs before and after them."""

    def __init__(self, project: Project) -> None:
        self._project = project
        self._listeners = Listeners()
        self.changes: tuple[AnyTeamChange, ...] = self._loaded()
        self.saved_change: SavedChange | None = None
        self.run: Run | None = None
        self.second_run: Run | None = None
        self.outcome: DecisionComparison | None = None
        self.message = ""
        """The error of a failed run."""
        self.preparing = False
        self._model: Model | None = None
        self._task: asyncio.Task[None] | None = None
        self._find_last()

    # Changes

    def after(self) -> Sketch:
        """Return the team after all changes. Raises `EditError` if they are no longer possible."""
        return changed(self._project.sketch, self.changes)

    def words(self) -> list[str]:
        """Return the changes in words. Changes that an edit has made impossible are dropped."""
        while True:
            try:
                return sentences_of(self._project.sketch, self.changes)
            except EditError:
                self.changes = self._possible()

    def add(self, change: AnyTeamChange) -> None:
        """Add a change. Raises `EditError` if it is not possible."""
        if len(self.changes) >= MOST_CHANGES:
            raise EditError("whatif.too-many", most=MOST_CHANGES)
        after = changed(self._project.sketch, (*self._possible(), change))
        if not after.robots:
            raise EditError("whatif.nobody-left")
        self.changes = (*self._possible(), change)
        self._changed()

    def remove_change(self, place: int) -> None:
        """Remove one change, and the later changes that are impossible without it."""
        self.changes = self.changes[:place] + self.changes[place + 1 :]
        self.changes = self._possible()
        self._changed()

    def clear(self) -> None:
        """Remove all changes."""
        self.changes = ()
        self._changed()

    def apply_changes(self) -> None:
        """Apply the changes to the team, as one edit."""
        after = self.after()
        self._project.edit(lambda _: after)
        self.clear()

    # Runs

    @property
    def running(self) -> bool:
        """True if a run is in progress."""
        return self.preparing or any(run.state == RunState.RUNNING for run in (self.run, self.second_run) if run)

    async def decide(self) -> None:
        """Start a run of the team before and after the changes."""
        if self.running:
            return
        before, after, words = self._project.sketch, self.after(), self.words()
        self.preparing, self.outcome, self.message, self.second_run, self._task = True, None, "", None, None
        self._listeners()
        try:
            self.saved_change = SavedChange(after, words)
            try:
                self._model = await asyncio.to_thread(_checked, before, after)
            except FromScratchError as anew:
                self._model, self.saved_change.anew = None, say(anew.key, **anew.named)
            model = self._model
            self.run = runs_of(self._project).start(
                sketch=before, model=model_of if model is None else lambda _: model, purpose=PURPOSE
            )
            self._save_change()
            self.run.on_change(self._on_run_change)
        except (ModelError, InvalidInputError) as mistake:
            self.run, self.message = None, str(mistake)
        except Exception as fault:  # noqa: BLE001 - shown, and written to the error log
            self.run, self.message = None, log_error(fault, "what if")
        finally:
            self.preparing = False
            self._listeners()

    def stop(self) -> None:
        """Stop the runs."""
        for run in (self.run, self.second_run):
            if run:
                run.stop()

    def on_change(self, callback: Callable[[], None]) -> Callable[[], None]:
        """Call `callback` after each change. Returns a function that removes the callback."""
        return self._listeners.add(callback)

    def _on_run_change(self) -> None:
        """Follow both runs, and report errors."""
        try:
            self._follow()
        except Exception as fault:  # noqa: BLE001 - shown, and written to the error log
            self.message = log_error(fault, "what if")
        self._listeners()

    def _follow(self) -> None:
        """Start the second run after the first, and compute the outcome after both runs."""
        run, saved_change = self.run, self.saved_change
        if run and saved_change and run.state != RunState.RUNNING:
            if self.second_run is None and run.state == RunState.ENDED and run.result and self._needs_second_run(run):
                protocol = run.result.protocol
                options = RunOptions(protocol=protocol) if not saved_change.anew else RunOptions()
                self.second_run = runs_of(self._project).start(options, sketch=saved_change.after, purpose=BESIDE)
                saved_change.beside = self.second_run.id
                self._save_change()
                self.second_run.on_change(self._on_run_change)
            elif self.outcome is None and self._task is None and not self.running:
                self._compute_later(self._comparison)

    def _compute_later(self, work: Callable[[], DecisionComparison | None]) -> None:
        """Compute the outcome in a thread, since that is slow for a large team."""

        async def compute() -> None:
            found = await run_query(work)
            if isinstance(found, ErrorText):
                self.message = found
            else:
                self.outcome = found
            self.preparing = False
            self._listeners()

        self.preparing = True
        self._task = asyncio.get_running_loop().create_task(compute())

    def _needs_second_run(self, run: Run) -> bool:
        """Return whether a run from scratch must be measured: the protocol is dynamic, or the first run was not."""
        return bool(self.saved_change and self.saved_change.anew) or bool(
            run.result and is_dynamic(run.result.protocol)
        )

    def _comparison(self) -> DecisionComparison | None:
        run, saved_change, second_run = self.run, self.saved_change, self.second_run
        if run is None or saved_change is None or run.result is None:
            return None
        with suppress(ModelError, OSError, ValueError):
            before = run.sketch
            if not saved_change.anew:
                model = self._model or changing_model(before, saved_change.after)
                found = parts_of_epochs(before, saved_change.after, model, run.result)
                return _compared(before, saved_change.after, found, run.result.protocol) if found else None
            if second_run and second_run.result:
                parts = part_of(before, None, run.result), part_of(saved_change.after, None, second_run.result)
                return _compared(before, saved_change.after, parts, second_run.result.protocol)
        return None

    def _find_last(self) -> None:
        """Load the last runs, which were started before a restart of the server."""
        runs = runs_of(self._project)
        run = runs.latest_for(PURPOSE)
        if run is None or run.state == RunState.RUNNING:
            return
        with suppress(OSError, msgspec.DecodeError, ValueError, RecursionError):
            self.saved_change = msgspec.json.decode((run.folder / CHANGE).read_bytes(), type=SavedChange)
            self.run, self.second_run = run, runs.find(self.saved_change.beside) if self.saved_change.beside else None
            self._compute_later(self._comparison)

    def _save_change(self) -> None:
        if self.run and self.saved_change:
            with suppress(OSError):
                (self.run.folder / CHANGE).write_bytes(msgspec.json.encode(self.saved_change))

    def _possible(self) -> tuple[AnyTeamChange, ...]:
        """Return the changes that are possible for the current team."""
        found: list[AnyTeamChange] = []
        sketch = self._project.sketch
        for change in self.changes:
            with suppress(EditError):
                sketch = change.after(sketch)
                found.append(change)
        return tuple(found)

    def _loaded(self) -> tuple[AnyTeamChange, ...]:
        try:
            return msgspec.json.decode((self._project.folder / _STORY).read_bytes(), type=tuple[AnyTeamChange, ...])
        except (OSError, msgspec.DecodeError, RecursionError):
            return ()

    def _changed(self) -> None:
        with suppress(OSError):
            (self._project.folder / _STORY).write_bytes(msgspec.json.encode(self.changes))
        self._listeners()


def story_of(project: Project) -> Story:
    """Return the changes to a team, which are the same object for all pages."""
    return project.part(Story)


def is_dynamic(protocol: str) -> bool:
    """Return whether a protocol continues when the problem changes."""
    try:
        return protocol_named(protocol).traits.dynamic
    except (UnknownProtocolError, ImportError):
        return False


def _compared(
    before: Sketch, after: Sketch, parts: tuple[TeamDecision, TeamDecision], protocol: str
) -> DecisionComparison:
    return compare((before, parts[0]), (after, parts[1]), protocol)


def _checked(before: Sketch, after: Sketch) -> Model:
    """Return the model with the changes. Raises `ModelError` or `InvalidInputError` if either team has errors."""
    _ = model_of(after).team
    return changing_model(before, after)


MOST_CHOSEN_FOR = 60
"""The most robots for which the choice of `auto` is computed before the run."""


def why_not_continue(before: Sketch, after: Sketch) -> str:
    """Return the reason why the team must decide from scratch after a change, or an empty text if it can continue.

    Args:
        before: The team before the change.
        after: The team after the change.
    """
    if rules_with_costs(before) or rules_with_costs(after):
        return say("whatif.before-costs")
    if any(_has_secrets(sketch) for sketch in (before, after)):
        return say("whatif.before-secrets")
    try:
        _ = model_of(after).team
        return _by_protocol(changing_model(before, after).team)
    except FromScratchError as anew:
        return say("whatif.all-anew", why=say(anew.key, **anew.named))
    except (ModelError, InvalidInputError, UnsupportedError):  # another part of the page shows the error
        return ""


def _by_protocol(team: Team) -> str:
    if len(team.robots) > MOST_CHOSEN_FOR:
        return ""
    protocol = choose(team, Options(runtime=Runtime.SIMULATOR)).options.protocol
    return "" if is_dynamic(protocol) else say("whatif.before-protocol", protocol=protocol)


def _has_secrets(sketch: Sketch) -> bool:
    """Return whether any two robots have a rule that only one of them knows."""
    private = [rule for rule in sketch.rules if rule.on and rule.private and rule.kind in PALETTE]
    return any(PALETTE[rule.kind].links != Links.EACH for rule in private)
