"""Problems on the command line: the folder of a team, or a file of another tool."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import click

from robochoc.cli.options.paths import TeamFolder

if TYPE_CHECKING:
    from click.shell_completion import CompletionItem

    from robochoc.model.problem import Team

READ = ("frodo", "xdiscsp", "pydcop", "xcsp3", "cfn", "wcsp")
"""The dialects that are imported."""
WRITTEN = ("xcsp3", "frodo", "xdiscsp", "pydcop", "cfn", "wcsp", "dot", "graphml")
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


class ReadProblem(NamedTuple):
    """A team, the original names of its robots and variables, and whether it is known by these alone."""

    team: Team
    names: Mapping[str, str]
    foreign: bool


def read_problem(place: Path) -> ReadProblem:
    """Return the team in the folder `place`, or in the file of another tool. Raises `InvalidInputError`."""
    from robochoc.formats import InvalidInputError, check_team, read_team
    from robochoc.formats.diagnostics import Diagnostic
    from robochoc.formats.dialects.dialect import ImportOptions
    from robochoc.formats.dialects.names_file import original_names
    from robochoc.formats.dialects.registry import read_foreign, recognise

    if place.is_file() and recognise(place):
        imported = read_foreign([place], ImportOptions())
        check_team(imported.team)
        return ReadProblem(imported.team, imported.names, foreign=True)
    try:
        return ReadProblem(read_team(place), original_names(place), foreign=False)
    except InvalidInputError as invalid:
        first = next(iter(invalid.diagnostics), None)
        dialect = recognise(Path(first.file)) if first else None
        if dialect is None or first is None:
            raise
        hint = f"robochoc import {place} -o FOLDER"
        told = Diagnostic(first.file, 0, f"is {dialect.title}, and no file of a robot", hint)
        raise InvalidInputError([told]) from None
