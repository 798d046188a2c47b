"""`robochoc`: the group of commands, and how it ends."""

from __future__ import annotations

import os
import signal
import sys
from types import FrameType
from typing import NoReturn

import click

from robochoc import __version__
from robochoc.cli.animate import animate
from robochoc.cli.generate import generate
from robochoc.cli.solve import solve
from robochoc.cli.validate import validate

EXIT_STATUS = """\b
Exit status:
  0  a verdict was reached (no-solution is one)
  1  the input is invalid
  2  wrong usage, or more than this version can do
  3  a limit was reached without a verdict
  4  robots were lost, or the answer was refuted
"""


@click.group(context_settings={"help_option_names": ["-h", "--help"]}, epilog=EXIT_STATUS)
@click.version_option(__version__, prog_name="robochoc")
def cli() -> None:
    """Teams of robots that solve constraint problems together.

    Each robot knows only its own XML file, runs as its own OS process, and talks to its neighbours by messages of
    a distributed protocol until the team has a solution, or a proof that there is none.

    \b
    robochoc generate queens3d --n 4
    robochoc validate
    robochoc solve instances/
    """  # noqa: D301 - \\b is how click is told to leave the lines as they are


for command in (solve, validate, generate, animate):
    cli.add_command(command)


def main() -> NoReturn:
    """Run the command line, and leave with the exit status that FORMAT.md promises; never with a traceback."""
    signal.signal(signal.SIGTERM, _terminated)
    try:
        status = cli.main(standalone_mode=False)
    except click.ClickException as error:
        error.show()
        status = error.exit_code
    except (click.Abort, KeyboardInterrupt):
        click.echo("robochoc: interrupted", err=True)
        status = 128 + signal.SIGINT
    except BrokenPipeError:
        # Whoever read our output has gone; what is left to say goes nowhere.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        status = 128 + signal.SIGPIPE
    except OSError as error:
        click.echo(f"robochoc: {error}", err=True)
        status = 1
    sys.exit(status if isinstance(status, int) else 0)


def _terminated(signum: int, _frame: FrameType | None) -> NoReturn:
    """End as an exception does, so that every `finally` has its say."""
    sys.exit(128 + signum)
