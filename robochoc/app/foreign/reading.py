"""One robot of a team's files: its file, its neighbours and its constraints in words."""

from __future__ import annotations

from pathlib import Path

import msgspec

from robochoc.app.foreign.sentences import sentence
from robochoc.formats.robot import read_robot

MOST_SENTENCES = 60
MOST_SHOWN = 40_000
"""Characters of a file that are shown."""


class Read(msgspec.Struct, frozen=True):
    """A robot's file.

    Attributes:
        name: The file's name.
        text: What stands in it, or its beginning.
        is_cut: Whether that is the beginning only.
        neighbours: Whom it shares constraints with.
        sentences: What its constraints say, each as often as it is there; of many, the first ones.
        count: How many constraints it has.
    """

    name: str
    text: str
    is_cut: bool
    neighbours: tuple[str, ...]
    sentences: tuple[str, ...]
    count: int


def read(folder: Path, robot: str) -> Read:
    """Return what the files in `folder` say of a robot of the team. Raises `InvalidInputError`, `OSError`."""
    file = _file_of(folder, robot)
    found = read_robot(file)
    constraints = [*found.constraints()]
    says = (sentence(one, found.symbol_table, found.costs) for one in constraints[:MOST_SENTENCES])
    with file.open(encoding="utf-8", errors="replace") as opened:
        text = opened.read(MOST_SHOWN + 1)
    return Read(
        file.relative_to(folder).as_posix(),
        text[:MOST_SHOWN],
        len(text) > MOST_SHOWN,
        tuple(dict.fromkeys([*(one.name for one in found.parents), *(one.name for one in found.children)])),
        tuple(says),
        len(constraints),
    )


def _file_of(folder: Path, robot: str) -> Path:
    """Return the file of a robot; one that joins has it in a folder of its own."""
    places = [folder, *sorted(folder.glob("late*"))]
    return next((file for place in places if (file := place / f"{robot}.xml").is_file()), folder / f"{robot}.xml")
