"""The list of lessons, and a lesson: a picture on the left and a question on the right, step by step."""

from __future__ import annotations

from functools import cache
from importlib.resources import files

from nicegui import ui
from nicegui.events import KeyEventArguments

from robochoc.app.lessons.lesson import COUNT, AnswerChoice, LessonStep, lesson
from robochoc.app.lessons.picture import picture
from robochoc.app.lessons.progress import LessonProgress
from robochoc.app.lessons.recording import LessonMoment, after, before, reasons
from robochoc.app.texts import say


def build_lessons(progress: LessonProgress) -> None:
    """Fill the current container with the list and the user's progress."""
    ui.add_css(style())
    with ui.element("div"):
        with ui.element("h1"):
            ui.label(say("lesson.title"))
        ui.label(say("lesson.intro")).classes("soft")
    with ui.element("ol").classes("cards"):
        for number in range(1, COUNT + 1):
            _card(number, progress)


def _card(number: int, progress: LessonProgress) -> None:
    taught, done = lesson(number), progress.done(number)
    with ui.element("li"), ui.link(target=f"/lessons/{number}").classes("card"):
        ui.label(str(number)).classes("number")
        with ui.element("h2"):
            ui.label(taught.title)
        ui.label(taught.goal).classes("soft")
        with ui.element("div").classes("state over" if progress.is_over(number) else "state"):
            bits(len(taught.steps), done)
            ui.label(_state(number, progress))


def _state(number: int, progress: LessonProgress) -> str:
    if progress.is_over(number):
        return say("lesson.over")
    done = progress.done(number)
    return say("lesson.go-on", step=done + 1) if done else say("lesson.steps", count=len(lesson(number).steps))


def bits(count: int, done: int, now: int | None = None) -> None:
    """Draw a bar with an element for each step, in addition to the text."""
    with ui.element("div").classes("bits").props("aria-hidden=true"):
        for place in range(count):
            ui.element("i").classes(f"{'done' if place < done else ''} {'now' if place == now else ''}")


@cache
def style() -> str:
    """Return the style of the lessons' pages and pictures."""
    own = (files(__package__) / "lessons.css").read_text(encoding="utf-8")
    return own + (files("robochoc.app.lessons") / "picture.css").read_text(encoding="utf-8")


def build_lesson(number: str, progress: LessonProgress) -> None:
    """Fill the current container with the lesson of this number, at the user's current step."""
    ui.add_css(style())
    if number in map(str, range(1, COUNT + 1)):
        _Page(int(number), progress)
        return
    with ui.element("h1"):
        ui.label(say("lesson.no-lesson"))
    ui.link(say("lesson.all"), "/lessons")


