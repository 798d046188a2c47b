"""The group of commands, and the exit status of errors."""

from __future__ import annotations

import os
import signal
from pkgutil import resolve_name

import click

from robochoc import __version__
from robochoc.system.posix import IS_POSIX, REQUIREMENT

INTERRUPTED = 128 + signal.SIGINT
UNREAD = 128 + getattr(signal, "SIGPIPE", 13)
EXIT_STATUS = """\b
Exit status:
  0  a verdict was reached (also no-solution)
  1  the input is invalid
  2  wrong usage, or a request that this version does not support
  3  a limit was reached before a verdict
  4  robots were lost, an answer was refuted, or a replay differs
"""


COMMANDS = {
    "animate": ("animate", "Write or show the 3D scene of a saved result."),
    "app": ("app", "Model, solve and fly in a browser, without formulas."),
    "authority": ("authority", "Enrol and revoke robots for runs on several machines."),
    "cache": ("cache", "Show or clear the cache of solved local problems."),
    "capacity": ("capacity", "Measure the largest team that this machine solves in time."),
    "check": ("check", "Explore every order of messages on small teams."),
    "compare": ("compare", "Compare protocols on problems: a table, a picture."),
    "compile": ("compile_team", "Compile the robots' local problems and show their sizes."),
    "completion": ("completion", "Print the completion script for bash, zsh or fish."),
    "demo": ("demo", "Solve a first problem and show the flight, without files."),
    "directory": ("directory", "List the agents of a running master, and their services."),
    "experiment": ("experiment", "Run studies of protocols and report their results."),
    "export": ("export", "Write a team's problem for other tools, or as a graph."),
    "fly": ("fly", "Simulate the flight of a saved result: 3D scene, ROS."),
    "generate": ("generate", "Write a team of a problem family."),
    "import": ("import_", "Convert files of FRODO, pyDCOP, XCSP3, ... to teams."),
    "journal": ("journal", "Summarise or export a journal."),
    "leaderboard": ("leaderboard", "Compare protocols on the benchmark set."),
    "master": ("master", "Lead a team whose robots run on other machines."),
    "play": ("play", "Play a team in rounds: programs, people and protocols."),
    "privacy": ("privacy", "Measure how much robots learned about each other in a run."),
    "protocols": ("protocols", "List the installed protocols, or explain one."),
    "replay": ("replay", "Replay a journal and compare it with the installed protocol."),
    "rmf": ("rmf", "Exchange tasks with Open-RMF: dispatch, bid, request."),
    "robot": ("robot", "Run one robot on this machine, led by a master."),
    "serve": ("serve", "Solve teams on request: a ROS 2 service."),
    "sniff": ("sniff", "Show and explain the messages of a run on a page."),
    "solve": ("solve", "Solve teams, each robot in its own process."),
    "validate": ("validate", "Check teams and print errors with file and line."),
}
"""Each command: the name of its function in the module with the same name, and its line in `robochoc --help`.

The lines are stored here so that `robochoc --help` need not import any command.
"""


POSIX_COMMANDS = frozenset(
    [
        *("app", "authority", "capacity", "compare", "directory", "experiment", "leaderboard", "master", "play"),
        *("rmf", "robot", "serve", "sniff"),
    ]
)
"""The commands that start or signal other processes, lock files, or use a network."""


class Commands(click.Group):
    """The group of commands. Each command is imported when it is needed."""

    def list_commands(self, ctx: click.Context) -> list[str]:  # noqa: ARG002 - click's
        """Return all names, sorted."""
        return [*COMMANDS]

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:  # noqa: ARG002 - click's
        """Return the command with this name, or None."""
        if cmd_name not in COMMANDS:
            return None
        command: click.Command = resolve_name(f"robochoc.cli.commands.{cmd_name}:{COMMANDS[cmd_name][0]}")
        return command

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:  # noqa: ARG002 - click's
        """Write a line for each command, without importing the commands."""
        with formatter.section("Commands"):
            formatter.write_dl([(name, line) for name, (_, line) in COMMANDS.items()])

    def resolve_command(
        self, ctx: click.Context, args: list[str]
    ) -> tuple[str | None, click.Command | None, list[str]]:
        """Resolve the command. For an unknown name, suggest a similar one. On Windows, refuse `POSIX_COMMANDS`."""
        if args[0] in POSIX_COMMANDS and not IS_POSIX:
            raise click.UsageError(f"robochoc {args[0]} {REQUIREMENT}.", ctx)
        try:
            return super().resolve_command(ctx, args)
        except click.UsageError as error:
            import difflib

            from robochoc.system import pydcop_words

            if instead := pydcop_words.COMMANDS.get(args[0]):
                why = instead.removeprefix("none: ")
                rest = f"use {instead} instead" if why == instead else f"there is no counterpart: {why}"
                text = f"No such command {args[0]!r}, which pyDCOP has; {rest}."
                raise click.UsageError(text, ctx) from None
            near = difflib.get_close_matches(args[0], COMMANDS, 1)
            if not near:
                raise
            raise click.UsageError(f"{error.message} Did you mean {near[0]!r}?", ctx) from None


def _print_version(context: click.Context, _: click.Parameter, asked: bool) -> None:  # noqa: FBT001 - click's own
    """Print the version, and whether the core is compiled."""
    if asked and not context.resilient_parsing:
        from robochoc.system.compiled_core import kind_of_core

        click.echo(f"robochoc {__version__} ({kind_of_core()})")
        context.exit()


@click.group(
    cls=Commands, context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 100}, epilog=EXIT_STATUS
)
@click.option(
    "--version",
    is_flag=True,
    expose_value=False,
    is_eager=True,
    callback=_print_version,
    help="Show the version and exit.",
)
def cli() -> None:
    """Distributed constraint solving by teams of robots.

    Each robot reads only its own XML file, runs in its own OS process, and exchanges messages of a distributed protocol
    with its neighbours. The team finds a solution (with costs: an optimum) or proves that there is none.

    \b
    robochoc generate queens3d --n 4
    robochoc validate
    robochoc solve instances/
    """  # noqa: D301 - \\b keeps click from wrapping the lines


def run() -> int:
    """Run the command line, and return the exit status (docs/reference/cli.md); foreseen errors show no traceback."""
    try:
        status = cli.main(prog_name="robochoc", standalone_mode=False)
    except click.ClickException as error:
        error.show()
        return error.exit_code
    except (click.Abort, KeyboardInterrupt):
        click.echo("robochoc: interrupted", err=True)
        return INTERRUPTED
    except SystemExit as end:
        # The reader of our output has closed the pipe: click would exit with the status for invalid input.
        if end.code == 1:
            return UNREAD
        raise
    except OSError as error:
        from robochoc.system.plain_text import on_one_line

        text = f"{os.fsdecode(error.filename)}: {error.strerror}" if isinstance(error.filename, str | bytes) else error
        click.echo(on_one_line(f"robochoc: {text}"), err=True)
        return 1
    return status if isinstance(status, int) else 0
