"""What stands below the answer of a team that was not drawn here: what happened on the way, and what can be done."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

from nicegui import ui

from robochoc.app.foreign.facts import Facts
from robochoc.app.pages.foreign.answer import epochs_html
from robochoc.app.pages.foreign.model import style
from robochoc.app.projects import Project
from robochoc.app.runs.result import RunResult
from robochoc.app.texts import say


def show_foreign_below(project: Project, facts: Facts, result: RunResult, decide: Callable[..., None]) -> None:
    """Fill the current container.

    Args:
        project: The team.
        facts: What is known of it.
        result: What it has decided.
        decide: Lets it decide again, with `withdraw` so that robots may step aside.
    """
    ui.add_css(style())
    if result.epochs:
        with ui.element("section").classes("panel"):
            with ui.element("h2"):
                ui.label(say("foreign.epochs"))
            ui.html(epochs_html(facts, result), sanitize=False).classes("foreign-table")
    if result.verdict == "no-solution":
        _doors(project, facts, result, decide)


def _doors(project: Project, facts: Facts, result: RunResult, decide: Callable[..., None]) -> None:
    """Show the ways out of a team without a solution; of one that cannot be gone, why."""
    with ui.element("section").classes("panel doors"):
        with ui.element("h2"):
            ui.label(say("decide.doors"))
        if result.reason:
            ui.label(say("foreign.reason", why=result.reason))
        with ui.element("div").classes("two"):
            if facts.events or facts.partial:
                why = "foreign.no-aside-events" if facts.events else "foreign.no-aside-partial"
                ui.label(say(why)).classes("soft")
            else:
                _door("decide.door-aside", partial(decide, withdraw=True))
        ui.link(say("foreign.to-files"), f"/team/{project.id}/model")


def _door(key: str, does: Callable[[], object]) -> None:
    with ui.element("button").classes("card door").props("type=button").on("click", does):
        with ui.element("h3"):
            ui.label(say(key))
        ui.label(say(f"{key}-help")).classes("soft")
