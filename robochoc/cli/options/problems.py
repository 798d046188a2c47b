"""Problems on the command line: the folder of a team, or a file of another tool."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, TypeVar

import click

from robochoc.cli.options.numbers import WholeNumber
from robochoc.cli.options.paths import TeamFolder

if TYPE_CHECKING:
    from click.shell_completion import CompletionItem

_Command = TypeVar("_Command", bound=Callable[..., object])

READ = ("frodo", "xdiscsp", "pydcop", "tasks", "xcsp3", "cfn", "wcsp")
"""The dialects that are imported."""
WRITTEN = ("xcsp3", "frodo", "xdiscsp", "dcopsolver", "pydcop", "cfn", "wcsp", "dot", "graphml")
"""The formats that are exported."""


class Problem(TeamFolder):
    """A path to read at which a team, or a file of another tool, is expected."""

    def shell_complete(self, ctx: click.Context, param: click.Parameter, incomplete: str) -> list[CompletionItem]:  # noqa: ARG002 - click's
        """Return the shell's own completion of files."""
        from click.shell_completion import CompletionItem

        return [CompletionItem(incomplete, type="file")]


class Pattern(click.ParamType[str]):
    """A regular expression."""

    name = "regex"

    def convert(self, value: str, param: click.Parameter | None, ctx: click.Context | None) -> str:
        """Return it as it is. Fail, as wrong usage, where it is none."""
        import re

        try:
            re.compile(value)
        except (re.error, OverflowError, RecursionError) as error:
            self.fail(f"{value!r} is no regular expression: {error}", param, ctx)
        return value


def format_option(command: _Command) -> _Command:
    """Add `--format`, the format of the input files."""
    told = "Format of the files, as 'robochoc import --help' lists them."
    return click.option("--format", "dialect", type=click.Choice(READ), metavar="NAME", help=told)(command)


def reading_options(command: _Command) -> _Command:
    """Add `--infinity` and `--owner`: how a file of another tool is read."""
    owner = click.option(
        "--owner",
        type=Pattern(),
        metavar="REGEX",
        help="One robot for variables with the same match (or first group).",
    )
    infinity = click.option(
        "--infinity", type=WholeNumber(1), metavar="N", help="Costs of N or more forbid (maximising: of -N or less)."
    )
    return infinity(owner(command))
