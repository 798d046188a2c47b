"""The interface of a dialect, and parts common to all dialects: options, results, notes, valid names, owners."""

from __future__ import annotations

import re
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from dataclasses import field
from fractions import Fraction
from pathlib import Path
from typing import NamedTuple

from robochoc.formats.diagnostics import MistakeError, shortened
from robochoc.formats.names import MAX_NAME, RESERVED, is_name
from robochoc.model.problem import Team
from robochoc.model.uncertainty import is_uncertain, random_variables
from robochoc.system.lazy_dataclass import dataclass
from robochoc.system.plain_text import counted

MAX_FILE = 256 * 1024 * 1024
"""The maximum size of a file, in bytes."""


@dataclass(frozen=True)
class ImportOptions:
    """The options of an import.

    Attributes:
        infinity: Costs of at least this value are hard; if costs are maximised, costs of at most its negative. None: no
            finite cost is hard.
        owner: A regular expression. Variables whose names have the same first group (or match) belong to one robot.
        allow_code: True if Python files named by a problem may be executed.
        name: The name of the team. None: the name of the file, or of its problem.
    """

    infinity: int | None = None
    owner: str | None = None
    allow_code: bool = False
    name: str | None = None


class ConversionNote(NamedTuple):
    """A difference between a file and a team: a keyword for scripts, and a sentence for users."""

    kind: str
    text: str


OTHER_PROBLEM = {
    "bound", "count", "default", "dropped", "external", "infinity", "left out", "repeated", "rounded", "scenario",
    "truncated",
}  # fmt: skip
"""The kinds of notes on a different problem. All other kinds are notes on a different form of the same problem."""


@dataclass(frozen=True)
class ImportResult:
    """Another tool's problem, converted to a team.

    Attributes:
        team: The team.
        dialect: The name of the dialect.
        names: The original names of robots and variables, by their names in the team, if the two differ.
        notes: The differences from the files: `renamed`, `scale`, `shared variable`, ...
        bound: An upper bound that the costs of solutions in this format do not reach. None: the format has no such
            bound, or no assignment of the team reaches it.
        files: Further files of the team's folder, such as `map.json`: their contents by name.
    """

    team: Team
    dialect: str
    names: Mapping[str, str] = field(default_factory=dict)
    notes: tuple[ConversionNote, ...] = ()
    bound: Fraction | None = None
    files: Mapping[str, bytes] = field(default_factory=dict)


@dataclass(frozen=True)
class ExportOptions:
    """The options of an export.

    Attributes:
        intension: True if predicates and functions are written as such if the format allows it, not as tables.
    """

    intension: bool = False


class ExportResult(NamedTuple):
    """A team in another tool's format.

    Attributes:
        files: The contents of the files by name. The first file is the problem.
        notes: Differences between the files and the team, and options that the other tool requires.
    """

    files: Mapping[str, bytes]
    notes: tuple[ConversionNote, ...] = ()


@dataclass(frozen=True)
class Dialect:
    """Another tool's format.

    Attributes:
        name: Its name on the command line, such as `frodo`.
        title: Its name in messages, such as `FRODO's XCSP 2.1`.
        recognises: Returns whether a file is in this format, from its path and its first bytes.
        read: A function that returns the problem in the given files. Raises `InvalidInputError`.
        write: Returns the files of a team. Raises `UnsupportedError` if the format lacks a feature of the team. None:
            the format is only read.
        is_part: Returns whether a file is one of several files of a problem, from its path and its first bytes; such
            files of a folder are read together. None: a problem is one file.
        writes_random: True if files can contain random variables that no variable observes.
    """

    name: str
    title: str
    recognises: Callable[[Path, bytes], bool]
    read: Callable[[Sequence[Path], ImportOptions], ImportResult]
    write: Callable[[Team, ExportOptions], ExportResult] | None = None
    is_part: Callable[[Path, bytes], bool] | None = None
    writes_random: bool = False


class NameMap:
    """Maps names from other tools to unique names that are valid in a team. Valid names stay unchanged."""

    def __init__(self) -> None:
        self._taken: dict[str, str] = {}
        self._given: dict[str, str] = {}

    def allowed(self, original: str) -> str:
        """Return the valid name for `original`. It is always the same for the same original."""
        if original not in self._given:
            self._given[original] = self._free(original)
            self._taken[self._given[original]] = original
        return self._given[original]

    def reserve(self, name: str) -> None:
        """Use `name` for no original."""
        self._taken[name] = name

    @property
    def originals(self) -> dict[str, str]:
        """The original names by their valid names, if the two differ."""
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
    """Return the owner of each of `names`: the first group in the match of `pattern`, or the whole match.

    Raises:
        MistakeError: if `pattern` is not a regular expression, or does not match a name.
    """
    try:
        expression = re.compile(pattern)
    except re.error as error:
        what = f"--owner '{shortened(pattern)}' is not a valid regular expression: {error}"
        raise MistakeError(what, "correct it, for example --owner '^[a-z]+'") from None
    owners = {}
    for name in names:
        match = expression.search(name)
        if match is None:
            what = f"--owner '{shortened(pattern)}' does not match the variable '{shortened(name)}'"
            raise MistakeError(what, "use a regular expression that matches the name of every variable")
        owners[name] = match[1] if expression.groups and match[1] else match[0]
    return owners


def notes_on_names(changed: Collection[tuple[str, str]]) -> list[ConversionNote]:
    """Return a note for each pair of a name in the team and its original name."""
    return [ConversionNote("renamed", f"{original} is {name}") for name, original in changed]


def can_state_random_variables(team: Team) -> bool:
    """Return whether `team` has random variables, and no variable that is chosen after an observation."""
    return is_uncertain(team) and not any(one.seen_by for one in random_variables(team))


def notes_on_features(team: Team, dialect: Dialect) -> list[ConversionNote]:
    """Return notes on features of `team` that are lost in the files of `dialect`."""
    random = [ConversionNote("random", "costs are expected costs, without random variables")]
    found = random if is_uncertain(team) and not (dialect.writes_random and can_state_random_variables(team)) else []
    first, *more = [*dict.fromkeys(one.name for one in team.constraints() if one.when_absent is not None), ""]
    others = f" and {counted(len(more) - 1, 'other constraint')}" if len(more) > 1 else ""
    if first:
        found.append(ConversionNote("left out", f"when_absent of {first}{others}: the format has no absent robots"))
    return found
