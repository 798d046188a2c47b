"""The Pareto front of a run with several objectives: the user chooses a point in a chart or a table."""

from __future__ import annotations

from functools import partial

from nicegui import ui
from nicegui.events import GenericEventArguments

from robochoc.app.flights.builder import builder_of
from robochoc.app.runs.result import RunResult
from robochoc.app.runs.run import Run
from robochoc.app.texts import say
from robochoc.view.front_page import front_choice

_POINT_OF_LINK = """(event) => {
    const link = event.target.closest('a');
    if (!link) return;
    event.preventDefault();
    emit([Number(link.getAttribute('href').slice(2)), link.closest('svg') ? 'svg' : 'table']);
}"""
"""Emits the number of the point whose link was followed by mouse or keyboard, and whether it is in a chart."""
_FOCUS = "setTimeout(() => document.querySelector(`.front {place} a[href='#p{number}']`)?.focus(), 200)"
"""Returns the focus to the link, since the front is drawn again."""


def show_front(run: Run, result: RunResult) -> None:
    """Fill the current container with the charts and the table of the front. A link chooses a point of the run."""
    with ui.element("h3"):
        ui.label(say("decide.front"))
    ui.label(say("decide.front-help")).classes("soft")
    front = ui.html(front_choice(result.front, result.point + 1), sanitize=False).classes("front")
    front.on("click", partial(_choose, run), js_handler=_POINT_OF_LINK)


def _choose(run: Run, event: GenericEventArguments) -> None:
    match event.args:
        case [int(number), "svg" | "table" as place]:
            run.choose_point(number - 1)
            builder_of(run).discard()
            ui.run_javascript(_FOCUS.format(place=place, number=number))
        case _:  # not from this page
            pass
