"""Summaries of results: medians of a metric over a parameter, for each way to run."""

from __future__ import annotations

import math
import statistics
from collections import Counter
from collections.abc import Mapping, Sequence
from types import MappingProxyType
from typing import Any, NamedTuple

from robochoc.experiments.task import Status
from robochoc.model.outcome import Verdict
from robochoc.model.priorities import natural_key
from robochoc.system.errors import RobochocError
from robochoc.system.lazy_dataclass import dataclass
from robochoc.system.plain_text import listed

Rows = Sequence[Mapping[str, Any]]

METRICS: Mapping[str, str] = MappingProxyType(
    {
        "messages": "messages",
        "ncccs": "NCCCs",
        "bytes": "bytes",
        "checks": "constraint checks",
        "cycles": "cycles",
        "simulated_s": "simulated seconds",
        "cost": "cost",
        "wall_s": "seconds of the search",
        "total_s": "seconds of the whole run",
        "cpu_s": "seconds of the processor",
        "memory": "bytes of memory",
        "largest": "bytes of the largest message",
    }
)
"""The metrics, with their names for an axis."""
CENSORED = ("messages", "ncccs", "bytes", "checks", "cycles", "simulated_s", "wall_s", "total_s", "cpu_s")
"""Metrics whose values are lower bounds if a limit ended the run."""
OF_RUNS = ("order", "schedule", "delay", "withdraw", "runtime", "channel", "seed")
"""Parameters of runs, which can also be the axis of tables and figures."""
SINGLE = ("instance", "team")
"""Parameters that identify single problems."""
MOST_TEAMS = 12
"""The most problems with separate lines by default."""
_MOST = {"instance": MOST_TEAMS}
"""The most values of a parameter that can be the default axis."""
SEEDS = ("seed", "problem_seed", "scenario_seed")
"""Parameters with random seeds, which are not part of a setting."""
Setting = tuple[tuple[str, Any], ...]
"""The name and parameters of a group of problems, without seeds."""
DEFAULT_METRICS = ("messages", "ncccs", "bytes")


class NoSuchColumnError(RobochocError, ValueError):
    """The results have no parameter or metric with this name."""


@dataclass(frozen=True)
class Sample:
    """The results of one way to run at one value of the parameter.

    Attributes:
        values: The metric's values in runs with a verdict, and in runs that a limit ended if their value is known.
        problems: The problem for each value.
        censored: The number of values from runs that a limit ended.
        failed: The number of runs without a value, for instance because they crashed or were refused.
        open_ended: True if the median is only a lower bound: without the limit that ended runs it would be higher.
    """

    values: tuple[float, ...]
    problems: tuple[str, ...] = ()
    censored: int = 0
    failed: int = 0
    open_ended: bool = False

    @property
    def median(self) -> float | None:
        """The median, or None if there are no values."""
        return statistics.median(self.values) if self.values else None


def parameters(rows: Rows) -> list[str]:
    """Return the names of the problems' parameters in their original order."""
    names: dict[str, None] = {}
    for row in rows:
        for name in row:
            if name == "key":
                break
            names[name] = None
    return list(names)


def parameter_to_draw_over(rows: Rows, wanted: str | None = None) -> str:
    """Return the parameter that is the axis of tables and figures.

    Args:
        rows: The results.
        wanted: The requested name. None: the first parameter, except seeds, that all problems have and that has several
            values; if there is none, the problems, or the kinds of problems if there are many problems or only seeds
            differ.

    Raises:
        NoSuchColumnError: if the results have no such parameter.
    """
    of_problems = parameters(rows)
    known = [*of_problems, "problems", "team", *OF_RUNS, *_settings(rows)]
    if wanted == "name" and wanted not in known:
        return "problems"
    if wanted is not None:
        if wanted not in known:
            raise NoSuchColumnError(f"there is no parameter {wanted!r}; there are {', '.join(known)}")
        return wanted
    for name in of_problems:
        several = len({row.get(name) for row in rows})
        if name not in SEEDS and all(name in row for row in rows) and 1 < several <= _MOST.get(name, several):
            return name
    digests = len({row["digest"] for row in rows})
    seeded = any(name in SEEDS for name in of_problems)
    if digests > 1 and seeded and len({_setting(row, of_problems) for row in rows}) == 1:
        return "problems"
    if digests == 1:
        return next((name for name in OF_RUNS if _parts_labels(rows, name)), "team")
    return "team" if len({row["team"] for row in rows}) <= MOST_TEAMS else "problems"


