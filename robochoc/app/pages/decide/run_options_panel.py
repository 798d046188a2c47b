"""The options for a run: protocol, runtime, seed and time limit, in a panel that is collapsed at first."""

from __future__ import annotations

from math import inf

from nicegui import ui

from robochoc.app.pages.background_query import ErrorText, run_query
from robochoc.app.pages.widgets import bounded_integer
from robochoc.app.projects import Project
from robochoc.app.runs.fitting import Fitting, fitting
from robochoc.app.runs.options import MAX_SEED, RunOptions
from robochoc.app.sketch.sketch import MAX_LABEL
from robochoc.app.texts import say
from robochoc.run.defaults import AUTO
from robochoc.run.options import Runtime

_MOST_REASONS = 12


class RunOptionsPanel:
    """The panel. `options` returns the options that the user set."""

    def __init__(self, project: Project) -> None:
        self._project = project
        self._shown_sketch: object = None
        with ui.expansion(say("decide.how"), on_value_change=self._show_protocols).classes("how") as self._fold:
            with ui.element("div").classes("fields"):
                self._protocol = ui.select({AUTO: say("decide.auto")}, value=AUTO, label=say("decide.protocol"))
                names = {Runtime.SIMULATOR: "simulator", Runtime.PROCESSES: "processes"}
                choices = {str(key): say(f"decide.{name}-help") for key, name in names.items()}
                self._runtime = ui.select(choices, value=str(Runtime.SIMULATOR), label=say("decide.runtime"))
                self._seed = ui.number(say("decide.seed"), value=0, min=0, max=MAX_SEED, precision=0)
                self._limit = ui.number(say("decide.limit-s"), min=0.1, placeholder=say("decide.no-limit"))
            self._why = ui.element("div").classes("why")

    def options(self, *, withdraw: bool = False) -> RunOptions:
        """Return the options that the user set, with the default instead of each invalid value."""
        limit = self._limit.value
        return RunOptions(
            protocol=str(self._protocol.value or AUTO)[:MAX_LABEL],
            runtime=str(Runtime(self._runtime.value or Runtime.SIMULATOR)),
            seed=bounded_integer(self._seed.value, 0, MAX_SEED, otherwise=0),
            timeout=float(limit) if limit and 0 < limit < inf else None,
            withdraw=withdraw,
        )

    async def _show_protocols(self) -> None:
        """Show the protocols that suit the team, when the panel is opened after a change in the team."""
        sketch = self._project.sketch
        if not self._fold.value or self._shown_sketch is sketch:
            return
        self._shown_sketch = sketch
        self._set_text(say("decide.looking"))
        found = await run_query(fitting, sketch, self._project.files)
        if isinstance(found, ErrorText):
            self._shown_sketch = None  # try again when the panel is opened
            self._set_text(say("decide.fits-none", why=found))
        elif found is not None:
            self._show(found)

    def _set_text(self, text: str) -> None:
        self._why.clear()
        with self._why:
            ui.label(text).classes("soft")

    def _show(self, found: Fitting) -> None:
        complete = "decide.costs-complete" if found.costs else "decide.complete"
        words = {True: complete, False: "decide.incomplete"}
        fit = {name: say(words[complete], name=name) for name, complete in found.protocols}
        chosen = self._protocol.value if self._protocol.value in fit else AUTO
        self._protocol.set_options({AUTO: say("decide.auto"), **fit}, value=chosen)
        self._set_text(say("decide.auto-would", protocol=found.chosen, why=found.why))
        with self._why:
            ui.label("; ".join(found.facts)).classes("soft")
            if found.rejected:
                with ui.expansion(say("decide.not-others")), ui.element("ul"):
                    for name, why in found.rejected[:_MOST_REASONS]:
                        with ui.element("li"):
                            ui.label(say("decide.not-one", name=name, why=why)).classes("soft")
