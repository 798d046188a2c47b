"""The page "Play": a person plays one robot of the team in rounds, and sees the regret at the end."""

from __future__ import annotations

from functools import cache
from importlib.resources import files

from nicegui import ui

from robochoc.app.pages.background_query import ErrorText, run_query
from robochoc.app.pages.widgets import bounded_integer
from robochoc.app.projects import Project
from robochoc.app.sketch.building import saved_team
from robochoc.app.sketch.checks import errors_of
from robochoc.app.texts import say
from robochoc.formats import read_team
from robochoc.model.cost_units import cost_shown
from robochoc.model.problem import Team
from robochoc.seats import GameOptions, GameReport, Limits
from robochoc.seats.moves import Breach
from robochoc.seats.seat_game import SeatGame, value_text
from robochoc.solver.errors import UnsupportedError

PLAYERS = ("greedy", "dsa", "mgm", "random", "optimal")
MOST_ROUNDS = 50
_ROUNDS = 5
_LIMITS = Limits(messages=1, characters_each=500)


def build_seat(project: Project) -> None:
    """Fill the current container with the page."""
    ui.add_css(_style())
    with ui.element("div"):
        _heading("h1", say("seat.title"))
        ui.label(say("seat.intro")).classes("soft")
    names = _robots(project)
    if not names:
        with ui.element("div").classes("panel"):
            ui.label(say("seat.empty"))
            ui.link(say("seat.empty-remedy"), f"/team/{project.id}/model")
        return
    SeatPage(project, names)


def _robots(project: Project) -> list[str]:
    if project.files:
        return [robot.name for robot in project.facts.robots]
    return [robot.name for robot in project.sketch.robots] if project.sketch.decisions else []


class RunningGame:
    """The game of a team. It continues when its page is closed or loaded again, until a new one is started.

    Attributes:
        game: The game; None before the first one.
        playing: True while a round is played.
    """

    def __init__(self, _: Project) -> None:
        self.game: SeatGame | None = None
        self.playing = False

    def replace(self, game: SeatGame | None) -> None:
        """End the game, and continue with another one."""
        if self.game is not None and not self.playing:
            self.game.close()
        self.game = game


class SeatPage:
    """The page in one browser tab. All pages of a team show the same game."""

    def __init__(self, project: Project, names: list[str]) -> None:
        self._project = project
        self._running = project.part(RunningGame)
        self._shown: tuple[SeatGame, int] | None = None
        self._client = ui.context.client
        label = f'aria-label="{say("seat.title")}"'
        with ui.element("div").classes("seat"), ui.element("section").classes("panel wide").props(label):
            with ui.element("div").classes("seat-row"):
                self._robot = ui.select(names, value=names[0], label=say("seat.robot"))
                players = {name: say(f"seat.{name}") for name in PLAYERS}
                self._others = ui.select(players, value=PLAYERS[0], label=say("seat.others"))
                for field in (self._robot, self._others):
                    field.props("dense outlined options-dense").classes("grow")
                self._rounds = ui.number(say("seat.rounds"), value=_ROUNDS, min=1, max=MOST_ROUNDS, precision=0)
                self._rounds.props("dense outlined")
            self._start = ui.button(say("seat.start"), on_click=self._begin, color=None)
            self._start.props("no-caps unelevated").classes("go")
            self._message = ui.label().props("role=status")
            self._error = ui.label().classes("error").props("role=alert")
        self._board = ui.element("div").classes("seat")
        game = self._running.game
        if game is not None:
            if game.robot in names:
                self._robot.set_value(game.robot)
            self._rounds.set_value(game.rounds)
            self._show(())

    # Events

    async def _begin(self) -> None:
        self._running.replace(None)
        self._error.set_text("")
        self._message.set_text(say("seat.starting"))
        self._start.set_enabled(False)
        rounds = bounded_integer(self._rounds.value, 1, MOST_ROUNDS, otherwise=_ROUNDS)
        options = GameOptions(others=str(self._others.value), rounds=rounds, limits=_LIMITS)
        game = await run_query(_new_game, self._project, str(self._robot.value), options)
        if game is None:
            return
        self._message.set_text("")
        self._start.set_enabled(True)
        if isinstance(game, ErrorText):
            self._error.set_text(str(game))
            self._board.clear()
            return
        self._running.replace(game)
        self._show(())

    async def _end_turn(self) -> None:
        running, game = self._running, self._running.game
        if game is None or running.playing or not self._turn.enabled:
            return
        if self._shown != (game, game.round) or game.report is not None:
            self._show(())
            self._error.set_text(say("seat.elsewhere"))
            return
        self._turn.set_enabled(False)
        text = str(self._text.value or "").strip()
        texts = [(str(self._to.value), text)] if text and self._to.value else []
        running.playing = True
        broken = await run_query(game.play, self._value.value, None, texts)
        running.playing = False
        if broken is None or game is not running.game:
            return
        if isinstance(broken, ErrorText):
            self._error.set_text(str(broken))
        else:
            self._show(broken)

    # Content

    def _show(self, broken: tuple[Breach, ...]) -> None:
        game = self._running.game
        if game is None:
            return
        self._shown = game, game.round
        self._start.set_text(say("seat.again"))
        self._error.set_text(" ".join(say("seat.broken", rule=one.rule, details=one.details) for one in broken))
        self._board.clear()
        with self._board:
            if game.report is None:
                self._show_round(game)
            else:
                _show_report(game, game.report)
        self._client.run_javascript("document.querySelector('.seat-heading')?.focus()")

    def _show_round(self, game: SeatGame) -> None:
        with ui.element("section").classes("panel"):
            _heading("h2", say("seat.round", round=game.round, rounds=game.rounds), focused=True)
            _heading("h3", say("seat.choose"))
            ui.label(say("seat.choose-hint")).classes("soft small")
            costs = game.costs()
            options = {index: _priced(value_text(game.values[index]), costs[index]) for index in range(len(costs))}
            with ui.element("div").classes("seat-values"):
                self._value = ui.radio(options, value=costs.index(min(costs)))
                self._value.props(f'aria-label="{say("seat.choose")}"')
            with ui.element("div").classes("seat-row"):
                self._to = ui.select([*game.neighbours], value=next(iter(game.neighbours), None), label=say("seat.to"))
                self._to.props("dense outlined options-dense").classes("grow")
                self._text = ui.input(say("seat.text")).props(f"dense outlined maxlength={_LIMITS.characters_each}")
                self._text.classes("grow").on("keydown.enter", self._end_turn)
            self._turn = ui.button(say("seat.end"), on_click=self._end_turn, color=None)
            self._turn.props("no-caps unelevated").classes("go")
        with ui.element("section").classes("panel"):
            _heading("h3", say("seat.neighbours"))
            _show_messages(game)
            _heading("h3", say("seat.problem"))
            ui.label(game.problem).classes("seat-problem soft").props("tabindex=0")


