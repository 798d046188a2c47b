"""The pages of replications say what their studies come to.

`python -m tests.docs.test_replications [STUDY...]` writes their tables, of all studies or of those named;
`--results FOLDER` keeps results there, so that what was run before is not run again.

A page names a study in a line that begins with "Study: [NAME]". Tables below it have a heading in italics: a metric, or
another word of `COUNTED`; `over` another parameter than the study's own if need be; and after a colon the name of the
problems that it is about.
"""

from __future__ import annotations

import argparse
import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

import pytest

from robochoc.experiments import summary
from robochoc.experiments.markdown import markdown_table
from robochoc.experiments.plan import plan_of
from robochoc.experiments.runner import run_study
from robochoc.experiments.store import Store
from robochoc.experiments.study import read_study, report_settings
from tests.support.program import ROOT

EXPLANATION = ROOT / "docs" / "explanation"
PAGES = [*sorted((EXPLANATION / "replications").glob("*.md")), EXPLANATION / "sfb.md"]
STUDIES = ROOT / "benchmarks" / "studies"
BENCHMARKS = ROOT / "benchmarks" / "results"
"""Pages of studies that are ours: tests/docs/test_benchmarks.py holds them against what the studies come to."""
COUNTED: Mapping[str, Callable[[summary.Rows, str], summary.Table]] = {
    "reached": summary.reached,
    "solved": summary.solved,
}
"""Tables that are no medians: how many runs came to the best known cost, and how many problems have a solution."""
TIMES = frozenset({"wall_s", "total_s", "cpu_s", "memory"})
"""Metrics of the machine: another one has others, so that only the form of their tables is compared."""
_STUDY = re.compile(r"^Study: \[([\w-]+)\]", re.MULTILINE)
_TABLE = re.compile(r"^\*(\w+)(?: over (\w+))?(?:: ([^*\n]+))?\*\n\n((?:\|.*\n)+)", re.MULTILINE)


class Heading(NamedTuple):
    """What a table of medians is about; `over` and `group` are empty where the study decides, or all problems count."""

    metric: str
    over: str
    group: str


def tables_in(text: str) -> dict[Heading, str]:
    """Return the tables of a part of a page."""
    return {Heading(metric, over, group): table for metric, over, group, table in _TABLE.findall(text)}


def parts(page: Path) -> Iterator[tuple[str, str]]:
    """Yield the name of each study on a page, and the text about it."""
    _, *rest = _STUDY.split(page.read_text())
    yield from zip(rest[::2], rest[1::2], strict=True)


PARTS = [one for page in PAGES for one in parts(page)]


def tables_of(name: str, headings: Sequence[Heading], results: Path | None = None) -> dict[Heading, str]:
    """Carry out a study, and return its medians as tables of a page; `results` is a folder to keep them in."""
    study = read_study(STUDIES / f"{name}.toml")
    with Store(results and results / f"{name}.sqlite") as store:
        run_study(study, store)
        rows: summary.Rows = store.results().rows
    own = report_settings(study.text).over
    return {heading: _table(rows, heading, own) for heading in headings}


def _table(rows: summary.Rows, heading: Heading, own: str | None) -> str:
    rows = [row for row in rows if heading.group in {"", row["problems"]}]
    over = summary.parameter_to_draw_over(rows, heading.over or own)
    rows = summary.by_parameter(rows, over)
    if heading.metric in COUNTED:
        return markdown_table(*COUNTED[heading.metric](rows, over))
    return markdown_table(*summary.medians(rows, heading.metric, over))


def _form(table: str) -> list[str]:
    """Return the headings of a table, and what its lines are about."""
    heads, _, *lines = table.splitlines()
    return [heads, *(line.split(" | ")[0] for line in lines)]


def test_every_study_is_on_one_page_and_can_be_planned() -> None:
    replicated, ours = [name for name, _ in PARTS], [page.stem for page in BENCHMARKS.glob("*.md")]
    assert sorted(replicated + ours) == sorted(path.stem for path in STUDIES.glob("*.toml"))
    for path in STUDIES.glob("*.toml"):
        assert plan_of(read_study(path))


@pytest.mark.slow
@pytest.mark.timeout(1200)
@pytest.mark.parametrize(("name", "text"), PARTS, ids=[name for name, _ in PARTS])
def test_the_page_says_what_the_study_comes_to(name: str, text: str) -> None:
    said = tables_in(text)
    assert said
    for heading, table in tables_of(name, list(said)).items():
        shown: Callable[[str], object] = _form if heading.metric in TIMES else str
        assert shown(table) == shown(said[heading]), heading


def write_tables(page: Path, names: Sequence[str], results: Path | None) -> None:
    """Write the tables of a page anew, those of the studies in `names`, or all."""
    text = page.read_text()
    for name, part in parts(page):
        if not names or name in names:
            found = tables_of(name, list(tables_in(part)), results)
            text = text.replace(part, _TABLE.sub(lambda one, found=found: _anew(one, found), part))  # type: ignore[misc]
    page.write_text(text)


def _anew(one: re.Match[str], found: dict[Heading, str]) -> str:
    """Return a table with its heading, as it is now."""
    heading = Heading(one[1], one[2] or "", one[3] or "")
    return one[0].removesuffix(one[4]) + found[heading]


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description="Write the tables of the replications.")
    parser.add_argument("studies", nargs="*", metavar="STUDY", help="name of a study; all, if there is none")
    parser.add_argument("--results", type=Path, metavar="FOLDER", help="keep results in this folder")
    asked = parser.parse_args()
    for one in PAGES:
        write_tables(one, asked.studies, asked.results)