def _parts_labels(rows: Rows, name: str) -> bool:
    """Return whether every way to run was run with several values of a parameter of runs."""
    ways: dict[str, set[Any]] = {}
    for row in rows:
        ways.setdefault(_without(row["label"], name, row[name]), set()).add(row[name])
    return name not in SEEDS and len(ways) < len(labels(rows)) and all(len(values) > 1 for values in ways.values())


def by_parameter(rows: Rows, over: str) -> Rows:
    """Return `rows` for tables and figures over `over`: if it is a parameter of runs, it becomes a column.

    The parameter is removed from the labels: `abt delay=20` and `abt delay=50` both become `abt`. The column `case`
    distinguishes runs with the same label and problem.
    """
    if over in OF_RUNS:
        values = [row[over] for row in rows]
    elif over in _settings(rows):
        values = [row["settings"].get(over) for row in rows]
    else:
        return rows
    shorter = [_without(row["label"], over, value) for row, value in zip(rows, values, strict=True)]
    meant: dict[str, set[str]] = {}
    for row, label in zip(rows, shorter, strict=True):
        meant.setdefault(label, set()).add(_way(row, over))
    return [
        {**row, over: value, "case": value, "label": label if len(meant[label]) == 1 else row["label"]}
        for row, value, label in zip(rows, values, shorter, strict=True)
    ]


class Prepared(NamedTuple):
    """The results as tables and figures show them.

    Attributes:
        over: The parameter on the axis of tables and figures.
        rows: The results. For a problem without this parameter, its name is the value.
        remarks: Sentences about results that are left out.
    """

    over: str
    rows: Rows
    remarks: list[str]


def prepare(rows: Rows, over: str | None, names: Mapping[str, str]) -> Prepared:
    """Return the results as tables and figures show them.

    Args:
        rows: The results.
        over: The requested parameter; see `parameter_to_draw_over`.
        names: The names of ways to run; see `named`.

    Raises:
        NoSuchColumnError: if the parameter does not exist, or two ways to run would have the same name.
    """
    kept, remarks = without_duplicates(rows, parameters(rows))
    over = parameter_to_draw_over(kept, over)
    columns = dict.fromkeys(parameters(kept))
    whole = [{**{name: row.get(name, row["problems"]) for name in columns}, **row} for row in kept]
    return Prepared(over, named(by_parameter(whole, over), names), remarks)


def _way(row: Mapping[str, Any], over: str) -> str:
    """Return a way to run without the parameter `over`, since different ways may have the same label."""
    settings = {name: value for name, value in row["settings"].items() if name != over}
    return str([row["protocol"], sorted(settings.items()), *(row[name] for name in OF_RUNS if name != over)])


def parts(rows: Rows, each: str | None) -> list[tuple[str, Rows]]:
    """Return the parts of the results that have separate tables and figures, each with its name.

    Args:
        rows: The results.
        each: The parameter whose values define the parts. None: all results are one part without a name.

    Raises:
        NoSuchColumnError: if the results have no such parameter.
    """
    if each is None:
        return [("", rows)]
    known = [*parameters(rows), "problems", "team"]
    if each not in known:
        raise NoSuchColumnError(f"there is no parameter {each!r} of problems; there are {', '.join(known)}")
    name = "" if each in {"problems", "team"} else f"{each} "
    return [(f"{name}{value}", [row for row in rows if row.get(each) == value]) for value in values_of(rows, each)]


def named(rows: Rows, names: Mapping[str, str]) -> Rows:
    """Return `rows` with ways to run renamed, by their whole label or by a word in it.

    Raises:
        NoSuchColumnError: if two ways to run would have the same name.
    """
    if not names:
        return rows
    known = {way: names.get(way) or " ".join(names.get(word, word) for word in way.split()) for way in labels(rows)}
    if len(set(known.values())) < len(known):
        raise NoSuchColumnError("names: two ways to run would have the same name")
    return [{**row, "label": known[str(row["label"])]} for row in rows]


def _settings(rows: Rows) -> list[str]:
    return list(dict.fromkeys(name for row in rows for name in row.get("settings", ())))