class _Page:
    """The page of a lesson: the current step, and the user's choices in it."""

    def __init__(self, number: int, progress: LessonProgress) -> None:
        self._number = number
        self._lesson = lesson(number)
        self._client = ui.context.client  # a clicked element is deleted while its click is being handled
        self._progress = progress
        self._place = 0 if progress.is_over(number) else progress.done(number)
        self._chosen: list[AnswerChoice] = []
        ui.link(say("lesson.all"), "/lessons")
        self._head = ui.element("div").classes("lesson-head")
        self._body = ui.element("div").classes("lesson")
        self._announcement = ui.label().classes("heard-only").props("role=status aria-live=polite")
        ui.keyboard(self._pressed, repeating=False, ignore=["input", "select", "textarea"])
        self._show()

    @property
    def _is_end(self) -> bool:
        return self._place == len(self._lesson.steps)

    @property
    def _step(self) -> LessonStep:
        return self._lesson.steps[self._place]

    @property
    def _is_answered(self) -> bool:
        return any(choice.right for choice in self._chosen)

    # Events

    def _choose(self, choice: AnswerChoice) -> None:
        if choice in self._chosen or self._is_answered:
            return
        self._chosen.append(choice)
        said = say("lesson.right" if choice.right else "lesson.wrong")
        if choice.right:
            self._progress.answered(self._number, self._place)
        self._show()
        self._announcement.set_text(f"{said} {choice.why}")
        if choice.right:
            self._focus(self._onward)
        else:
            self._focus(self._buttons[self._step.choices.index(choice)])

    def _go(self, by: int) -> None:
        self._place += by
        self._chosen = []
        self._show()
        self._announcement.set_text(self._where())
        self._focus(self._heading)

    def _restart(self) -> None:
        self._progress.restart(self._number)
        self._go(-self._place)

    def _pressed(self, event: KeyEventArguments) -> None:
        number = event.key.number
        held = event.modifiers.ctrl or event.modifiers.alt or event.modifiers.meta
        if event.action.keydown and not held and not self._is_end and number:
            for choice in self._step.choices[number - 1 : number]:
                self._choose(choice)

    def _focus(self, element: ui.element) -> None:
        """Move the keyboard focus to `element` once the browser has drawn it."""
        found = f"document.getElementById('{element.html_id}')"
        again = "left && setTimeout(() => look(left - 1), 20)"
        self._client.run_javascript(f"(function look(left) {{ const it = {found}; it ? it.focus() : {again}; }})(100)")

    # Content

    def _where(self) -> str:
        if self._is_end:
            return say("lesson.end")
        place = say("lesson.place", step=self._place + 1, count=len(self._lesson.steps))
        return f"{place}: {self._step.title}"

    def _show(self) -> None:
        self._head.clear()
        with self._head:
            ui.label(say("lesson.heading", number=self._number, title=self._lesson.title)).classes("soft")
            self._heading = ui.element("h1").props("tabindex=-1")
            with self._heading:
                ui.label(say("lesson.end") if self._is_end else self._step.title)
            with ui.element("div").classes("place"):
                bits(len(self._lesson.steps), self._place + self._is_answered, self._place)
                if not self._is_end:
                    ui.label(say("lesson.place", step=self._place + 1, count=len(self._lesson.steps))).classes("soft")
        self._body.clear()
        with self._body:
            if self._is_end:
                self._end()
            else:
                self._stage()
                self._question()

    def _stage(self) -> None:
        moment = (after if self._is_answered else before)(self._number, self._step)
        with ui.element("section").classes("panel stage"):
            ui.html(picture(self._lesson.team_of(self._step), moment), sanitize=False)
            _messages(moment)

    def _question(self) -> None:
        with ui.element("section").classes("panel"):
            ui.label(self._step.text).classes("prose")
            with ui.element("h2").classes("ask"):
                ui.label(self._step.ask)
            ui.label(say("lesson.choose", count=len(self._step.choices))).classes("soft")
            with ui.element("ol").classes("choices"):
                self._buttons = [self._choice(place, choice) for place, choice in enumerate(self._step.choices, 1)]
            with ui.element("div").classes("moves"):
                back = ui.button(say("lesson.back"), on_click=lambda: self._go(-1)).props("flat no-caps")
                back.set_enabled(self._place > 0)
                last = self._place == len(self._lesson.steps) - 1
                self._onward = ui.button(say("lesson.finish" if last else "lesson.next"), on_click=lambda: self._go(1))
                self._onward.props("unelevated no-caps").set_enabled(self._is_answered)

    def _choice(self, place: int, choice: AnswerChoice) -> ui.element:
        chosen = choice in self._chosen
        kind = ("right" if choice.right else "wrong") if chosen else ""
        with ui.element("li"):
            button = ui.element("button").props("type=button").classes(kind).on("click", lambda: self._choose(choice))
            with button:
                ui.label(str(place)).classes("key")
                ui.label(choice.shown)
            if chosen:
                self._why(choice, kind)
        return button

    def _why(self, choice: AnswerChoice, kind: str) -> None:
        with ui.element("div").classes("why"):
            with ui.element("b").classes(f"{kind}-text"):
                ui.label(say(f"lesson.{kind}"))
            ui.label(choice.why)
        own = reasons(self._number, self._step) if choice.right else ()
        if own:
            with ui.element("div").classes("own"):
                ui.label(say("lesson.reasons"))
                with ui.element("ul"):
                    for reason in own:
                        with ui.element("li"):
                            ui.label(reason)

    def _end(self) -> None:
        last = self._lesson.steps[-1]
        with ui.element("section").classes("panel stage"):
            ui.html(picture(self._lesson.team_of(last), after(self._number, last)), sanitize=False)
        with ui.element("section").classes("panel"):
            ui.label(self._lesson.end).classes("prose")
            with ui.element("div").classes("moves"):
                ui.button(say("lesson.again"), on_click=self._restart).props("flat no-caps")
                if self._number < COUNT:
                    following = say("lesson.next-lesson", title=lesson(self._number + 1).title)
                    ui.link(following, f"/lessons/{self._number + 1}")
                else:
                    ui.link(say("lesson.all"), "/lessons")


def _messages(moment: LessonMoment) -> None:
    if not moment.messages:
        return
    with ui.element("div").classes("said"):
        ui.label(say("lesson.heard")).classes("soft")
        with ui.element("ul"):
            for message in moment.messages:
                with ui.element("li"):
                    ui.label(say("lesson.says", sender=message.sender, to=message.to)).classes("soft")
                    ui.label(f"“{message.words}”")
