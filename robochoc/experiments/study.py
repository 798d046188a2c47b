"""The file of a study: problems, protocols and limits. docs/guides/experiments.md describes it.

    [problems]
    family = "random"
    agents = 15
    domain = 5
    density = 0.4
    tightness = "0.2..0.6:0.1"
    seed = "1..30"

    [runs]
    protocol = ["abt", "afc-ng", "dynabt", "awc"]

A list, or a range as in `study_file.py`, means each of its values. Several lists mean all combinations of their values.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any

import msgspec

from robochoc.experiments.study_file import HINT, MAX_INTEGER, Place
from robochoc.experiments.study_problems import PROBLEM_KEYS, problems_of
from robochoc.experiments.study_runs import RUN_KEYS, distinct, setups_of
from robochoc.experiments.summary import METRICS, OF_RUNS
from robochoc.experiments.task import Limits, ProblemSpec, Recording, Setup
from robochoc.formats.diagnostics import MistakeError, invalid_input, shortened, suggestion
from robochoc.formats.toml import convert, toml_tables
from robochoc.run.options import Runtime
from robochoc.system.suggestions import did_you_mean

LARGEST_FILE = 2**20
"""The maximum size of a study's file, in bytes."""
_TOP = ("title", "problems", "runs", "limits", "repeat", "record", "report")
MOST_REPETITIONS = 1000
MOST_MEMORY_MB = 2**30
WIDTH = 4.6
"""The default width of figures in inches: a little more than one column of a paper."""


