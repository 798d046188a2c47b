"""The list of all lessons."""

from __future__ import annotations

from functools import cache
from importlib.resources import files

from nicegui import ui

from robochoc.app.lessons.lesson import COUNT, lesson
from robochoc.app.lessons.progress import Progress
from robochoc.app.texts import say


def build_lessons(progress: Progress) -> None:
    """Fill the current container with the list and the user's progress."""
    ui.add_css(style())
    with ui.element("div"):
        with ui.element("h1"):
            ui.label(say("lesson.title"))
        ui.label(say("lesson.intro")).classes("soft")
    with ui.element("ol").classes("cards"):
        for number in range(1, COUNT + 1):
            _card(number, progress)


def _card(number: int, progress: Progress) -> None:
    taught, done = lesson(number), progress.done(number)
    with ui.element("li"), ui.link(target=f"/lessons/{number}").classes("card"):
        ui.label(str(number)).classes("number")
        with ui.element("h2"):
            ui.label(taught.title)
        ui.label(taught.goal).classes("soft")
        with ui.element("div").classes("state over" if progress.is_over(number) else "state"):
            bits(len(taught.steps), done)
            ui.label(_state(number, progress))


def _state(number: int, progress: Progress) -> str:
    if progress.is_over(number):
        return say("lesson.over")
    done = progress.done(number)
    return say("lesson.go-on", step=done + 1) if done else say("lesson.steps", count=len(lesson(number).steps))


def bits(count: int, done: int, now: int | None = None) -> None:
    """Draw a bar for each step, in addition to the text."""
    with ui.element("div").classes("bits").props("aria-hidden=true"):
        for place in range(count):
            ui.element("i").classes(f"{'done' if place < done else ''} {'now' if place == now else ''}")


@cache
def style() -> str:
    """Return the style of the lessons' pages and pictures."""
    own = (files(__package__) / "lessons.css").read_text(encoding="utf-8")
    return own + (files("robochoc.app.lessons") / "picture.css").read_text(encoding="utf-8")
