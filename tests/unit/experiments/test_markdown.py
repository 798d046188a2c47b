"""Reports in Markdown, and what all reports tell: parts, pairs at each value of a parameter of runs."""

from __future__ import annotations

import csv
import io
import tomllib
from functools import cache
from statistics import mean, median
from typing import Any

import pytest

from robochoc.experiments import statistics, summary
from robochoc.experiments.export import export_results
from robochoc.experiments.markdown import markdown_page, markdown_table
from robochoc.experiments.report_content import ReportContent
from robochoc.experiments.results import Results
from robochoc.formats.diagnostics import InvalidInputError
from tests.support.studies import COSTS, SMALL, finished

pytest.importorskip("scipy")


@cache
def made(text: str) -> Results:
    """Return the results of the study whose file has this text; each is carried out once."""
    return finished(text)._replace(text=text)


def told(text: str, report: str = "") -> str:
    """Return the page of the study whose file has this text, and then a table `[report]`."""
    return markdown_page(made(text)._replace(text=text + report), "page.md")


def tables(page: str, heading: str) -> list[list[str]]:
    """Return the lines of the table under a heading, without the rule."""
    _, _, rest = page.partition(f"{heading}\n\n")
    lines = rest.partition("\n\n")[0].splitlines()
    return [[cell.strip() for cell in line.strip("|").split("|")] for line in lines if "---" not in line]


def test_the_page_has_medians_endings_problems_pairs_and_the_study() -> None:
    text = SMALL.replace("0.5]", "0.7]")
    results = made(text)
    page = told(text)
    assert page.startswith("# study\n\n12 runs: 6 problems, 2 ways to run.")
    assert "counts are exact" in page
    heads, lines = summary.medians(results.rows, "ncccs", "tightness")
    assert tables(page, "### NCCCs") == [heads, *lines]
    assert tables(page, "## How runs ended")[1:] == summary.endings(results.rows)[1]
    decided = tables(page, "## Problems with a solution")
    assert decided[0] == ["tightness", "problems", "with a solution", "without"]
    assert decided[1] == ["0.2", "3", "3", "0"]
    assert int(decided[2][3]) == 3 - int(decided[2][2]) > 0
    assert [line[:2] for line in tables(page, "### Pairs: messages")[1:]] == [["abt / afc-ng", "6"]]
    assert f"```toml\n{text.strip()}\n```" in page
    assert "robochoc experiment report study.sqlite -o page.md" in page


def test_a_page_is_the_same_wherever_it_was_made() -> None:
    first = made(SMALL)
    second = first._replace(rows=tuple({**row, "machine": "elsewhere"} for row in first.rows))
    assert markdown_page(first, "page.md") == markdown_page(second, "page.md")
    timed = first._replace(text='[report]\nmetrics = ["wall_s"]\n')
    assert f" on {timed.rows[0]['machine']}." in markdown_page(timed, "page.md")


def test_the_text_of_the_study_is_told_once() -> None:
    report = '[report]\nover = "seed"\ntext = """\nWhat is\nlearned.\n\nAnd more."""\nmetrics = ["ncccs"]\n'
    page = told(SMALL, report)
    assert page.count("learned") == 1
    assert "\n\nWhat is\nlearned.\n\nAnd more.\n\n12 runs" in page
    quoted = tomllib.loads(page.split("```toml\n")[1].split("\n```")[0])
    assert quoted["report"] == {"over": "seed", "metrics": ["ncccs"]}
    doubtful = f'{report}[more]\ntitle = """\ntext = ""\n"""\n'
    assert told(SMALL, doubtful).count("learned") == 2  # where it cannot be cut for sure, the file is told whole


def test_parts_have_tables_of_their_own() -> None:
    page = told(COSTS, '[report]\nover = "cycles"\neach = "agents"\nmetrics = ["cost", "messages"]\n')
    assert all(f"### {metric}: agents {agents}\n" in page for metric in ("cost", "messages") for agents in (5, 7))
    parts = summary.parts(made(COSTS).rows, "agents")
    assert [(name, len(rows)) for name, rows in parts] == [("agents 5", 16), ("agents 7", 16)]
    assert summary.parts([{"problems": "a", "key": 1}], "problems") == [("a", [{"problems": "a", "key": 1}])]
    with pytest.raises(InvalidInputError, match="no parameter 'delay' of problems"):
        told(SMALL, '[report]\neach = "delay"\n')


