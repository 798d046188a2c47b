"""A lesson as a page of the documentation: Markdown with the same texts and pictures."""

from __future__ import annotations

from collections.abc import Iterator

from robochoc.app.lessons.lesson import COUNT, LessonStep, lesson
from robochoc.app.lessons.picture import picture
from robochoc.app.lessons.recording import before, reasons

_LETTERS = "abcd"
_INTRO = (
    "Ten short lessons on how robots decide together. Ada, Bob, Cleo and Dan are a team of four; each of them has to "
    "choose a level to fly at. Each step asks for the next event: answer first, then open the answer. The messages are "
    "from real runs, in the words of the [sniffer](../guides/sniffer.md). The same lessons are in the application, "
    "`robochoc app`."
)


def page_name(number: int) -> str:
    """Return the name of a lesson's page."""
    return f"{number:02}.md"


def lesson_page(number: int) -> str:
    """Return the page of a lesson."""
    taught = lesson(number)
    parts = [f"# {number}. {taught.title}", taught.goal]
    for place, step in enumerate(taught.steps, 1):
        parts += _step(number, place, step)
    parts += ["## What you have seen", taught.end, _onward(number)]
    return "\n\n".join(parts) + "\n"


def list_page() -> str:
    """Return the page with all lessons."""
    rows = [
        f"{number}. [{lesson(number).title}]({page_name(number)}): {lesson(number).goal}"
        for number in range(1, COUNT + 1)
    ]
    return f"# Lessons\n\n{_INTRO}\n\n" + "\n".join(rows) + "\n"


def _step(number: int, place: int, step: LessonStep) -> Iterator[str]:
    moment = before(number, step)
    yield f"## Step {place}: {step.title}"
    yield step.text
    yield f'<div class="lesson-picture">\n{picture(lesson(number).team_of(step), moment)}\n</div>'
    if moment.messages:
        yield "\n".join(f"* {one.sender} to {one.to}: “{one.words}”" for one in moment.messages)
    yield f"**{step.ask}**"
    yield "\n".join(f"* ({letter}) {choice.shown}" for letter, choice in zip(_LETTERS, step.choices, strict=False))
    yield "\n".join(_answer(number, step))


def _answer(number: int, step: LessonStep) -> Iterator[str]:
    yield '??? success "The answer"'
    yield ""
    letter = _LETTERS[step.choices.index(step.answer)]
    yield f"    **({letter})** {step.answer.why}"
    yield ""
    for letter, choice in zip(_LETTERS, step.choices, strict=False):
        if not choice.right:
            yield f"    * Not ({letter}): {choice.why}"
    own = reasons(number, step)
    if own:
        yield ""
        yield f"    The robot's own reasons, from the recording: {'; '.join(own)}."


def _onward(number: int) -> str:
    if number == COUNT:
        return "That was the last lesson. All of them: [lessons](index.md)."
    return f"Next: [{lesson(number + 1).title}]({page_name(number + 1)})"
