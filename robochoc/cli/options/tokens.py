"""`--token` and `--token-file`: where a command takes the token from with which it enrols.

A token on the command line stands in the list of processes, for everybody on the machine, as long as the command runs.
"""

from __future__ import annotations

import os
import stat
import sys
from collections.abc import Callable
from typing import TypeVar

import click
from click.core import ParameterSource

from robochoc.cli.reports.failures import INVALID, Failure

Command = TypeVar("Command", bound=Callable[..., object])
STDIN = "-"
LONGEST = 4096
"""Bytes. A token has a hundred."""
_FILE = "robochoc.token_file"


def token_options() -> Callable[[Command], Command]:
    """Return the options `--token` and `--token-file`, both as the argument `token`."""
    options = (
        click.option(
            "--token-file",
            is_eager=True,
            expose_value=False,
            callback=_note_file,
            metavar="FILE",
            help="Enrol with the token in FILE, which only you may read; -: standard input.",
        ),
        click.option(
            "--token",
            envvar="ROBOCHOC_TOKEN",
            callback=_token,
            metavar="TOKEN",
            help="Enrol with this token. Other users see it in the list of processes.",
        ),
    )

    def with_options(command: Command) -> Command:
        for option in reversed(options):
            command = option(command)
        return command

    return with_options


def _note_file(context: click.Context, _param: click.Parameter, value: str | None) -> None:
    context.meta[_FILE] = value


def _token(context: click.Context, param: click.Parameter, value: str | None) -> str | None:
    file = context.meta.get(_FILE)
    if file is None:
        return _from_standard_input() if value == STDIN else value
    if param.name and context.get_parameter_source(param.name) is ParameterSource.COMMANDLINE:
        raise click.UsageError("--token and --token-file both give the token; drop one")
    return _from_standard_input() if file == STDIN else _from_file(file)


def _from_standard_input() -> str:
    if sys.stdin.isatty():
        return str(click.prompt("Token", hide_input=True, err=True))
    return _only_word(sys.stdin.buffer.readline(LONGEST + 1), "standard input")


def _from_file(path: str) -> str:
    """Return the token in the file. Refuse a file that others may read, as ssh does with keys."""
    try:
        with open(path, "rb") as file:  # noqa: PTH123 - one file is looked at, and read, whatever its name becomes
            status = os.fstat(file.fileno())
            if stat.S_ISREG(status.st_mode) and status.st_uid == os.getuid() and status.st_mode & 0o077:
                others = f"others may read it (mode {stat.S_IMODE(status.st_mode):03o})"
                raise Failure(INVALID, f"{path}: {others}, and so have the token; say: chmod 600 {path}")
            return _only_word(file.read(LONGEST + 1), path)
    except OSError as error:
        raise Failure(INVALID, f"{path}: {error.strerror or error} (give the file that holds the token)") from error


def _only_word(content: bytes, place: str) -> str:
    """The token in one line, alone or behind its name, as `robochoc authority enrol` prints it."""
    words = content.decode(errors="replace").split()
    if len(content) > LONGEST or len(words) not in {1, 2}:
        found = "nothing" if not words else "more than one token"
        raise Failure(INVALID, f"{place}: there is {found} (expected one line of 'robochoc authority enrol')")
    return words[-1]
