"""The panel for a team without a solution: withdraw robots, or find conflicting rules and change them."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import msgspec
from nicegui import run, ui

from robochoc.app.conflicts.rules import with_only
from robochoc.app.conflicts.search import PATIENCE_S, Conflict, ConflictSearch, found_by
from robochoc.app.pages.shell import edit_error_text, on_leave
from robochoc.app.pages.widgets import TroubleLines
from robochoc.app.projects import Project
from robochoc.app.sketch.checks import troubles
from robochoc.app.sketch.edits import EditError, with_rule, with_rule_switched
from robochoc.app.sketch.sentences import sentence
from robochoc.app.sketch.sketch import MAX_COST, Sketch, SketchRule
from robochoc.app.sketch.troubles import About, Trouble
from robochoc.app.texts import say

_USUAL_COST = 10
_MOST_HINTS = 3


def hints_about_rules(sketch: Sketch) -> list[Trouble]:
    """Return the hints about rules that are obviously impossible, each with a remedy."""
    return [trouble for trouble in troubles(sketch) if trouble.about == About.RULE and not trouble.is_error]


class NoSolutionPanel:
    """The two options for a team without a solution: withdraw robots, or change conflicting rules.

    `decide` starts a new run; with `withdraw`, robots may withdraw.
    """

    def __init__(self, project: Project, sketch: Sketch, decide: Callable[..., None]) -> None:
        self._project, self._sketch, self._decide = project, sketch, decide
        self._search: ConflictSearch | None = None
        with ui.element("section").classes("panel doors"):
            with ui.element("h2"):
                ui.label(say("decide.doors"))
            self._known = TroubleLines()
            with ui.element("div").classes("two"):
                self._choice("decide.door-aside", partial(decide, withdraw=True))
                self._choice("decide.door-conflict", self._search_conflict)
            self._found = ui.element("div").classes("found").props("aria-live=polite")
        on_leave(self.end)
        ui.timer(0, self._show_hints, once=True)

    async def _show_hints(self) -> None:
        """Show the hints that can be found without a search, as on the page "Model"."""
        hints = await run.io_bound(hints_about_rules, self._sketch)
        if hints is not None and not self._found.is_deleted:
            self._known.show(hints[:_MOST_HINTS])

    def _choice(self, key: str, does: Callable[[], object]) -> None:
        with ui.element("button").classes("card door").props("type=button").on("click", does):
            with ui.element("h3"):
                ui.label(say(key))
            ui.label(say(f"{key}-help")).classes("soft")

    def end(self) -> None:
        """End the search for conflicts."""
        if self._search:
            self._search.end()

    async def _search_conflict(self) -> None:
        if self._search:  # a search is already running
            return
        self._search = search = ConflictSearch(self._sketch, folder=self._project.folder)
        self._set_text(say("decide.searching", seconds=int(PATIENCE_S)))
        try:
            conflict = await search.found()
        finally:
            self._search = None
            search.end()
        if conflict is not None and not self._found.is_deleted:
            hints = await run.io_bound(hints_about_rules, with_only(self._sketch, conflict.rules or ()))
            self._show(conflict, hints or [])

    def _set_text(self, text: str) -> None:
        self._found.clear()
        with self._found:
            ui.label(text)

    def _show(self, conflict: Conflict, hints: list[Trouble]) -> None:
        if conflict.rules:
            one = len(conflict.rules) == 1
            self._set_text(say("decide.conflict-one") if one else say("decide.conflict", count=len(conflict.rules)))
            with self._found:
                with ui.element("ul").classes("rules"):
                    for name in conflict.rules:
                        self._rule(name, [hint for hint in hints if hint.element == name])
                ui.label(found_by(conflict)).classes("soft")
        elif conflict.why:
            self._set_text(say("decide.conflict-failed", why=conflict.why))
        elif conflict.late:
            self._set_text(f"{say('decide.conflict-late', seconds=int(PATIENCE_S))} {found_by(conflict)}".strip())
        else:
            self._set_text(say("decide.conflict-none" if conflict.rules is None else "decide.conflict-empty"))

    def _rule(self, name: str, hints: list[Trouble]) -> None:
        rule = self._sketch.rule(name)
        if rule is None:
            return
        words = sentence(self._sketch, rule)
        with ui.element("li"):
            ui.label(f"{rule.id}: {words}").classes("words")
            now = self._project.sketch.rule(name)
            if now is None or (now.kind, now.decision) != (rule.kind, rule.decision):
                ui.label(say("decide.not-yours")).classes("soft small")
                return
            with ui.element("div").classes("acts"):
                off = ui.button(say("decide.off"), on_click=partial(self._switch_off, rule))
                off.props("flat dense no-caps").props["aria-label"] = say("decide.off-one", rule=words)
                cost = ui.number(value=_USUAL_COST, min=1, max=MAX_COST, precision=0).classes("cost")
                cost.props("dense outlined").props["aria-label"] = say("decide.cost")
                soften = ui.button(say("decide.soften"), on_click=lambda: self._soften(rule, cost.value))
                soften.props("flat dense no-caps")
                soften.props["aria-label"] = say("decide.soften-one", cost=_USUAL_COST, rule=words)
            if hints:
                TroubleLines().show(hints)

    def _switch_off(self, rule: SketchRule) -> None:
        self._change(lambda sketch: with_rule_switched(sketch, rule.id, on=False))

    def _soften(self, rule: SketchRule, cost: float | None) -> None:
        def softer(sketch: Sketch) -> Sketch:
            now = sketch.rule(rule.id)  # the current rule, since it may have been changed or removed
            return sketch if now is None else with_rule(sketch, msgspec.structs.replace(now, cost=int(cost or 0)))

        self._change(softer)

    def _change(self, change: Callable[[Sketch], Sketch]) -> None:
        try:
            self._project.edit(change)
        except EditError as error:
            ui.notify(edit_error_text(error), type="negative")
        else:
            self._decide()
