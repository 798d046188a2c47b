"""Paths on the command line: what cannot be read or written is said before the work, not after it."""

from __future__ import annotations

import os
from pathlib import Path

import click

PathLike = str | os.PathLike[str]


class InputPath(click.Path):
    """A path to read. Not the empty one, which an unset shell variable leaves: it would mean everything here."""

    def __init__(self) -> None:
        super().__init__(path_type=Path)

    def convert(self, value: PathLike, param: click.Parameter | None, ctx: click.Context | None) -> Path:
        """The path. Fails, as wrong usage, where it is empty."""
        if not os.fspath(value):
            self.fail("a path is empty; write '.' for this folder", param, ctx)
        return Path(os.fsdecode(super().convert(value, param, ctx)))


class OutputFile(click.Path):
    """A file to write, in a folder that is there and may be written to."""

    def __init__(self) -> None:
        super().__init__(dir_okay=False, path_type=Path)

    def convert(self, value: PathLike, param: click.Parameter | None, ctx: click.Context | None) -> Path:
        """The path. Fails, as wrong usage, where no file could come into being."""
        path = Path(os.fsdecode(super().convert(value, param, ctx)))
        if path.is_dir():
            self.fail(f"{path} is a folder; name a file", param, ctx)
        if path.exists() and not path.is_file():  # a device or a pipe
            return path
        folder = path.resolve().parent
        if not folder.is_dir():
            self.fail(f"there is no folder {folder}; make it first", param, ctx)
        if not os.access(folder, os.W_OK | os.X_OK):
            self.fail(f"nothing may be written in {folder}; choose another folder", param, ctx)
        return path
