"""The group of commands, and the exit status of whatever they run into."""

from __future__ import annotations

import os
import signal
from pkgutil import resolve_name

import click

from robochoc import __version__

INTERRUPTED = 128 + signal.SIGINT
UNREAD = 128 + signal.SIGPIPE
EXIT_STATUS = """\b
Exit status:
  0  a verdict was reached (no-solution is one)
  1  the input is invalid
  2  wrong usage, or more than this version can do
  3  a limit was reached without a verdict
  4  robots were lost, the answer was refuted, or a replay is different
"""


COMMANDS = {
    "animate": ("animate", "Make the 3D scene of a saved result or journal."),
    "authority": ("authority", "Say who may take part on several machines: enrol, list, revoke."),
    "cache": ("cache", "Show or clear the cache of solved local problems."),
    "compile": ("compile_team", "Compile robots' local problems, and show what they come to."),
    "directory": ("directory", "Ask a running master who is there, and offers what."),
    "export": ("export", "Write a team's whole problem for other solvers."),
    "fly": ("fly", "Fly a saved result: simulated drones, a page, ROS."),
    "generate": ("generate", "Write a team of a known family."),
    "journal": ("journal", "What is in a journal, and exports of it."),
    "master": ("master", "Lead a team whose robots are on machines of their own."),
    "protocols": ("protocols", "List the protocols that are installed, or explain one."),
    "replay": ("replay", "Play a journal again, and say where the protocol does something else."),
    "robot": ("robot", "Be one robot, on its own machine, in a master's run."),
    "sniff": ("sniff", "Look into what robots said: a page on this machine."),
    "solve": ("solve", "Solve teams, each robot in its own process."),
    "validate": ("validate", "Check teams, and tell every mistake with file and line."),
}
"""Of each command its function in the module of its name, and its line in `robochoc --help`, which imports none."""


class Commands(click.Group):
    """The commands, each imported when it is asked for: nobody waits for the others."""

    def list_commands(self, ctx: click.Context) -> list[str]:  # noqa: ARG002 - click's
        """All names, sorted."""
        return [*COMMANDS]

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:  # noqa: ARG002 - click's
        """The command of that name, if there is one."""
        if cmd_name not in COMMANDS:
            return None
        command: click.Command = resolve_name(f"robochoc.cli.commands.{cmd_name}:{COMMANDS[cmd_name][0]}")
        return command

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:  # noqa: ARG002 - click's
        """Write a line for each command, as click does, without importing any."""
        with formatter.section("Commands"):
            formatter.write_dl([(name, line) for name, (_, line) in COMMANDS.items()])

    def resolve_command(
        self, ctx: click.Context, args: list[str]
    ) -> tuple[str | None, click.Command | None, list[str]]:
        """As click's, and says what may have been meant."""
        try:
            return super().resolve_command(ctx, args)
        except click.UsageError as error:
            import difflib

            near = difflib.get_close_matches(args[0], COMMANDS, 1)
            if not near:
                raise
            raise click.UsageError(f"{error.message} Did you mean {near[0]!r}?", ctx) from None


@click.group(cls=Commands, context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 100}, epilog=EXIT_STATUS)
@click.version_option(__version__, prog_name="robochoc")
def cli() -> None:
    """Teams of robots that solve constraint problems together.

    Each robot knows only its own XML file, runs as its own OS process, and talks to its neighbours by messages of
    a distributed protocol until the team has a solution, the cheapest one where there are costs, or a
    proof that there is none.

    \b
    robochoc generate queens3d --n 4
    robochoc validate
    robochoc solve instances/
    """  # noqa: D301 - \\b is how click is told to leave the lines as they are


def run() -> int:
    """Run the command line, and return the exit status that FORMAT.md promises; never a traceback."""
    try:
        status = cli.main(standalone_mode=False)
    except click.ClickException as error:
        error.show()
        return error.exit_code
    except (click.Abort, KeyboardInterrupt):
        click.echo("robochoc: interrupted", err=True)
        return INTERRUPTED
    except SystemExit as leaving:
        # Whoever read our output has gone: click answers that with the status of invalid input.
        if leaving.code == 1:
            return UNREAD
        raise
    except OSError as error:
        from robochoc.system.plain_text import on_one_line

        told = f"{os.fsdecode(error.filename)}: {error.strerror}" if isinstance(error.filename, str | bytes) else error
        click.echo(on_one_line(f"robochoc: {told}"), err=True)
        return 1
    return status if isinstance(status, int) else 0