def _without(label: str, name: str, value: object) -> str:
    return " ".join(word for word in label.split() if word not in {f"{name}={value}", str(value)}) or label


def metrics_to_show(rows: Rows, wanted: Sequence[str] = (), over: str = "") -> list[str]:
    """Return the metrics to show: the wanted ones, or by default the usual metrics that the results have.

    The parameter `over` is left out, since `cycles`, for instance, is also a setting of local search protocols.

    Raises:
        NoSuchColumnError: if the results have no such metric.
    """
    for name in wanted:
        if name not in METRICS:
            raise NoSuchColumnError(f"there is no metric {name!r}; there are {', '.join(METRICS)}")
    if wanted:
        return list(wanted)
    usual = [*DEFAULT_METRICS, "cycles", "simulated_s", "cost"]
    if any(row["runtime"] not in {"simulator", "arrays"} for row in rows):
        usual.append("wall_s")
    return [name for name in usual if name != over and any(row[name] is not None for row in rows)]


def labels(rows: Rows) -> list[str]:
    """Return the labels of the ways to run, in the order of the study."""
    return list(dict.fromkeys(str(row["label"]) for row in rows))


def values_of(rows: Rows, name: str) -> list[Any]:
    """Return the values of a parameter: numbers ascending, problems by name, others in the original order."""
    found = list(dict.fromkeys(row.get(name) for row in rows))
    if name in SINGLE:
        return sorted(found, key=lambda value: natural_key(str(value)))
    numbers = [value for value in found if isinstance(value, (int, float))]
    return [*sorted(numbers), *(value for value in found if not isinstance(value, (int, float)))]


def samples(rows: Rows, metric: str, over: str) -> dict[tuple[Any, str], Sample]:
    """Return the sample for each value of the parameter `over` and each way to run."""
    groups: dict[tuple[Any, str], list[Mapping[str, Any]]] = {}
    for row in rows:
        groups.setdefault((row.get(over), str(row["label"])), []).append(row)
    return {key: sample(group, metric) for key, group in groups.items()}


def samples_of_all(rows: Rows, metric: str) -> dict[str, Sample]:
    """Return the sample of all problems for each way to run."""
    return {way: sample([row for row in rows if row["label"] == way], metric) for way in labels(rows)}


def sample(rows: Rows, metric: str) -> Sample:
    """Return the sample of a metric's values in `rows`."""
    counted = [row for row in rows if _counts(row, metric)]
    cut = [metric in CENSORED and row["status"] == Status.LIMIT for row in counted]
    values, problems = tuple(float(row[metric]) for row in counted), tuple(str(row["digest"]) for row in counted)
    without_end = [math.inf if open_ended else value for value, open_ended in zip(values, cut, strict=True)]
    higher = any(cut) and statistics.median(without_end) > statistics.median(values)
    return Sample(values, problems, sum(cut), len(rows) - len(counted), higher)


def _counts(row: Mapping[str, Any], metric: str) -> bool:
    return row[metric] is not None and row["status"] in {Status.DONE, Status.LIMIT, Status.ENDED}


Table = tuple[list[str], list[list[str]]]
"""The headings and the lines of a table."""


def medians(rows: Rows, metric: str, over: str) -> Table:
    """Return a metric's medians: a line for each value of the parameter `over`, a column for each way to run.

    If the lines are single problems, a further line summarises all problems.
    """
    found = samples(rows, metric, over)
    ways = labels(rows)
    lines = [[str(value), *(cell(found.get((value, way))) for way in ways)] for value in values_of(rows, over)]
    if over in SINGLE and len(lines) > 1:
        lines.append(["all", *map(cell, samples_of_all(rows, metric).values())])
    return [over, *ways], lines


def reached(rows: Rows, over: str) -> Table:
    """Return how many runs, out of all runs, reached the best known cost of their problem."""
    best: dict[str, float] = {}
    for row in rows:
        if _counts(row, "cost"):
            better = max if row["maximises"] else min
            best[row["digest"]] = better(best.get(row["digest"], row["cost"]), row["cost"])
    counts: dict[tuple[Any, str], list[bool]] = {}
    for row in rows:
        counts.setdefault((row.get(over), str(row["label"])), []).append(
            _counts(row, "cost") and row["cost"] == best[row["digest"]]
        )
    ways = labels(rows)
    lines = [[str(value), *(_share(counts.get((value, way), [])) for way in ways)] for value in values_of(rows, over)]
    return [over, *ways], lines


