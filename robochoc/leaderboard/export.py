"""Writes an instance of the benchmark set as a team's folder, or in the format of another tool."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

from robochoc.experiments.digests import sha256_of_team
from robochoc.formats.diagnostics import invalid_input
from robochoc.formats.dialects.dialect import ExportOptions, notes_on_features
from robochoc.formats.dialects.registry import find_dialect
from robochoc.formats.team_writer import write_team
from robochoc.leaderboard.certificates import published
from robochoc.leaderboard.instances import Instance
from robochoc.model.problem import Team
from robochoc.solver.errors import UnsupportedError
from robochoc.system.errors import RobochocError
from robochoc.system.files import write_atomically

TEAM = "robochoc"
"""The format of robochoc: a folder with a file for each robot."""
ENDINGS = {"xcsp3": ".xml", "frodo": ".xml", "pydcop": ".yaml"}


class ChangedInstanceError(RobochocError):
    """The generated team differs from the team in the published list."""


def checked_team(instance: Instance) -> Team:
    """Return the team of an instance, after a comparison with the digest in the published list.

    Raises:
        ChangedInstanceError: if the digests differ.
    """
    team = instance.team()
    if sha256_of_team(team) != published()[instance.name].sha256:
        raise ChangedInstanceError(
            f"{instance.name}: the generated team is not the team of the published list; the generator has changed"
        )
    return team


def export_instance(instance: Instance, kind: str, output: Path | None, *, replace: bool = False) -> Iterator[str]:
    """Write an instance, and yield a line for each written file or note.

    Args:
        instance: The instance.
        kind: `TEAM`, or the name of a dialect that can be written.
        output: The folder or file. None: the name of the instance, in the current folder.
        replace: True if an existing folder or file is replaced.

    Raises:
        ChangedInstanceError: if the team differs from the published one.
        InvalidInputError: if the format cannot express the team, or the folder or file exists and is not replaced.
        OSError: if it cannot be written.
        UnsupportedError: if the format cannot be written.
    """
    team = checked_team(instance)
    if kind == TEAM:
        folder = output or Path(instance.name)
        write_team(team, folder, replace=replace)
        yield f"{folder}: {len(team.robots)} robots; next: robochoc solve {folder}"
        return
    dialect = find_dialect(kind)
    if dialect is None or dialect.write is None:
        raise UnsupportedError(f"this version cannot write {kind}")
    path = output or Path(f"{instance.name}{ENDINGS[kind]}")
    written = dialect.write(team, ExportOptions())
    contents = list(written.files.items())
    paths = [path, *(path.with_name(f"{path.stem}{name.removeprefix(team.name)}") for name, _ in contents[1:])]
    for one in paths:
        if one.exists() and not replace:
            raise invalid_input(one, "exists", "use --force, or another -o")
    for one, (_, content) in zip(paths, contents, strict=True):
        write_atomically(one, content)
        yield f"{one}: {len(content):,} bytes"
    for note, text in (*written.notes, *notes_on_features(team, dialect)):
        yield f"  {note}: {text}"
