"""Read a problem from a team's folder, or from another tool's file."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, NamedTuple

from robochoc.formats.diagnostics import InvalidInputError, invalid_input
from robochoc.formats.team_reader import read_team
from robochoc.formats.validation import check_team
from robochoc.model.problem import Team

if TYPE_CHECKING:
    from fractions import Fraction

    from robochoc.formats.dialects.dialect import ConversionNote


class ReadProblem(NamedTuple):
    """A team, and its origin.

    Attributes:
        team: The team.
        names: The original names of its robots and variables.
        foreign: True if it was read from another tool's file, whose user knows only the original names.
        notes: The changes made while reading such a file.
        bound: The sum of costs that counts as no solution in the file's format; see `ImportResult`.
        files: Further files that an import of such a file writes; see `ImportResult`.
    """

    team: Team
    names: Mapping[str, str]
    foreign: bool
    notes: tuple[ConversionNote, ...] = ()
    bound: Fraction | None = None
    files: Mapping[str, bytes] = MappingProxyType({})


def is_foreign(place: Path) -> bool:
    """Return whether `place` is a file of another tool. Raises `InvalidInputError` if the file's format is unknown."""
    if place.is_dir():
        return False
    from robochoc.formats.dialects.registry import recognise_or_raise  # noqa: PLC0415 - start-up

    return recognise_or_raise(place) is not None


def read_problem(
    place: Path,
    *more: Path,
    dialect: str | None = None,
    infinity: int | None = None,
    owner: str | None = None,
    allow_code: bool = False,
) -> ReadProblem:
    """Return the team in the folder `place`, or in another tool's file `place`.

    Args:
        place: The folder, or the file.
        *more: Further files of the problem in that file.
        dialect: The name of a file's format. None: the format is detected.
        infinity: For files: the smallest cost that means forbidden; see `ImportOptions`.
        owner: For files: a regular expression that matches variables of one robot; see `ImportOptions`.
        allow_code: For files: whether Python files named in them may be executed.

    Raises:
        InvalidInputError: if the files have errors, or if such options are specified for a folder.
    """
    from robochoc.formats.names_file import original_names  # noqa: PLC0415 - start-up

    if place.is_file() and (dialect or more or is_foreign(place)):
        from robochoc.formats.dialects.dialect import ImportOptions  # noqa: PLC0415 - as above
        from robochoc.formats.dialects.registry import read_foreign  # noqa: PLC0415 - as above

        options = ImportOptions(infinity=infinity, owner=owner, allow_code=allow_code)
        imported = read_foreign([place, *more], options, dialect)
        check_team(imported.team)
        return ReadProblem(imported.team, imported.names, True, imported.notes, imported.bound, imported.files)
    for option, given in (("format", dialect), ("infinity", infinity), ("owner", owner)):
        if given is not None and place.is_dir():
            what = f"is the folder of a team, and '{option}' is for files of other tools"
            raise invalid_input(place, what, "leave it out")
    if more and place.is_dir():
        what = f"is the folder of a team, and {more[0]} is another problem"
        raise invalid_input(place, what, "name one folder, or the files of one problem")
    try:
        return ReadProblem(read_team(place), original_names(place), foreign=False)
    except InvalidInputError as invalid:
        from robochoc.formats.dialects.registry import recognise  # noqa: PLC0415 - as above

        first = next(iter(invalid.diagnostics), None)
        found = recognise(Path(first.file)) if first else None
        if found is None or first is None:
            raise
        hint = f"robochoc import {place} -o FOLDER"
        raise invalid_input(first.file, f"is {found.title}, not a file of a robot", hint) from None
