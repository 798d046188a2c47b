"""The interface of a dialect: the options of an import, its result, and its notes; and names that are allowed here."""

from __future__ import annotations

import re
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from fractions import Fraction
from pathlib import Path
from typing import NamedTuple

from robochoc.formats.diagnostics import MistakeError, shortened
from robochoc.formats.names import MAX_NAME, RESERVED, is_name
from robochoc.model.problem import Team
from robochoc.system.plain_text import counted

MAX_FILE = 256 * 1024 * 1024
"""The maximum size of a file, in bytes."""


@dataclass(frozen=True)
class ImportOptions:
    """The options of an import.

    Attributes:
        infinity: Costs of at least so much forbid; of at most minus so much when maximising. None: none do.
        owner: A regular expression; variables whose names have the same first group (or match) belong to one robot.
        allow_code: Whether Python files that a problem names may be executed.
        name: The name of the team. None: that of the file, or of its problem.
    """

    infinity: int | None = None
    owner: str | None = None
    allow_code: bool = False
    name: str | None = None


class ConversionNote(NamedTuple):
    """A change that an import has made: a keyword for scripts, and a sentence for people."""

    kind: str
    text: str


OTHER_PROBLEM = {
    "bound", "count", "default", "dropped", "external", "infinity", "left out", "repeated", "rounded", "scenario",
    "truncated",
}  # fmt: skip
"""Kinds of notes on what the team says otherwise than the file, or not at all; the others are on how it says it."""


@dataclass(frozen=True)
class ImportResult:
    """A problem of another tool, as a team.

    Attributes:
        team: The team.
        dialect: The name of the dialect.
        names: The original names of robots and variables, by the team's, where they differ.
        notes: What has been mapped: `renamed`, `scale`, `shared variable`, ...
        bound: A sum that the format takes for no solution, as it takes greater ones (maximising: smaller ones), and
            that the team can reach. None: there is none.
    """

    team: Team
    dialect: str
    names: Mapping[str, str] = field(default_factory=dict)
    notes: tuple[ConversionNote, ...] = ()
    bound: Fraction | None = None


@dataclass(frozen=True)
class ExportOptions:
    """The options of an export.

    Attributes:
        intension: Whether predicates and functions are kept where a format has them, rather than tabulated.
    """

    intension: bool = False


class ExportResult(NamedTuple):
    """A team in the format of another tool.

    Attributes:
        files: The contents of the files by name, beginning with the problem.
        notes: Differences between the files and the team, and options that the other tool needs.
    """

    files: Mapping[str, bytes]
    notes: tuple[ConversionNote, ...] = ()


@dataclass(frozen=True)
class Dialect:
    """A format of another tool.

    Attributes:
        name: Its name on the command line, such as `frodo`.
        title: Its name in messages, such as `FRODO's XCSP 2.1`.
        recognises: Returns whether the file at a path, which begins with some bytes, is in it.
        read: Returns the problem in some files. Raises `InvalidInputError`.
        write: Returns the files of a team in it. Raises `UnsupportedError` where the team has what the dialect has
            not. None: it is only read.
        is_part: Returns whether the file at a path, which begins with some bytes, is one of several of a problem:
            those in its folder are read together. None: none is.
    """

    name: str
    title: str
    recognises: Callable[[Path, bytes], bool]
    read: Callable[[Sequence[Path], ImportOptions], ImportResult]
    write: Callable[[Team, ExportOptions], ExportResult] | None = None
    is_part: Callable[[Path, bytes], bool] | None = None


class NameMap:
    """Names that are allowed here, for names of other tools: the same one where it is allowed, and each only once."""

    def __init__(self) -> None:
        self._taken: dict[str, str] = {}
        self._given: dict[str, str] = {}

    def allowed(self, original: str) -> str:
        """Return the name for `original`. The same original always gets the same one."""
        if original not in self._given:
            self._given[original] = self._free(original)
            self._taken[self._given[original]] = original
        return self._given[original]

    @property
    def changed(self) -> dict[str, str]:
        """The originals, by the names that they got, where these differ."""
        return {name: original for name, original in self._taken.items() if name != original}

    def _free(self, original: str) -> str:
        name = re.sub(r"[^A-Za-z0-9_.]", "_", original)[: MAX_NAME - 12] or "_"
        name = name if is_name(name) and name != RESERVED else f"v{name}"
        free, number = name, 1
        while free in self._taken:
            number += 1
            free = f"{name}_{number}"
        return free


def owners_by(pattern: str, names: Iterable[str]) -> dict[str, str]:
    """Return the owner of each of `names`: what `pattern` finds in it, its first group or all of its match.

    Raises:
        MistakeError: if `pattern` is no regular expression, or finds nothing in a name.
    """
    try:
        expression = re.compile(pattern)
    except re.error as error:
        what = f"the owner '{shortened(pattern)}' is no regular expression: {error}"
        raise MistakeError(what, "mend it") from None
    owners = {}
    for name in names:
        match = expression.search(name)
        if match is None:
            what = f"the owner '{shortened(pattern)}' finds nothing in the variable '{shortened(name)}'"
            raise MistakeError(what, "let it find something in every variable's name")
        owners[name] = match[1] if expression.groups and match[1] else match[0]
    return owners


def notes_on_names(changed: Collection[tuple[str, str]]) -> list[ConversionNote]:
    """Return a note for each pair of a name and its original."""
    return [ConversionNote("renamed", f"{original} is {name}") for name, original in changed]


def notes_on_absence(team: Team) -> list[ConversionNote]:
    """Return a note on the chosen meanings of constraints for absent robots, which other formats do not have."""
    first, *more = [*dict.fromkeys(one.name for one in team.constraints() if one.when_absent is not None), ""]
    others = f" and {counted(len(more) - 1, 'other constraint')}" if len(more) > 1 else ""
    return (
        [ConversionNote("left out", f"when_absent of {first}{others}: the format has no absent robots")]
        if first
        else []
    )
