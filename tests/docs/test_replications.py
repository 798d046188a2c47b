"""The page of replications says what its studies come to; `python -m tests.docs.test_replications` writes it."""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path

import pytest

from robochoc.experiments import summary
from robochoc.experiments.markdown import markdown_table
from robochoc.experiments.plan import plan_of
from robochoc.experiments.runner import run_study
from robochoc.experiments.store import Store
from robochoc.experiments.study import read_study, study_wishes
from tests.support.program import ROOT

PAGE = ROOT / "docs" / "explanation" / "replications.md"
STUDIES = ROOT / "benchmarks" / "studies"
BENCHMARKS = ROOT / "benchmarks" / "results"
"""Pages of studies that are ours: tests/docs/test_benchmarks.py holds them against what the studies come to."""
_STUDY = re.compile(r"^Study: \[([\w-]+)\]", re.MULTILINE)
_TABLE = re.compile(r"^\*(\w+)\*\n\n((?:\|.*\n)+)", re.MULTILINE)


def parts() -> list[tuple[str, str]]:
    """Return the name of each study on the page, and the text about it."""
    _, *rest = _STUDY.split(PAGE.read_text())
    return list(zip(rest[::2], rest[1::2], strict=True))


def tables_of(name: str, metrics: Sequence[str]) -> dict[str, str]:
    """Carry out a study, and return its medians as tables of the page."""
    study = read_study(STUDIES / f"{name}.toml")
    with Store(None) as store:
        run_study(study, store)
        rows: summary.Rows = store.results().rows
    over = summary.parameter_to_draw_over(rows, study_wishes(study.text).over)
    rows = summary.by_parameter(rows, over)
    return {metric: markdown_table(*summary.medians(rows, metric, over)) for metric in metrics}


def test_every_study_is_on_this_page_or_has_one_and_can_be_planned() -> None:
    replicated, ours = {name for name, _ in parts()}, {page.stem for page in BENCHMARKS.glob("*.md")}
    assert replicated | ours == {path.stem for path in STUDIES.glob("*.toml")}
    assert not replicated & ours
    for path in STUDIES.glob("*.toml"):
        assert plan_of(read_study(path))


@pytest.mark.slow
@pytest.mark.parametrize(("name", "text"), parts(), ids=[name for name, _ in parts()])
def test_the_page_says_what_the_study_comes_to(name: str, text: str) -> None:
    said = dict(_TABLE.findall(text))
    assert said
    assert tables_of(name, list(said)) == said


def write_tables(page: Path) -> None:
    """Write the tables of the page anew."""
    text = page.read_text()
    for name, part in parts():
        found = tables_of(name, [metric for metric, _ in _TABLE.findall(part)])
        told = _TABLE.sub(lambda one, found=found: f"*{one[1]}*\n\n{found[one[1]]}", part)  # type: ignore[misc]
        text = text.replace(part, told)
    page.write_text(text)


if __name__ == "__main__":
    write_tables(PAGE)
