"""Exports results for other programs: CSV, JSON lines, Parquet, and tables of medians in LaTeX and CSV."""

from __future__ import annotations

import csv
import io
from collections.abc import Mapping, Sequence
from typing import Any

import msgspec

from robochoc.experiments import summary
from robochoc.experiments.results import Results
from robochoc.experiments.statistics import mean_interval, median_interval
from robochoc.experiments.study import report_settings
from robochoc.solver.errors import UnsupportedError
from robochoc.system.plain_text import on_one_line

_NESTED = ("settings", "messages_by_type", "cost_over_time", "loads")
"""The columns that are written as JSON in formats whose cells are text."""
_LATEX = str.maketrans(
    {sign: f"\\{sign}" for sign in "&%$#_{}"}
    | {"~": r"\textasciitilde{}", "\\": r"\textbackslash{}", "^": r"\textasciicircum{}"}
)


def export_results(results: Results, form: str, over: str | None = None) -> bytes:
    """Return the results of a study in the format `csv`, `json`, `latex`, `parquet` or `summary`.

    Args:
        results: The results.
        form: The format.
        over: The parameter of the tables `latex` and `summary`. None: the study's parameter, or the default.

    Raises:
        NoSuchColumnError: if the results have no such parameter.
        UnsupportedError: if the package that writes the format is not installed.
    """
    rows = results.rows
    match form:
        case "csv":
            return _csv(rows).encode()
        case "json":
            return b"".join(msgspec.json.encode(row) + b"\n" for row in rows)
        case "latex":
            wishes = report_settings(results.text)
            axis, shown = summary.prepare(rows, over or wishes.over, wishes.names)[:2] if rows else ("", rows)
            return latex_table(shown, results.title, axis, wishes.metrics).encode()
        case "summary":
            return _csv(summary_rows(results, over)).encode()
        case _:
            return _parquet(rows)


def summary_rows(results: Results, over: str | None = None) -> list[dict[str, Any]]:
    """Return a row for each part, value of the parameter, metric and way to run.

    If the values are single problems, further rows with the value `all` summarise them. A row has the number of runs
    with a value, of values that a limit ended, the median and the mean, each with its 95 % confidence interval. Without
    a value these are None.
    """
    if not results.rows:
        return []
    wishes = report_settings(results.text)
    axis, rows, _ = summary.prepare(results.rows, over or wishes.over, wishes.names)
    found = []
    for part, of_part in summary.parts(rows, wishes.each):
        for metric in summary.metrics_to_show(of_part, wishes.metrics, axis):
            samples = summary.samples(of_part, metric, axis)
            if axis in summary.SINGLE and len(summary.values_of(of_part, axis)) > 1:
                samples |= {("all", way): sample for way, sample in summary.samples_of_all(of_part, metric).items()}
            for (value, way), sample in samples.items():
                place = {axis: value, **({"part": part} if part else {}), "metric": metric, "label": way}
                found.append(place | _statistics_of(sample))
    return found


def _statistics_of(sample: summary.Sample) -> dict[str, Any]:
    counts: dict[str, Any] = {"runs": len(sample.values), "at_limit": sample.censored}
    names = ("median", "median_low", "median_high", "mean", "mean_low", "mean_high")
    if not sample.values:
        return counts | dict.fromkeys(names)
    median = median_interval(sample.values, sample.problems)
    mean = mean_interval(sample.values, sample.problems)
    values = (median.median, median.low, median.high, mean.mean, mean.low, mean.high)
    return counts | dict(zip(names, values, strict=True))


def _columns(rows: Sequence[Mapping[str, Any]]) -> list[str]:
    parameters = summary.parameters(rows)
    others = [name for name in rows[0] if name not in parameters] if rows else []
    return [*parameters, *others]


def _flat(rows: Sequence[Mapping[str, Any]]) -> list[dict[str, Any]]:
    """Return rows that all have the same columns, with plain values."""
    columns = _columns(rows)
    return [
        {name: msgspec.json.encode(row[name]).decode() if name in _NESTED else row.get(name) for name in columns}
        for row in rows
    ]


def _csv(rows: Sequence[Mapping[str, Any]]) -> str:
    out = io.StringIO()
    writer = csv.DictWriter(out, _columns(rows), lineterminator="\n")
    writer.writeheader()
    writer.writerows(_flat(rows))
    return out.getvalue()


def _parquet(rows: Sequence[Mapping[str, Any]]) -> bytes:
    try:
        from pyarrow import BufferOutputStream, Table  # noqa: PLC0415 - an extra
        from pyarrow.parquet import write_table  # noqa: PLC0415 - the same
    except ModuleNotFoundError:
        raise UnsupportedError(
            "Parquet needs pyarrow, which is not installed: pip install 'robochoc[parquet]'"
        ) from None
    out = BufferOutputStream()
    write_table(Table.from_pylist(_flat(rows)), out)
    return bytes(out.getvalue())


def _latex(text: str) -> str:
    return on_one_line(text).translate(_LATEX)


def latex_table(rows: Sequence[Mapping[str, Any]], title: str, over: str, metrics: Sequence[str] = ()) -> str:
    """Return a LaTeX table of medians with a block of lines for each metric. It requires the package booktabs.

    Args:
        rows: The results, as `summary.prepare` returns them.
        title: The title of the study.
        over: The parameter whose values are the table's lines.
        metrics: The metrics. Empty: the default metrics.
    """
    if not rows:
        return ""
    ways = summary.labels(rows)
    lines = [
        f"% {on_one_line(title)}: medians; >= marks those that a limit leaves open. Needs \\usepackage{{booktabs}}.",
        rf"\begin{{tabular}}{{l{'r' * len(ways)}}}",
        r"\toprule",
    ]
    for place, metric in enumerate(summary.metrics_to_show(rows, metrics, over)):
        found = summary.samples(rows, metric, over)
        lines += [r"\midrule"] * bool(place)
        heads = [f"{summary.METRICS[metric]}, {over}", *ways]
        lines += [f"{' & '.join(map(_latex, heads))} \\\\", r"\midrule"]
        for value in summary.values_of(rows, over):
            cells = [summary.cell(found.get((value, way))).replace(">= ", r"$\geq$") for way in ways]
            lines.append(f"{' & '.join([_latex(str(value)), *cells])} \\\\")
    return "\n".join([*lines, r"\bottomrule", r"\end{tabular}", ""])