def _new_game(project: Project, robot: str, options: GameOptions) -> SeatGame:
    """Start a game. Raises the errors that a page can show."""
    return SeatGame(_team(project), robot, options)


def _team(project: Project) -> Team:
    if project.files:
        return read_team(project.files.folder)
    for trouble in errors_of(project.sketch):
        raise UnsupportedError(trouble.text)
    return saved_team(project.sketch)


def _priced(value: str, cost: tuple[int, int | float]) -> str:
    broken, paid = cost
    return say("seat.value-broken" if broken else "seat.value", value=value, cost=f"{paid:g}", broken=broken)


def _show_messages(game: SeatGame) -> None:
    """Show the announced values and the texts of the neighbours."""
    if not game.neighbours:
        ui.label(say("seat.alone"))
        return
    lines = [say("seat.announced", robot=name, value=value_text(value)) for name, value in game.announced.items()]
    lines += [say("seat.says", robot=name, text=text) for name, text in game.messages]
    if not lines:
        ui.label(say("seat.nothing"))
    with ui.element("ul"):
        for text in lines:
            with ui.element("li"):
                ui.label(text)


def _show_report(game: SeatGame, report: GameReport) -> None:
    """Show the result of the team, the regrets, and the final choices."""
    optimum = "-" if report.optimum is None else cost_shown(report.optimum)
    with ui.element("section").classes("panel wide"):
        _heading("h2", say("seat.over"), focused=True)
        if report.optimum is None:
            ui.label(say("seat.no-optimum"))
        elif report.cost is None:
            ui.label(say("seat.violated", count=report.violations, optimum=optimum))
        else:
            ui.label(say("seat.cost", cost=cost_shown(report.cost), optimum=optimum))
        if report.regret is not None:
            ui.label(say("seat.regret", regret=cost_shown(report.regret)) if report.regret else say("seat.best"))
            own = report[game.robot].regret
            if own is not None:
                ui.label(say("seat.own-regret", regret=cost_shown(round(own, 3))))
        _heading("h3", say("seat.chosen"))
        with ui.element("ul"):
            for seat in report.seats:
                with ui.element("li"):
                    ui.label(say("seat.announced", robot=seat.robot, value=value_text(seat.value)))


def _heading(tag: str, text: str, *, focused: bool = False) -> None:
    with ui.element(tag) as heading:
        ui.label(text)
    if focused:
        heading.classes("seat-heading").props("tabindex=-1")


@cache
def _style() -> str:
    return (files(__package__) / "seat.css").read_text(encoding="utf-8")
