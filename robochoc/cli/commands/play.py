"""`robochoc play`: plays a team in rounds, with outside programs, protocols and baselines as players."""

from __future__ import annotations

import shlex
from pathlib import Path
from typing import TYPE_CHECKING

import click

from robochoc.cli.options.paths import TeamFolder, refuse_same_places
from robochoc.cli.options.recording import journal_option, recording
from robochoc.cli.options.sections import COMMON, SectionedCommand, Sections
from robochoc.cli.options.value_types import Number, Seed, WholeNumber
from robochoc.cli.reports.failures import LOST, USAGE, Failure, errors_as_failures, invalid_input_fails

if TYPE_CHECKING:
    from robochoc.journal.recorder import JournalRecorder
    from robochoc.model.problem import Team
    from robochoc.seats import GameOptions, GameReport

MOST_ROUNDS = 1_000_000
"""The limit in `seats/game.py`, repeated here because that module is not imported at the start."""

_SECTIONS: Sections = {
    COMMON: ("--seat", "--mcp", "--player", "--others", "--rounds", "--seed", "--journal", "--json", "--help"),
    "Limits on programs": ("--timeout", "--texts", "--characters"),
    "Evaluation": ("--optimum", "--coalition"),
}


@click.command(cls=SectionedCommand, sections=_SECTIONS)
@click.argument("team", type=TeamFolder(), metavar="TEAM")
@click.option(
    "--seat", "seats", multiple=True, metavar="ROBOT=COMMAND",
    help="Let a program play ROBOT. It reads and writes JSON lines.",
)  # fmt: skip
@click.option(
    "--mcp", "mcps", multiple=True, metavar="ROBOT",
    help="Let an MCP client play ROBOT over standard input and output, without a time limit.",
)  # fmt: skip
@click.option(
    "--player", "players", multiple=True, metavar="ROBOT=PLAYER",
    help="Player of ROBOT: random, greedy, optimal, script:0,2,1 (indices of values), or a protocol.",
)  # fmt: skip
@click.option("--others", default="dsa", show_default=True, metavar="PLAYER", help="Player of all other robots.")
@click.option(
    "--rounds", type=WholeNumber(1, MOST_ROUNDS), default=20, show_default=True, metavar="N", help="Number of rounds."
)
@click.option("--seed", type=Seed(), default=0, show_default=True, metavar="N", help="Seed of all but programs.")
@click.option(
    "--timeout", type=Number(0, min_open=True), default=30, show_default=True, metavar="SECONDS",
    help="Time for the moves of all programs in a round.",
)  # fmt: skip
@click.option(
    "--texts", type=WholeNumber(0), default=8, show_default=True, metavar="N",
    help="Maximum number of messages of a robot in a round, besides its announced value.",
)  # fmt: skip
@click.option(
    "--characters", type=WholeNumber(0), default=20_000, show_default=True, metavar="N",
    help="Maximum number of characters of all texts of a robot.",
)  # fmt: skip
@click.option(
    "--optimum", default="central", show_default=True, metavar="PROTOCOL",
    help="Complete protocol that certifies the optimum; none: no regret.",
)  # fmt: skip
@click.option(
    "--coalition", "coalitions", multiple=True, metavar="ROBOT,ROBOT",
    help="Report the joint regret of these robots. The robots of all programs are always a group.",
)  # fmt: skip
@journal_option
@click.option("--json", "as_json", is_flag=True, help="Print one JSON object.")
@invalid_input_fails
def play(  # noqa: PLR0913 - options, by name
    team: Path,
    *,
    seats: tuple[str, ...],
    mcps: tuple[str, ...],
    players: tuple[str, ...],
    others: str,
    rounds: int,
    seed: int,
    timeout: float,
    texts: int,
    characters: int,
    optimum: str,
    coalitions: tuple[str, ...],
    journal: Path | None,
    as_json: bool,
) -> None:
    """Play TEAM in rounds. In each round, all robots choose a value at the same time, and announce it to neighbours.

    A robot is played by an outside program (--seat), such as an agent with a language model or an interface for a
    person, by a built-in player, or by a protocol. The report has the regret to the certified optimum, messages and
    tokens, what was disclosed, lies, and broken rules. A program that is late, ends or breaks a rule loses its move;
    the game goes on. Exit status: 0 if the game was played to its end, whatever the players did; 4 if an MCP client
    left before.

    \b
    robochoc play out/team --others random                a baseline
    robochoc play out/team --seat r1='python agent.py'    a program among robots of DSA
    robochoc play out/team --mcp r1                       a seat for an MCP client
    """  # noqa: D301 - \\b keeps click from wrapping the lines
    from robochoc.formats import on_one_line, read_team
    from robochoc.seats import GameOptions, Limits, header_of, play
    from robochoc.seats.moves import PlayerError

    if len(mcps) > 1:
        raise Failure(USAGE, f"--mcp is given {len(mcps)} times: one client plays one robot")
    if mcps and as_json:
        raise Failure(USAGE, "--mcp cannot be used with --json: the client receives the report")
    refuse_same_places({"--journal": journal}, teams=(team,))
    commands = {name: _words(name, text) for name, text in _pairs("--seat", seats).items()}
    options = GameOptions(
        commands=commands,
        players=_pairs("--player", players),
        others=others,
        rounds=rounds,
        seed=seed,
        limits=Limits(timeout_s=timeout, messages=texts, characters=characters),
        optimum=None if optimum == "none" else optimum,
        coalitions=tuple(map(_coalition, coalitions)),
    )
    problem = read_team(team)
    with recording(journal, lambda: header_of(problem, options)) as recorder:
        with errors_as_failures(team):
            try:
                if mcps:
                    _serve(problem, mcps[0], options, recorder)
                    return
                report = play(problem, options, recorder)
            except PlayerError as refused:
                place = _option(refused.robots[0], options)
                raise Failure(USAGE, on_one_line(f"{place}: {refused.reason}")) from refused
        _print(report, as_json=as_json)