def _share(found: Sequence[bool]) -> str:
    return f"{sum(found)} of {len(found)}" if found else "-"


def endings(rows: Rows) -> Table:
    """Return the verdicts of runs, or the statuses of runs without a verdict: a line for each way to run."""
    kinds = Counter(_ending(row) for row in rows)
    by_way: dict[str, Counter[str]] = {way: Counter() for way in labels(rows)}
    for row in rows:
        by_way[str(row["label"])][_ending(row)] += 1
    heads = [kind for kind, _ in kinds.most_common()]
    return ["", *heads], [[way, *(f"{count[kind]:,}" for kind in heads)] for way, count in by_way.items()]


def solved(rows: Rows, over: str) -> Table:
    """Return the numbers of problems with and without a solution, as far as known, for each value of a parameter."""
    found: dict[Any, dict[str, set[str]]] = {}
    for row in rows:
        kinds = found.setdefault(row.get(over), {kind: set() for kind in ("problems", "with", "without")})
        kinds["problems"].add(row["digest"])
        if row["status"] == Status.DONE:
            kinds["without" if row["verdict"] == Verdict.NO_SOLUTION else "with"].add(row["digest"])
    heads = [over, "problems", "with a solution", "without"]
    return heads, [[str(value), *(f"{len(one):,}" for one in found[value].values())] for value in values_of(rows, over)]


def _ending(row: Mapping[str, Any]) -> str:
    return str(row["verdict"] if row["status"] == Status.DONE else row["status"])


def cell(one: Sample | None) -> str:
    """Return the text for a sample in a table: the median, with a sign if it is only a lower bound."""
    if one is None or one.median is None:
        return "-"
    return f"{'>= ' * one.open_ended}{number(one.median)}"


def number(value: float) -> str:
    """Return a number as text with about four digits."""
    if not math.isfinite(value):
        return str(value)
    if value == int(value) or abs(value) >= 1000:  # noqa: PLR2004 - digits before the point suffice
        return f"{value:,.0f}"
    return f"{value:.3g}" if abs(value) < 1 else f"{value:,.2f}"


def without_duplicates(
    rows: Sequence[Mapping[str, Any]], parameters: Sequence[str]
) -> tuple[list[Mapping[str, Any]], list[str]]:
    """Return the results without settings that repeat an earlier setting's problems, and sentences about these.

    Two settings are the same if they have the same problem for each seed. Different seeds of one setting may well have
    the same problem, since small problems are often generated twice.

    Args:
        rows: The results of a study.
        parameters: The names of the problems' parameters.
    """
    problems: dict[Setting, dict[Setting, str]] = {}
    for row in rows:
        seeds = tuple((name, row.get(name)) for name in parameters if name in SEEDS)
        problems.setdefault(_setting(row, parameters), {})[seeds] = row["digest"]
    first: dict[Setting, Setting] = {}
    alike: dict[frozenset[tuple[Setting, str]], list[Setting]] = {}
    for setting, digests in problems.items():
        content = frozenset(digests.items()) if all(digests.values()) else frozenset({(setting, "")})
        alike.setdefault(content, []).append(setting)
    for settings in alike.values():
        first.update(dict.fromkeys(settings, settings[0]))
    kept = [row for row in rows if first[setting := _setting(row, parameters)] == setting]
    return kept, [_sentence(settings) for settings in alike.values() if len(settings) > 1]


def _setting(row: Mapping[str, Any], parameters: Sequence[str]) -> Setting:
    """Return the name and parameters of a row's group of problems, without seeds."""
    given = tuple((name, row.get(name)) for name in parameters if name not in SEEDS)
    return (("problems", row.get("problems")), *given)


def _sentence(settings: Sequence[Setting]) -> str:
    """Return a sentence about settings that have the same problems."""
    several = [name for place, (name, _) in enumerate(settings[0]) if len({one[place] for one in settings}) > 1]
    words = [", ".join(f"{name} {value}" for name, value in one if name in several) for one in settings]
    return f"{listed(words)} generate the same problems: they are counted once, as {words[0]}."
