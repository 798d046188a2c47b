"""Paths on the command line: what cannot be read or written is said before the work, not after it."""

from __future__ import annotations

import os
from collections.abc import Iterable, Iterator, Mapping
from contextlib import suppress
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING

import click

from robochoc.cli.reports.failures import INVALID, Failure

if TYPE_CHECKING:
    from click.shell_completion import CompletionItem

PathLike = str | os.PathLike[str]

_LOOKED_AT = 20
"""The maximum number of files of a folder that are looked at, when no team is found there."""


class InputPath(click.Path):
    """A path to read. Not the empty one, which an unset shell variable leaves: it would mean everything here."""

    def __init__(self) -> None:
        super().__init__(path_type=Path)

    def convert(self, value: PathLike, param: click.Parameter | None, ctx: click.Context | None) -> Path:
        """The path. Fails, as wrong usage, where it is empty."""
        if not os.fspath(value):
            self.fail("a path is empty; write '.' for this folder", param, ctx)
        return Path(os.fsdecode(super().convert(value, param, ctx)))


class TeamFolder(InputPath):
    """A path to read at which a team is expected: the shell completes folders."""

    def shell_complete(self, ctx: click.Context, param: click.Parameter, incomplete: str) -> list[CompletionItem]:  # noqa: ARG002 - click's
        """Return the shell's own completion of folders."""
        from click.shell_completion import CompletionItem

        return [CompletionItem(incomplete, type="dir")]


class OutputFile(click.Path):
    """A file to write, in a folder that is there and may be written to."""

    def __init__(self) -> None:
        super().__init__(dir_okay=False, path_type=Path)

    def convert(self, value: PathLike, param: click.Parameter | None, ctx: click.Context | None) -> Path:
        """The path. Fails, as wrong usage, where no file could come into being."""
        from robochoc.system.files import resolved

        path = Path(os.fsdecode(super().convert(value, param, ctx)))
        if path.is_dir():
            self.fail(f"{path} is a folder; name a file", param, ctx)
        if path.exists() and not path.is_file():  # a device or a pipe
            return path
        try:
            folder = resolved(path).parent
        except OSError as error:
            self.fail(f"{path}: {error.strerror}; name another file", param, ctx)
        if not folder.is_dir():
            self.fail(f"there is no folder {folder}; make it first", param, ctx)
        if not os.access(folder, os.W_OK | os.X_OK):
            self.fail(f"nothing may be written in {folder}; choose another folder", param, ctx)
        return path


Place = tuple[Path | str, str]
"""A place, the same however it is spelled, and what the command line calls it."""


def refuse_same_places(
    outputs: Mapping[str, Path | None],
    inputs: Mapping[str, Path | None] = MappingProxyType({}),
    *,
    teams: Iterable[Path] = (),
    more_outputs: Iterable[Place] = (),
    more_inputs: Iterable[Place] = (),
) -> None:
    """Raise `click.UsageError` where a command would write over what it reads, or two things to one place.

    `outputs` and `inputs` are files, by what they are called on the command line; `teams` are folders whose files are
    read; `more_outputs` and `more_inputs` are places that need not be files. Devices and pipes may be shared.
    """
    from robochoc.system.files import resolved

    taken = dict([*_named(inputs), *more_inputs])
    written = [*_named(outputs), *more_outputs]
    folders = [resolved(team) for team in teams if team.is_dir()]
    for place, option in written:
        other = taken.setdefault(place, option)
        if other is not option:
            told = f"{option} is given twice" if other == option else f"{other} and {option} are one place"
            raise click.UsageError(told)
        if isinstance(place, Path) and place.suffix == ".xml":
            for folder in folders:
                if place.is_relative_to(folder):
                    raise click.UsageError(f"{option} would be a file of the team in {folder}; name another")


def _named(files: Mapping[str, Path | None]) -> Iterator[Place]:
    """Yield the path and the name of each given file, which need not exist yet. Devices are left out."""
    from robochoc.system.files import resolved

    for what, path in files.items():
        with suppress(OSError):  # its reader or writer reports the error
            if path and (path.is_file() or not path.exists()):
                yield resolved(path), f"{what} {path}"


def foreign_files_told(path: Path) -> list[str]:
    """Return a line that says which command imports what is at `path`; none where no tool's file is there."""
    from robochoc.formats.dialects.registry import recognise

    try:
        files = [path] if path.is_file() else sorted(entry for entry in path.iterdir() if entry.is_file())[:_LOOKED_AT]
    except OSError:
        return []
    for file in files:
        if dialect := recognise(file):
            return [f"{file}: is {dialect.title}; 'robochoc import {path} -o FOLDER' makes a team of it"]
    return []


def teams_at(paths: Iterable[Path], *, foreign: bool = False, dialect: str | None = None) -> list[Path]:
    """Return the folders of all teams at `paths` or below, each once.

    With `foreign`, files of other tools are teams, too; with `dialect`, all files have this format.

    Raises `Failure`, which names every path without a team: nothing is done by half.
    """
    from robochoc.formats import InvalidInputError, find_teams
    from robochoc.formats.dialects.registry import recognised

    folders: dict[Path, None] = {}
    wrong = []
    for path in paths:
        try:
            if foreign and ((dialect and path.is_file()) or recognised(path)):
                folders[path] = None
            else:
                folders.update(dict.fromkeys(find_teams(path)))
        except InvalidInputError as invalid:
            wrong += [str(invalid), *foreign_files_told(path)]
    if wrong:
        raise Failure(INVALID, "\n".join(wrong))
    return list(folders)
