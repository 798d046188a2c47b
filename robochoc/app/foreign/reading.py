"""One robot of a team's files: its file, its neighbours and its constraints in words."""

from __future__ import annotations

from pathlib import Path

import msgspec

from robochoc.app.foreign.sentences import sentence
from robochoc.formats.robot_reader import read_robot

MOST_SENTENCES = 60
MOST_SHOWN = 40_000
"""The maximum number of characters of a file that are shown."""


class RobotFile(msgspec.Struct, frozen=True):
    """A robot's file.

    Attributes:
        name: The file's name.
        text: Its content, or the beginning of it.
        is_cut: Whether `text` is only the beginning.
        neighbours: The robots with common constraints.
        sentences: Its constraints in words, up to a maximum.
        count: The number of its constraints.
    """

    name: str
    text: str
    is_cut: bool
    neighbours: tuple[str, ...]
    sentences: tuple[str, ...]
    count: int


def read_robot_file(folder: Path, robot: str) -> RobotFile:
    """Return the file of a robot in the team's `folder`. Raises `InvalidInputError`, `OSError`."""
    file = _file_of(folder, robot)
    found = read_robot(file)
    constraints = [*found.constraints()]
    says = (sentence(one, found.symbol_table, found.costs) for one in constraints[:MOST_SENTENCES])
    with file.open(encoding="utf-8", errors="replace") as opened:
        text = opened.read(MOST_SHOWN + 1)
    return RobotFile(
        file.relative_to(folder).as_posix(),
        text[:MOST_SHOWN],
        len(text) > MOST_SHOWN,
        tuple(dict.fromkeys([*(one.name for one in found.parents), *(one.name for one in found.children)])),
        tuple(says),
        len(constraints),
    )


def _file_of(folder: Path, robot: str) -> Path:
    """Return the path of a robot's file; robots that join later are in separate folders."""
    places = [folder, *sorted(folder.glob("late*"))]
    return next((file for place in places if (file := place / f"{robot}.xml").is_file()), folder / f"{robot}.xml")
