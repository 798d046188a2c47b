"""The group of commands, and the exit status of whatever they run into."""

from __future__ import annotations

import signal

import click

from robochoc import __version__
from robochoc.cli.animate import animate
from robochoc.cli.authority import authority
from robochoc.cli.cache import cache
from robochoc.cli.compile import compile_team
from robochoc.cli.directory import directory
from robochoc.cli.export import export
from robochoc.cli.fly import fly
from robochoc.cli.generate import generate
from robochoc.cli.journal import journal
from robochoc.cli.master import master
from robochoc.cli.protocols import protocols
from robochoc.cli.replay import replay
from robochoc.cli.robot import robot
from robochoc.cli.sniff import sniff
from robochoc.cli.solve import solve
from robochoc.cli.validate import validate

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


@click.group(context_settings={"help_option_names": ["-h", "--help"]}, epilog=EXIT_STATUS)
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


for command in (
    solve,
    validate,
    generate,
    animate,
    fly,
    sniff,
    compile_team,
    export,
    replay,
    journal,
    cache,
    protocols,
    authority,
    master,
    robot,
    directory,
):
    cli.add_command(command)


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
        click.echo(f"robochoc: {error}", err=True)
        return 1
    return status if isinstance(status, int) else 0
