"""The first page: examples, a file, an empty map, and the user's own teams."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from functools import partial

from nicegui import ui

from robochoc.app.pages.upload_card import build_upload_card
from robochoc.app.projects import Projects
from robochoc.app.sketch.examples import examples, shows, title_of
from robochoc.app.sketch.picture import picture
from robochoc.app.sketch.sketch import Sketch
from robochoc.app.texts import say

_MOST_SHOWN = 60


def build_gallery(projects: Projects) -> None:
    """Fill the page."""
    with ui.element("div"):
        with ui.element("h1"):
            ui.label(say("gallery.title"))
        ui.label(say("gallery.intro")).classes("soft")
    with ui.element("ul").classes("cards"):
        _card(say("gallery.new"), say("gallery.new-hint"), lambda: _begin(projects, Sketch()), icon="add")
        build_upload_card(projects, open_team)
        _card(say("lesson.title"), say("lesson.title-hint"), lambda: ui.navigate.to("/lessons"), icon="school")
    _heading("gallery.examples")
    with ui.element("ul").classes("cards"):
        for key, sketch in examples().items():
            _card(
                title_of(key),
                sketch.story,
                partial(_begin, projects, sketch),
                sketch=sketch,
                note=_shown_by(key, sketch),
            )
    _heading("gallery.yours")
    _own(projects)


def _shown_by(key: str, sketch: Sketch) -> str:
    return say("gallery.shows-flying" if sketch.flies else "gallery.shows", what=shows(key))


def open_team(name: str) -> None:
    """Show the page on which a team is modelled."""
    ui.navigate.to(f"/team/{name}/model")


def _begin(projects: Projects, sketch: Sketch) -> None:
    open_team(projects.add(sketch).id)


@ui.refreshable
def _own(projects: Projects) -> None:
    names = projects.store.ids()[:_MOST_SHOWN]
    if not names:
        ui.label(say("gallery.none")).classes("soft")
    with ui.element("ul").classes("cards"):
        for name in names:
            _own_card(projects, name)


def _own_card(projects: Projects, name: str) -> None:
    sketch: Sketch | None
    try:
        sketch = projects.store.now(name)
    except (KeyError, ValueError):
        sketch = None
    title = name if sketch is None else sketch.name
    says = say("app.damaged") if sketch is None else counted(len(sketch.robots))
    with _card(title, says, partial(open_team, name), sketch=sketch):
        button = ui.button(icon="close", on_click=partial(_ask_to_remove, projects, name, title)).classes("remove")
        button.props("flat round dense size=sm")
        button.props["aria-label"] = say("gallery.remove", name=title)  # `props` would parse the name


def _ask_to_remove(projects: Projects, name: str, title: str) -> None:
    def remove() -> None:
        dialog.close()
        with suppress(KeyError):  # already removed
            projects.remove(name)
        _own.refresh()

    with ui.dialog(value=True) as dialog, ui.card():
        ui.label(say("gallery.remove-question", name=title))
        with ui.row():
            ui.button(say("gallery.remove-yes"), on_click=remove).props("no-caps color=negative")
            ui.button(say("gallery.remove-no"), on_click=dialog.close).props("no-caps flat autofocus")


def counted(robots: int) -> str:
    """Return the number of robots in words."""
    return say("gallery.robot") if robots == 1 else say("gallery.robots", count=robots)


def _heading(key: str) -> None:
    with ui.element("h2"):
        ui.label(say(key))


def _card(
    title: str, says: str, does: Callable[[], object], *, sketch: Sketch | None = None, icon: str = "", note: str = ""
) -> ui.element:
    item = ui.element("li").classes("item")
    with item, ui.element("button").classes("card").props("type=button").on("click", does):
        if sketch is not None:
            _thumbnail(sketch)
        elif icon:
            with ui.element("span").classes("picture").props("aria-hidden=true"):
                ui.icon(icon, size="2.5rem")
        with ui.element("h3"):
            ui.label(title)
        ui.label(says).classes("soft")
        if note:
            ui.label(note).classes("small")
    return item


def _thumbnail(sketch: Sketch) -> None:
    with ui.element("span").classes("picture").props("aria-hidden=true"):
        ui.html(picture(sketch), sanitize=False).classes("drawn")  # texts in the picture are escaped
