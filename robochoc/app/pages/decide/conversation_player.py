"""What the robots say, in words: the last messages while they talk; afterwards all of it, played back."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from html import escape

from nicegui import run as background
from nicegui import ui
from nicegui.events import ValueChangeEventArguments

from robochoc.app.runs.conversation import conversation_of
from robochoc.app.runs.player import SPEEDS, Player
from robochoc.app.runs.run import Run
from robochoc.app.runs.tape import Said, Tape
from robochoc.app.texts import say

TICK_S = 0.1
"""A conversation that is played is drawn so often."""
_LISTED = 6
_ANSWERS_S = 20.0
"""A browser that takes longer to answer is busy enough."""
_CALM = "matchMedia('(prefers-reduced-motion: reduce)').matches"


class ConversationPlayer:
    """The list of messages, and below it, once the run is over, the controls that play it back.

    `draw` is called when the picture is to be drawn again: `shown` says which moment is to be seen.
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
        """The conversation that is played back, and the moment that is to be seen. None: what there is at the end."""
        if self._tape is None or not self._opened or self._player.ended:
            return None
        return self._tape, self._player.moment

    @property
    def playing(self) -> bool:
        """Whether the conversation that is played back goes on by itself."""
        return self._player.playing

    def tell(self, said: Sequence[Said]) -> None:
        """Show the last messages of a run that goes on."""
        self._forget()
        self._controls.set_visibility(False)
        self._list.set_content(said_html(said[:_LISTED]))

    def offer(self, run: Run | None) -> None:
        """Let a run that is over be played back; None: there is none."""
        if run is self._run:
            return
        self._forget()
        self._run = run
        self._controls.set_visibility(run is not None)
        self._list.set_content(said_html(run.live.said[:_LISTED]) if run else "")
        self._refresh()

    def begin(self) -> None:
        """Play it, unless the reader wants things to stand still."""
        with self._box:
            ui.timer(0, self._begin, once=True)

    # What happens

    async def _begin(self) -> None:
        try:
            calm = await ui.run_javascript(_CALM, timeout=_ANSWERS_S)
        except TimeoutError:
            return
        if calm is False and not self._opened:
            await self._toggle()

    async def _open(self) -> bool:
        """Read the conversation, the first time; return whether it is there."""
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
        """Go where the slider was moved; it is drawn at the next tick: a slider moves more often."""
        if event.value != self._player.moment and await self._open():
            self._player.seek(event.value)
            self._timer.active = True

    def _tick(self) -> None:
        now = time.monotonic()
        self._player.advance(now - self._ticked)
        self._ticked = now
        self._redraw()

    def _forget(self) -> None:
        self._run = self._tape = None
        self._opened = False
        self._player = Player(1)
        self._timer.deactivate()

    # What is shown

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
        self._list.set_content(said_html(tape.said_at(player.moment, _LISTED)))
        told = {"number": f"{tape.messages_at(player.moment):,}", "all": f"{tape.messages:,}"}
        self._where.set_text(say("decide.talk-where" if tape.is_whole else "decide.talk-where-first", **told))


def said_html(said: Sequence[Said]) -> str:
    """Return messages as a list, the last one first. All that robots say and are called is escaped in it."""
    if not said:
        return ""
    items = "".join(
        f'<li><span class="whom">{escape(one.sender)} → {escape(one.receiver)}</span> '
        f'<span class="kind">{escape(one.kind)}</span> <span class="words">{escape(one.words)}</span></li>'
        for one in said
    )
    return f'<h2>{escape(say("decide.talk"))}</h2><ol class="said-list">{items}</ol>'


def _button(icon: str, key: str, does: Callable[[], object]) -> ui.button:
    button = ui.button(icon=icon, on_click=does, color=None).props("flat round dense")
    button.props["aria-label"] = say(key)
    return button
