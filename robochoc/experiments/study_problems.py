"""The table `[problems]` in a study: a family with its parameters, or folders and files."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping
from glob import glob, has_magic
from pathlib import Path
from typing import Any

import msgspec

from robochoc.experiments.digests import digest_of_files
from robochoc.experiments.study_file import HINT, Place
from robochoc.experiments.task import ProblemSpec
from robochoc.formats.diagnostics import shortened
from robochoc.formats.team_reader import find_teams

PROBLEM_KEYS = ("family", "path", "name", "scenario", "infinity", "owner")
_SCENARIO: Mapping[str, tuple[type, ...]] = {
    "events": (int,),
    "rate": (float, int),
    "seed": (int,),
    "kinds": (str,),
    "after": (int,),
}
_OF_FILES: Mapping[str, tuple[type, ...]] = {"infinity": (int,), "owner": (str,)}
_HYPHENATED = re.compile(r"\d+-\d+")
"""A text that looks like a range but is not one."""


MOST_PROBLEMS = 100_000
"""The maximum number of problems in a table."""


def problems_of(table: Mapping[str, Any], place: Place) -> Iterator[ProblemSpec]:
    """Yield the problems in a table.

    Raises:
        InvalidInputError: if the table is invalid.
    """
    scenarios = list(_scenarios(table, place))
    name = table.get("name", "")
    if not isinstance(name, str) or not name.isprintable():
        raise place.mistake("name", f"expected one line of text, got {shortened(str(name))}")
    rest = {key: value for key, value in table.items() if key not in {"family", "path", "name", "scenario"}}
    if ("family" in table) == ("path" in table):
        from robochoc.generators.families import FAMILIES  # noqa: PLC0415 - start-up: numpy, for maps

        families = ", ".join(FAMILIES)
        raise place.mistake("", f"expected either family (one of {families}) or path (folders of teams, files)")
    if "family" in table:
        found = _of_family(table["family"], rest, name, place)
    else:
        place.check_keys(table, PROBLEM_KEYS)
        found = _of_files(table["path"], rest, name, place)
    for count, (problem, scenario) in enumerate((one, scenario) for one in found for scenario in scenarios):
        if count >= MOST_PROBLEMS:
            raise place.mistake("", f"describes too many problems; at most {MOST_PROBLEMS:,} are allowed")
        yield msgspec.structs.replace(problem, scenario=scenario)


def _scenarios(table: Mapping[str, Any], place: Place) -> Iterable[dict[str, Any]]:
    given = table.get("scenario")
    if given is None:
        return [{}]
    at = place.below(f"{place.table}.scenario")
    if not isinstance(given, dict):
        raise place.mistake("scenario", "expected a table, such as { events = 5, rate = 0.1 }")
    at.check_keys(given, _SCENARIO)
    for key in ("events", "rate"):
        if key not in given:
            raise place.mistake(
                "scenario", f"{key} is missing; a scenario needs a number of events, and a rate of changes"
            )
    found = list(at.combinations(given))
    for one in found:
        _check_types(one, _SCENARIO, at)
    return found


def _of_family(family: object, given: Mapping[str, Any], name: str, place: Place) -> Iterator[ProblemSpec]:
    from robochoc.generators.families import FAMILIES, parameters_of, required_of  # noqa: PLC0415 - as above

    if not isinstance(family, str) or family not in FAMILIES:
        raise place.mistake(
            "family", f"there is no family {shortened(str(family))}", f"there are {', '.join(FAMILIES)}"
        )
    known = parameters_of(family)
    place.check_keys(given, (*PROBLEM_KEYS, *known))
    for key in ("infinity", "owner"):
        if key in given:
            raise place.mistake(key, "can only be used with files of other tools", "remove it")
    for key in required_of(family):
        if key not in given:
            raise place.mistake(
                "", f"the family {family} needs {key}", f"robochoc generate {family} --help describes it"
            )
    for parameters in place.combinations(given):
        _check_types(parameters, known, place)
        yield ProblemSpec(group=name or family, family=family, parameters=parameters)


def _check_types(parameters: Mapping[str, Any], known: Mapping[str, tuple[type, ...]], place: Place) -> None:
    for key, value in parameters.items():
        if type(value) not in known[key]:
            expected = {int: "an integer", float: "a number", str: "a word", bool: "true or false"}[known[key][0]]
            hint = "a range is written 1..30" if isinstance(value, str) and _HYPHENATED.fullmatch(value) else HINT
            raise place.mistake(key, f"expected {expected}, got {shortened(repr(value))}", hint)


def _of_files(paths: object, given: Mapping[str, Any], name: str, place: Place) -> Iterator[ProblemSpec]:
    options = list(place.combinations(given))
    for one in options:
        _check_types(one, _OF_FILES, place)
    for word in paths if isinstance(paths, list) else [paths]:
        if not isinstance(word, str):
            raise place.mistake("path", f"expected the path of a folder or file, got {shortened(str(word))}")
        found = _named(place.path.parent, word)
        problems = [one for path in found for one in _teams(path)]
        if not problems:
            raise place.mistake(
                "path", f"there is no team at {shortened(word)}", "paths are relative to the study's folder"
            )
        for path in problems:
            for option in options:
                yield ProblemSpec(
                    group=name or path.absolute().parent.name,
                    parameters={"instance": path.name, **option},
                    path=str(path),
                    digest=_digest(path, place),
                )


def _named(folder: Path, word: str) -> list[Path]:
    """Return the paths that match a word, which may contain wildcards. An existing path is used literally."""
    path = folder / word
    if path.exists() or not has_magic(word):
        return [path]
    return [folder / name for name in sorted(glob(word, root_dir=folder))]  # noqa: PTH207 - also absolute ones


def _teams(path: Path) -> list[Path]:
    return list(find_teams(path)) if path.is_dir() else [path] if path.is_file() else []


def _digest(path: Path, place: Place) -> str:
    """Return the digest of a team's files. Raises `InvalidInputError`."""
    try:
        return digest_of_files(path)
    except OSError as error:
        raise place.mistake("path", f"{error.filename} cannot be read: {error.strerror}") from None
