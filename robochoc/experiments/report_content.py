"""The content of a report on a study, shared by HTML (`report.py`) and Markdown (`markdown.py`)."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from robochoc.experiments import ranking, statistics, summary
from robochoc.experiments.results import Results
from robochoc.experiments.study import report_settings
from robochoc.experiments.summary import CENSORED, Table
from robochoc.formats.diagnostics import invalid_input

SIGNIFICANT = 0.05
MOST_TESTED = 2
"""The most metrics by which pairs of ways to run are compared."""
PAIRS_EXPLANATION = (
    "On problems that both have solved: how often each is better (by the median of its runs), the median of the"
    " ratio first / second and of the difference first - second, and Wilcoxon's signed-rank test, corrected for the"
    " number of pairs (Holm). A ratio of 0 to 0 is 1. There is no median ratio (-) of negative values, and where half"
    " of the ratios or more are to 0."
)
_OF_MACHINES = {"wall_s", "total_s", "cpu_s", "memory"}
"""Metrics that depend on the machine."""


class ReportContent:
    """The results of a study, with a report's texts and tables.

    Args:
        results: The results.
        over: The parameter of tables and figures. None: the study's parameter, or the first one with several values.

    Raises:
        InvalidInputError: if there are no results, or the parameter does not exist.
    """

    def __init__(self, results: Results, over: str | None) -> None:
        self.name, self.title, self.text, self.stopped, self.planned, rows = results
        self._all = rows
        if not rows:
            raise invalid_input(self.name, "has no results yet", "continue the study by robochoc experiment run")
        wishes = report_settings(self.text)
        self.introduction, self.width = wishes.text, wishes.width
        try:
            self.over, self.rows, self._remarks = summary.prepare(rows, over or wishes.over, wishes.names)
            self.metrics = summary.metrics_to_show(self.rows, wishes.metrics, self.over)
            self.parts = summary.parts(self.rows, wishes.each)
        except summary.NoSuchColumnError as wrong:
            raise invalid_input(
                self.name, str(wrong), "choose one by --over, or in the table [report] of the study"
            ) from None

    @property
    def paragraphs(self) -> list[str]:
        """The paragraphs of the introduction in the study's file."""
        return [part for part in self.introduction.strip().split("\n\n") if part]

    def measured(self) -> Iterator[str]:
        """Yield sentences about the runs, the machines, and the checks of answers."""
        count, rows = self.planned, self._all
        there = f"{len(rows):,} of {count:,} runs are finished" if len(rows) < count else f"{count:,} runs"
        problems, ways = len({row["digest"] for row in rows if row["digest"]}), len(summary.labels(self.rows))
        yield f"{there}: {problems:,} problems, {ways} ways to run."
        runtimes = {row["runtime"] for row in rows}
        simulated = runtimes <= {"simulator", "arrays"}
        exact = simulated and _OF_MACHINES.isdisjoint(self.metrics)
        machines, versions = (sorted({row[name] for row in rows if row[name]}) for name in ("machine", "version"))
        where = "" if exact else f" on {'; '.join(machines)}"
        yield f"robochoc {', '.join(versions)}{where}."
        if simulated:
            where = "in the simulator or in arrays" if "arrays" in runtimes else "in the simulator"
            yield f"All runs were {where}: counts are exact, and the same wherever they are repeated."
        checked = sum(row["verified"] for row in rows)
        text = f"The answers of {checked:,} runs were checked against every constraint in force"
        if self.stopped:
            why = self.stopped.partition("\n")[0]  # without the commands that repeat the runs
            yield f"{text}. The study was stopped: {why}"
        else:
            yield f"{text}, and no two answers to a problem contradict each other."
        yield from self._remarks

    def answers(self) -> list[str]:
        """Return sentences about the best configurations for each metric, and about groups of equal configurations."""
        return ranking.answers(self.rows, self.metrics)

    def pairs(self, *, first_only: bool = False) -> Iterator[tuple[str, Table]]:
        """Yield, for each compared metric, its name and a table of pairs, unless no test was possible.

        Args:
            first_only: True if only pairs with the first way to run are shown. All pairs are tested in any case.
        """
        for metric in [one for one in self.metrics if one in (*CENSORED, "cost")][:MOST_TESTED]:
            for part, rows in self.parts:
                first = summary.labels(rows)[0]
                found = statistics.comparisons(rows, metric)
                shown = [one for one in found if not first_only or one.one == first]
                if any(one.p is not None for one in shown):
                    yield headed(summary.METRICS[metric], part), self._table_of(shown)

    def _table_of(self, pairs: Sequence[statistics.Comparison]) -> Table:
        heads = ["", "problems", "first better", "second better", "median ratio", "median difference", "p"]
        lines = [_compared(one) for one in pairs]
        if all(one.at is None for one in pairs):
            return heads, lines
        return [self.over, *heads], [[str(one.at), *line] for one, line in zip(pairs, lines, strict=True)]


def headed(what: str, part: str) -> str:
    """Return a heading that ends with the name of the part of the problems, if there is one."""
    return f"{what}: {part}" if part else what


def _compared(one: statistics.Comparison) -> list[str]:
    p = "-" if one.p is None else f"{one.p:.2g}{' *' if one.p < SIGNIFICANT else ''}"
    ratio = "-" if one.ratio is None else f"{one.ratio:.2f}"
    better = [f"{one.one_better:,}", f"{one.other_better:,}"]
    difference = "-" if one.difference is None else summary.number(one.difference)
    return [f"{one.one} / {one.other}", f"{one.pairs:,}", *better, ratio, difference, p]
