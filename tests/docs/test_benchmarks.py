"""The pages of our own studies say what the studies come to; `python benchmarks/run.py NAME` writes one."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from robochoc.experiments.markdown import markdown_page
from robochoc.experiments.runner import run_study
from robochoc.experiments.store import Store
from robochoc.experiments.study import read_study
from tests.support.program import ROOT

STUDIES = ROOT / "benchmarks" / "studies"
PAGES = sorted((ROOT / "benchmarks" / "results").glob("*.md"))


def without_version(page: str) -> str:
    return re.sub(r" robochoc [^ ]+\. All runs", " All runs", page)


def test_the_results_lead_to_every_page() -> None:
    results = (ROOT / "benchmarks" / "RESULTS.md").read_text()
    assert PAGES
    assert set(re.findall(r"\]\(results/([\w-]+\.md)\)", results)) == {page.name for page in PAGES}


def test_a_page_quotes_its_study() -> None:
    for page in PAGES:
        study = read_study(STUDIES / f"{page.stem}.toml")
        text = page.read_text()
        assert text.startswith(f"# {study.title}\n\n{study.report.text.strip()}\n\n")


@pytest.mark.slow
@pytest.mark.timeout(1200)
@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
def test_a_page_says_what_its_study_comes_to(page: Path) -> None:
    pytest.importorskip("scipy")
    with Store(None) as store:
        run_study(read_study(STUDIES / f"{page.stem}.toml"), store)
        found = markdown_page(store.results(), page.name)
    assert without_version(found) == without_version(page.read_text())
