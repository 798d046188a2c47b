"""The robots' conversation in words: the last messages during a run, and a playback after the run."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from html import escape

from nicegui import run as background
from nicegui import ui
from nicegui.events import ValueChangeEventArguments

from robochoc.app.runs.options import JOURNAL
from robochoc.app.runs.player import SPEEDS, Player
from robochoc.app.runs.prepared_team import from_run
from robochoc.app.runs.run import Run
from robochoc.app.runs.tape import MessageWords, Tape, recorded
from robochoc.app.texts import say
from robochoc.formats import InvalidInputError
from robochoc.journal.entries import JournalError
from robochoc.modelling.errors import ModelError

TICK_S = 0.1
"""The interval in seconds at which a playback is drawn."""
_LISTED = 6
_ANSWERS_S = 20.0
"""The time limit in seconds for the browser's answer. Without an answer, nothing is played."""
_CALM = "matchMedia('(prefers-reduced-motion: reduce)').matches"


class ConversationPlayer:
    """The list of messages, with controls for a playback after the run.

    `draw` is called when the picture must be drawn again. `shown` is the moment to show.
    """

    def __init__(self, draw: Callable[[], None]) -> None:
        self._draw = draw
        self._run: Run | None = None
        self._tape: Tape | None = None
        self._player = Player(1)
        self._opened = self._loading = False
        self._ticked = 0.0
        with ui.element("section").classes("talk") as self._box:
            self._controls = ui.element("div").classes("controls").props("role=group")
            self._controls.props["aria-label"] = say("decide.talk-controls")
            with self._controls:
                self._build_controls()
            self._list = ui.html("", sanitize=False)
            self._timer = ui.timer(TICK_S, self._tick, active=False)
        self._controls.set_visibility(False)

    def _build_controls(self) -> None:
        self._back = _button("skip_previous", "decide.talk-back", lambda: self._move(-1))
        self._play = _button("play_arrow", "decide.talk-play", self._toggle)
        self._on = _button("skip_next", "decide.talk-on", lambda: self._move(1))
        self._slider = ui.slider(min=0, max=1, step=1, value=0, on_change=self._sought)
        self._slider.props["aria-label"] = say("decide.talk-controls")
        choices = {speed: say("decide.talk-times", times=f"{speed:g}") for speed in SPEEDS}
        self._speed = ui.select(choices, value=1.0, on_change=lambda event: self._player.set_speed(event.value))
        self._speed.props("dense borderless").props["aria-label"] = say("decide.talk-speed")
        self._where = ui.label("").classes("soft where")

    @property
    def shown(self) -> tuple[Tape, int] | None:
        """The conversation being played back, and the current moment. None: show the end of the run."""
        if self._tape is None or not self._opened or self._player.ended:
            return None
        return self._tape, self._player.moment

    @property
    def playing(self) -> bool:
        """True if the playback is running."""
        return self._player.playing

    def show_live(self, messages: Sequence[MessageWords]) -> None:
        """Show the last messages of a run in progress."""
        self._reset()
        self._controls.set_visibility(False)
        self._list.set_content(messages_html(messages[:_LISTED]))

    def set_run(self, run: Run | None) -> None:
        """Set the ended run to play back, or None if there is no run."""
        if run is self._run:
            return
        self._reset()
        self._run = run
        self._controls.set_visibility(run is not None)
        self._list.set_content(messages_html(run.live.last_messages[:_LISTED]) if run else "")
        self._refresh()

    def start(self) -> None:
        """Start the playback, unless the user prefers reduced motion in the browser."""
        with self._box:
            ui.timer(0, self._start, once=True)

    # Events

    async def _start(self) -> None:
        try:
            calm = await ui.run_javascript(_CALM, timeout=_ANSWERS_S)
        except TimeoutError:
            return
        if calm is False and not self._opened:
            await self._toggle()

    async def _open(self) -> bool:
        """Read the conversation if necessary, and return whether it is available."""
        run = self._run
        if self._tape is None and run is not None and not self._loading:
            self._loading = True
            self._where.set_text(say("decide.talk-reading"))
            tape = await background.io_bound(conversation_of, run, lambda: self._is_wanted(run))
            self._loading = False
            if not self._is_wanted(run):
                return False
            if tape is None:
                self._where.set_text(say("decide.talk-none"))
                return False
            self._tape, self._player = tape, Player(len(tape.moments))
            self._player.set_speed(self._speed.value)
            self._slider.props["max"] = self._player.count - 1
            self._slider.update()
        self._opened = self._tape is not None
        return self._opened

    def _is_wanted(self, run: Run) -> bool:
        return self._run is run and not self._box.is_deleted

    async def _toggle(self) -> None:
        if await self._open():
            self._player.toggle()
            self._ticked = time.monotonic()
            self._redraw()

    async def _move(self, by: int) -> None:
        first = not self._opened
        if await self._open():
            self._player.seek(self._player.count - 1 if first and by < 0 else self._player.moment)
            self._player.step(0 if first and by > 0 else by)
            self._redraw()

    async def _sought(self, event: ValueChangeEventArguments[float | None]) -> None:
        """Move to the slider's position. It is drawn at the next tick, since a slider moves more often."""
        if event.value != self._player.moment and await self._open():
            self._player.seek(event.value)
            self._timer.active = True

    def _tick(self) -> None:
        now = time.monotonic()
        self._player.advance(now - self._ticked)
        self._ticked = now
        self._redraw()

    def _reset(self) -> None:
        self._run = self._tape = None
        self._opened = False
        self._player = Player(1)
        self._timer.deactivate()

    # Content

    def _redraw(self) -> None:
        self._refresh()
        self._draw()

    def _refresh(self) -> None:
        player, tape = self._player, self._tape
        if player.playing is not self._timer.active:
            self._timer.active = player.playing
        self._play.props["icon"] = "pause" if player.playing else "play_arrow"
        self._play.props["aria-label"] = say("decide.talk-pause" if player.playing else "decide.talk-play")
        self._play.update()
        self._slider.set_enabled(tape is not None)
        if tape is None or not self._opened:
            self._where.set_text(say("decide.talk-offer"))
            return
        self._slider.set_value(player.moment)
        self._list.set_content(messages_html(tape.words_at(player.moment, _LISTED)))
        counts = {"number": f"{tape.messages_at(player.moment):,}", "all": f"{tape.messages:,}"}
        self._where.set_text(say("decide.talk-where" if tape.is_whole else "decide.talk-where-first", **counts))


def conversation_of(run: Run, wanted: Callable[[], bool] = lambda: True) -> Tape | None:
    """Return the conversation in a run, or None if it is not available, or no longer `wanted`.

    The function is slow: call it in a thread.
    """
    try:
        ready = from_run(run)
        tape = recorded(run.folder / JOURNAL, Tape(ready.robots, ready.label, ready.called), wanted)
    except (OSError, JournalError, ModelError, InvalidInputError, ValueError, TypeError, KeyError):
        return None
    return tape if tape.messages and wanted() else None


def messages_html(messages: Sequence[MessageWords]) -> str:
    """Return messages as a list, the last one first. Names and texts are escaped."""
    if not messages:
        return ""
    items = "".join(
        f'<li><span class="whom">{escape(one.sender)} → {escape(one.receiver)}</span> '
        f'<span class="kind">{escape(one.kind)}</span> <span class="words">{escape(one.words)}</span></li>'
        for one in messages
    )
    return f'<h2>{escape(say("decide.talk"))}</h2><ol class="said-list">{items}</ol>'


def _button(icon: str, key: str, does: Callable[[], object]) -> ui.button:
    button = ui.button(icon=icon, on_click=does, color=None).props("flat round dense")
    button.props["aria-label"] = say(key)
    return button