def _serve(team: Team, robot: str, options: GameOptions, recorder: JournalRecorder | None) -> None:
    """Let an MCP client play `robot`, until it closes the connection. The report also goes to standard error.

    If the client leaves early, the report is about the rounds that were played.

    Raises:
        Failure: if the client leaves before the end of the game.
    """
    from robochoc import __version__
    from robochoc.cli.reports.play import game_lines
    from robochoc.seats.mcp_server import ClientLines, seat_server
    from robochoc.seats.seat_game import SeatGame

    game, lines = SeatGame(team, robot, options, recorder), ClientLines()
    try:
        seat_server(game, options.limits, game_lines, __version__, lines).run()
    finally:
        game.close()
    report = game.report_so_far()
    for line in game_lines(report) if report else ():
        click.echo(line, err=True)
    if game.report is None:
        why = f": {lines.error}" if lines.error else ""
        result = "so the report is partial" if report else "so there is no report"
        raise Failure(LOST, f"the MCP client left in round {game.round} of {game.rounds}, {result}{why}")


def _print(report: GameReport, *, as_json: bool) -> None:
    from robochoc.cli.reports.play import game_json, print_game

    if as_json:
        click.echo(game_json(report))
    else:
        print_game(report)


def _pairs(option: str, given: tuple[str, ...]) -> dict[str, str]:
    """Return the values of an option by robot."""
    found: dict[str, str] = {}
    for one in given:
        name, equals, value = one.partition("=")
        if not (name and equals and value):
            raise Failure(USAGE, f"{option} {one!r} is not of the form ROBOT=...: write for example {option} r1=...")
        if name in found:
            raise Failure(USAGE, f"{option} names {name} twice")
        found[name] = value
    return found


def _option(robot: str, options: GameOptions) -> str:
    """Return the option that names the player of a robot, in words."""
    if robot in options.commands:
        return f"--seat {robot}"
    return f"--player {robot}" if robot in options.players else f"--others {options.others}"


def _coalition(text: str) -> tuple[str, ...]:
    """Return the names of the robots in a coalition."""
    names = tuple(text.split(","))
    if not all(names):
        raise Failure(USAGE, f"--coalition {text!r} has an empty name: write for example --coalition r1,r2")
    return names


def _words(name: str, command: str) -> list[str]:
    """Return the words of a command."""
    try:
        words = shlex.split(command)
    except ValueError as error:
        raise Failure(USAGE, f"--seat {name}: the command cannot be read: {error}") from None
    if not words:
        raise Failure(USAGE, f"--seat {name}: the command is empty")
    return words