def test_ways_to_run_have_the_names_that_a_paper_gives_them() -> None:
    text = '[report]\nnames = { dsa = "DSA", sfb = "SFB", "dsa variant=B" = "DSA-B" }\nmetrics = ["cost"]\n'
    wished = made(COSTS)._replace(text=text)
    ways = ["SFB", "syncbb", "DSA variant=A", "DSA-B"]
    assert tables(told(COSTS, text), "### cost")[0] == ["agents", *ways]
    assert f" & {' & '.join(ways)} \\\\" in export_results(wished, "latex").decode()
    with pytest.raises(InvalidInputError, match="two ways to run would have the same name"):
        told(COSTS, '[report]\nnames = { sfb = "x", syncbb = "x" }\n')


def test_a_summary_has_medians_and_means_with_their_intervals() -> None:
    results = made(COSTS)._replace(text='[report]\neach = "agents"\nmetrics = ["cost", "cycles"]\n')
    table = list(csv.DictReader(io.StringIO(export_results(results, "summary").decode())))
    ways = ["sfb", "syncbb", "dsa variant=A", "dsa variant=B"]
    assert [(row["part"], row["metric"], row["label"]) for row in table] == [
        (f"agents {agents}", metric, way) for agents in (5, 7) for metric in ("cost", "cycles") for way in ways
    ]
    costs = [row["cost"] for row in results.rows if row["label"] == "dsa variant=A" and row["agents"] == 7]
    (one,) = [row for row in table if (row["part"], row["metric"], row["label"]) == ("agents 7", "cost", ways[2])]
    assert (one["agents"], one["runs"], one["at_limit"]) == ("7", "4", "0")
    assert (float(one["median"]), float(one["mean"])) == (median(costs), mean(costs))
    assert min(costs) <= float(one["mean_low"]) <= mean(costs) <= float(one["mean_high"]) <= max(costs)
    refused = tuple({**row, "status": "refused", "cost": None} for row in results.rows)
    without = list(csv.DictReader(io.StringIO(export_results(results._replace(rows=refused), "summary").decode())))
    assert {(row["runs"], row["median"], row["mean_low"]) for row in without if row["metric"] == "cost"} == {
        ("0", "", "")
    }


def test_problems_are_in_the_natural_order_of_their_names() -> None:
    given = [{"instance": name, "team": name} for name in ("p10", "p2", "p1")]
    assert [summary.values_of(given, name) for name in ("instance", "team")] == [["p1", "p2", "p10"]] * 2


def test_a_wide_table_is_turned() -> None:
    text = SMALL.replace('["abt", "afc-ng"]', '["abt", "afc", "afc-ng", "afc-tree"]\norder = ["given", "dfs"]')
    page = told(text)
    assert tables(page, "### messages")[0] == ["tightness", "0.2", "0.5"]
    assert [line[0] for line in tables(page, "### messages")[1:]][:2] == ["abt given", "abt dfs"]
    assert len(tables(page, "### Pairs: messages")) == 8
    assert "Only those with the first way" in page


def test_a_cell_cannot_break_a_table() -> None:
    assert markdown_table(["a|b", ""], [["c\nd", "1"]]) == "| a\\|b |  |\n| --- | --- |\n| c\\nd | 1 |\n"


def runs(delay: int, **values: float) -> list[dict[str, Any]]:
    given = {"seed": 0, "repetition": 1, "status": "done", "case": delay}
    return [
        {**given, "label": label, "digest": str(case), "messages": value + case}
        for label, value in values.items()
        for case in range(8)
    ]


def test_runs_are_compared_at_each_value_of_a_parameter_of_runs() -> None:
    """And all tests are corrected together."""
    found = statistics.comparisons([*runs(0, a=1, b=3), *runs(50, a=5, b=2)], "messages")
    assert [(one.at, one.pairs, one.one_better, one.other_better) for one in found] == [(0, 8, 8, 0), (50, 8, 0, 8)]
    (alone,) = statistics.comparisons(runs(0, a=1, b=3), "messages")
    assert alone.p is not None
    assert [one.p for one in found] == [pytest.approx(2 * alone.p)] * 2


def test_delays_are_told_apart() -> None:
    results = made(SMALL.replace("1..3", "1..4") + "delay = [0, 9]\n")
    wished = results._replace(text='[report]\nover = "delay"\nmetrics = ["messages"]\n')
    ((name, (heads, lines)),) = ReportContent(wished, None).pairs()
    assert (name, heads[:2], [line[:3] for line in lines]) == (
        "messages",
        ["delay", ""],
        [["0", "abt / afc-ng", "8"], ["9", "abt / afc-ng", "8"]],
    )
