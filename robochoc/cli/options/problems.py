"""Problems on the command line: the folder of a team, or a file of another tool."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, TypeVar

import click

from robochoc.cli.options.paths import TeamFolder
from robochoc.cli.options.value_types import WholeNumber

if TYPE_CHECKING:
    from click.shell_completion import CompletionItem

_Command = TypeVar("_Command", bound=Callable[..., object])

READ = ("frodo", "xdiscsp", "pydcop", "tasks", "xcsp3", "cfn", "wcsp")
"""The formats that can be imported."""
WRITTEN = ("xcsp3", "frodo", "xdiscsp", "dcopsolver", "pydcop", "cfn", "wcsp", "dot", "graphml")
"""The formats that can be exported."""


class ProblemPath(TeamFolder):
    """The path of a team's folder or of another tool's file."""

    def shell_complete(self, ctx: click.Context, param: click.Parameter, incomplete: str) -> list[CompletionItem]:  # noqa: ARG002 - click's
        """Return the shell's own completion for files."""
        from click.shell_completion import CompletionItem

        return [CompletionItem(incomplete, type="file")]


class Pattern(click.ParamType[str]):
    """A regular expression."""

    name = "regex"

    def convert(self, value: str, param: click.Parameter | None, ctx: click.Context | None) -> str:
        """Return the expression unchanged if it is valid."""
        import re

        try:
            re.compile(value)
        except (re.error, OverflowError, RecursionError) as error:
            self.fail(f"{value!r} is not a regular expression: {error}", param, ctx)
        return value


def format_option(command: _Command) -> _Command:
    """Add `--format`, the format of the input files."""
    text = "Format of the files ('robochoc import --help' lists them)."
    return click.option("--format", "dialect", type=click.Choice(READ), metavar="NAME", help=text)(command)


def reading_options(command: _Command) -> _Command:
    """Add `--infinity` and `--owner`, which control how files of other tools are read."""
    owner = click.option(
        "--owner",
        type=Pattern(),
        metavar="REGEX",
        help="Variables with the same match (or group) have one robot.",
    )
    infinity = click.option(
        "--infinity",
        type=WholeNumber(1, 10**18),  # costs of teams are lower (`model/magnitudes.py`)
        metavar="N",
        help="Costs of N or more are forbidden (maximising: -N or less).",
    )
    return infinity(owner(command))
