"""A problem in a team's folder, or in a file of another tool: whatever a user names."""

from __future__ import annotations

from collections.abc import Mapping
from fractions import Fraction
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

from robochoc.formats.diagnostics import Diagnostic, InvalidInputError, encodable
from robochoc.formats.team_reader import read_team
from robochoc.formats.validation import check_team
from robochoc.model.problem import Team

if TYPE_CHECKING:
    from robochoc.formats.dialects.dialect import ConversionNote


class ReadProblem(NamedTuple):
    """A team, and what is known of where it comes from.

    Attributes:
        team: The team.
        names: The original names of its robots and variables.
        foreign: Whether it is known by these alone: it is in a file of another tool.
        notes: What reading such a file has changed.
        bound: What its format takes for no solution; see `ImportResult`.
    """

    team: Team
    names: Mapping[str, str]
    foreign: bool
    notes: tuple[ConversionNote, ...] = ()
    bound: Fraction | None = None


def read_problem(
    place: Path,
    *more: Path,
    dialect: str | None = None,
    infinity: int | None = None,
    owner: str | None = None,
    allow_code: bool = False,
) -> ReadProblem:
    """Return the team in the folder `place`, or in the file of another tool.

    Args:
        place: The folder, or the file.
        *more: Further files of the problem in that file.
        dialect: Of a file: the name of its format. None: it is recognised.
        infinity: Of a file: costs of at least so much forbid; see `ImportOptions`.
        owner: Of a file: a regular expression that says which variables belong to one robot.
        allow_code: Of a file: whether Python files that it names may be executed.

    Raises:
        InvalidInputError: with the mistakes of the files, and for options of a file where there is a folder.
    """
    from robochoc.formats.dialects.dialect import ImportOptions  # noqa: PLC0415 - start-up: files of other tools only
    from robochoc.formats.dialects.registry import read_foreign, recognise, recognise_or_raise  # noqa: PLC0415 - as above
    from robochoc.formats.names_file import original_names  # noqa: PLC0415 - as above

    if place.is_file() and (dialect or more or recognise_or_raise(place)):
        options = ImportOptions(infinity=infinity, owner=owner, allow_code=allow_code)
        imported = read_foreign([place, *more], options, dialect)
        check_team(imported.team)
        return ReadProblem(imported.team, imported.names, foreign=True, notes=imported.notes, bound=imported.bound)
    for option, given in (("format", dialect), ("infinity", infinity), ("owner", owner)):
        if given is not None and place.is_dir():
            what, hint = f"is the folder of a team, and '{option}' is for files of other tools", "leave it out"
            raise InvalidInputError([Diagnostic(encodable(str(place)), 0, what, hint)])
    if more and place.is_dir():
        what, hint = (
            f"is the folder of a team, and {more[0]} another problem",
            "name files of one problem, or one folder",
        )
        raise InvalidInputError([Diagnostic(encodable(str(place)), 0, what, hint)])
    try:
        return ReadProblem(read_team(place), original_names(place), foreign=False)
    except InvalidInputError as invalid:
        first = next(iter(invalid.diagnostics), None)
        found = recognise(Path(first.file)) if first else None
        if found is None or first is None:
            raise
        hint = f"robochoc import {place} -o FOLDER"
        told = Diagnostic(first.file, 0, f"is {found.title}, not a file of a robot", hint)
        raise InvalidInputError([told]) from None