class ReportSettings(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """The settings for a report, from the table `[report]`.

    Attributes:
        over: The parameter on the x-axis of figures. None: the first one with several values.
        each: A parameter of problems: each of its values has separate tables and figures. None: all problems share the
            same tables and figures.
        metrics: The metrics to draw. Empty: the usual metrics that the results have.
        text: The introduction above the figures.
        width: The width of figures in inches.
        names: The names of ways to run in figures and tables, by label or by a word in labels.
    """

    over: str | None = None
    each: str | None = None
    metrics: tuple[str, ...] = ()
    text: str = ""
    width: Annotated[float, msgspec.Meta(ge=2, le=20)] = WIDTH
    names: dict[str, str] = {}


class Study(msgspec.Struct, frozen=True, kw_only=True):
    """A study.

    Attributes:
        name: The name of the study's file, without the extension.
        title: The title.
        text: The content of the study's file.
        problems: The problems, in the order of the file.
        setups: The protocols with their options, each with the seeds and limits of its runs.
        repeat: The number of repetitions of each run.
        record: The data recorded in addition to counts.
        report: The settings for a report.
    """

    name: str
    title: str
    text: str
    problems: tuple[ProblemSpec, ...]
    setups: tuple[tuple[Setup, tuple[int, ...], Limits], ...]
    repeat: int = 1
    record: tuple[Recording, ...] = ()
    report: ReportSettings = ReportSettings()


def read_study(path: Path) -> Study:
    """Return the study in the TOML file at `path`.

    Raises:
        InvalidInputError: if the file is invalid. The error contains the line.
    """
    text = _text(path)
    try:
        tables = toml_tables(text)
    except ValueError as wrong:
        raise invalid_input(
            path,
            f"is not a valid TOML file: {shortened(str(wrong))}",
            "the page Experiments of the documentation shows one",
        ) from None
    return study_of(tables, Place(path, text))


def study_of_tables(name: str, tables: Mapping[str, Any]) -> Study:
    """Return the study described by `tables`, without a file. Its `text` is the content of an equivalent file.

    Raises:
        InvalidInputError: if the tables are invalid.
    """
    study = study_of(tables, Place(Path(name), ""))
    return msgspec.structs.replace(study, text=toml_of(tables))


def toml_of(tables: Mapping[str, Any]) -> str:
    """Return plain values, followed by tables, as TOML. JSON's numbers, strings and lists are valid TOML."""
    parts = []
    for name, table in tables.items():
        if not isinstance(table, Mapping):
            parts.append(f"{name} = {_toml(table)}")
            continue
        lines = [f"{key} = {_toml(value)}" for key, value in table.items()]
        parts.append("\n".join([f"[{name}]", *lines, ""]))
    return "\n".join(parts)


def _toml(value: object) -> str:
    if isinstance(value, Mapping):
        return f"{{ {', '.join(f'{_toml(key)} = {_toml(one)}' for key, one in value.items())} }}"
    return msgspec.json.encode(value).decode()


def study_of(tables: Mapping[str, Any], place: Place) -> Study:
    """Return the study described by `tables`. Raises `InvalidInputError`."""
    place.check_keys(tables, _TOP)
    limits = _convert(tables.get("limits", {}), Limits, place.below("limits"))
    problems = [one for table, at in _tables(tables, "problems", place) for one in problems_of(table, at)]
    setups = [one for table, at in _tables(tables, "runs", place) for one in setups_of(table, limits, at)]
    named = distinct([(setup, limit) for setup, _, limit in setups])
    if clash := _same_labels(named, setups):
        raise place.below("runs").mistake("label", f"{shortened(clash)} is the label of several ways to run")
    if len({setup.objectives for setup in named}) > 1:
        hint = "use one for all runs, and a study for each"
        raise place.below("runs").mistake("objectives", "costs of different objectives cannot be compared", hint)
    repeat = tables.get("repeat", 1)
    if type(repeat) is not int or not 1 <= repeat <= MOST_REPETITIONS:
        raise place.mistake(
            "repeat", f"expected an integer from 1 to {MOST_REPETITIONS:,}, got {shortened(str(repeat))}"
        )
    report = _convert(tables.get("report", {}), ReportSettings, place.below("report"))
    _check_report_settings(report, problems, named, place.below("report"))
    return Study(
        name=place.path.stem,
        title=_word(tables, "title", place) or place.path.stem,
        text=place.text,
        problems=tuple(problems),
        setups=tuple((setup, seeds, limit) for setup, (_, seeds, limit) in zip(named, setups, strict=True)),
        repeat=repeat,
        record=_recordings(tables.get("record", []), place, {setup.runtime for setup in named}),
        report=report,
    )


def _tables(tables: Mapping[str, Any], name: str, place: Place) -> Iterator[tuple[Mapping[str, Any], Place]]:
    """Yield the tables `[name]` or `[[name]]`, each with its place in the file."""
    keys = PROBLEM_KEYS if name == "problems" else RUN_KEYS
    found = tables.get(name)
    several = found if isinstance(found, list) else [found] if found is not None else []
    if not several or not all(isinstance(one, dict) for one in several):
        raise place.mistake(name, f"expected a table, [{name}] or [[{name}]], with {', '.join(keys[:3])}, ...")
    for number, one in enumerate(several):
        yield one, place.below(name, number)


def _convert(table: object, kind: Any, place: Place) -> Any:  # noqa: ANN401 - of `kind`
    try:
        found = convert(table, kind, place.text, HINT, place.table)
    except MistakeError as wrong:
        raise invalid_input(place.path, wrong.message, wrong.hint, wrong.line) from None
    if isinstance(found, Limits):
        for name in Limits.__struct_fields__:
            value = getattr(found, name)
            if value is not None and not 0 < value <= MAX_INTEGER:
                raise place.mistake(name, f"expected more than 0, and no more than 2^53, got {value:g}")
        if (found.memory_mb or 0) > MOST_MEMORY_MB:
            raise place.mistake("memory_mb", f"expected no more than {MOST_MEMORY_MB:,}, got {found.memory_mb:,}")
    return found


def _same_labels(named: Sequence[Setup], setups: Sequence[tuple[Setup, tuple[int, ...], Limits]]) -> str:
    """Return a label that several different ways to run share, or an empty text if there is none."""
    ways: dict[str, Any] = {}
    for one, (setup, _, limits) in zip(named, setups, strict=True):
        way = msgspec.structs.replace(setup, label=""), limits
        if ways.setdefault(one.label, way) != way:
            return one.label
    return ""


def _check_report_settings(
    wishes: ReportSettings, problems: Sequence[ProblemSpec], setups: Sequence[Setup], place: Place
) -> None:
    """Raise `InvalidInputError` for a parameter or metric that the results will not have, before the runs start."""
    parameters = {name for one in problems for name in (*one.parameters, *(f"scenario_{n}" for n in one.scenario))}
    same = {f"problem_{name}" for name in parameters}
    of_problems = [*sorted(parameters), "problems", "team"]
    of_runs = [*OF_RUNS, *sorted({name for one in setups for name in one.settings} - {*OF_RUNS})]
    for key, name, known in (("over", wishes.over, [*of_problems, *of_runs]), ("each", wishes.each, of_problems)):
        if name is not None and name not in known and name not in same:
            hint = did_you_mean(name, known, f"the parameters are {', '.join(known)}")
            raise place.mistake(key, f"there is no parameter {shortened(name)}", hint)
    for name in wishes.metrics:
        if name not in METRICS:
            raise place.mistake(
                "metrics", f"there is no metric {shortened(name)}", suggestion(name, METRICS, "metrics")
            )


def _word(table: Mapping[str, Any], name: str, place: Place) -> str:
    word = table.get(name, "")
    if not isinstance(word, str):
        raise place.mistake(name, f"expected a text, got {shortened(str(word))}")
    if not word.isprintable():
        raise place.mistake(name, f"expected one line without control characters, got {shortened(word)}")
    return word


def _recordings(words: object, place: Place, runtimes: Collection[str]) -> tuple[Recording, ...]:
    several: Sequence[object] = words if isinstance(words, list) else [words]
    for word in several:
        if not isinstance(word, str) or word not in set(map(str, Recording)):
            raise place.mistake("record", f"expected {' or '.join(Recording)}, got {shortened(str(word))}")
    for one in (Recording.ROBOTS, Recording.JOURNAL):
        if one in several and Runtime.ARRAYS in runtimes:
            raise place.mistake("record", f"{one} cannot be used with the runtime arrays, which sends no messages")
    return tuple(one for one in Recording if one in several)


def _text(path: Path) -> str:
    try:
        with path.open("rb") as file:
            content = file.read(LARGEST_FILE + 1)
    except OSError as error:
        hint = "give the TOML file of a study; the page Experiments of the documentation shows one"
        raise invalid_input(path, f"cannot be read: {error.strerror}", hint) from None
    if len(content) > LARGEST_FILE:
        raise invalid_input(
            path, f"is too large for a study's file, which has up to {LARGEST_FILE:,} bytes", "shorten it"
        )
    try:
        return content.decode()
    except UnicodeDecodeError:
        raise invalid_input(path, "is not UTF-8", "save it as TOML in UTF-8") from None


def report_settings(text: str) -> ReportSettings:
    """Return the report settings in the text of a valid study file."""
    table = toml_tables(text).get("report", {}) if text else {}
    return msgspec.convert(table, ReportSettings)
