"""The report of a study, in a browser and as files."""

from __future__ import annotations

from pathlib import Path

import pytest
from lxml import etree

from tests.support.browser_pages import Browser, watched_page
from tests.support.program import robochoc_within
from tests.support.studies import COSTS, finished

pytest.importorskip("matplotlib")
pytest.importorskip("scipy")


@pytest.fixture(scope="module")
def results(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("study") / "costs.sqlite"
    finished(COSTS + '[report]\ntext = "Is <b>one</b> better?"\nmetrics = ["messages", "cost"]\n', path)
    # Fonts that matplotlib has opened once stay open.
    done = robochoc_within("experiment", "report", path, "-o", path.with_name("report.html"))
    assert done.returncode == 0, done.stderr
    return path


def test_the_page_shows_figures_tables_and_how_to_repeat_it(results: Path, browser: Browser) -> None:
    page_file = results.with_name("report.html")
    with watched_page(browser, viewport={"width": 1200, "height": 800}) as (page, complaints, asked):
        page.goto(page_file.as_uri())
        titles = [one.get_attribute("aria-label") for one in page.query_selector_all("figure svg")]
        assert titles[:3] == ["messages over agents", "cost over agents", "Solved within messages"]
        assert "Cost over NCCCs" in titles
        assert "Every run has a verdict." in page.inner_text("body")
        assert page.inner_text("h1") == "Costs"
        assert "Is <b>one</b> better?" in page.inner_text("p")
        assert "32 runs: 8 problems, 4 ways to run." in page.inner_text("body")
        assert page.query_selector_all("table tbody tr")
        assert 'record = ["cost-over-time", "robots"]' in page.inner_text("pre")
        boxes = [one.bounding_box() for one in page.query_selector_all("figure svg")]
        assert all(box and box["width"] > 300 and box["height"] > 150 for box in boxes)
        page.set_viewport_size({"width": 360, "height": 640})
        assert page.evaluate("document.documentElement.scrollWidth") <= 360
        assert not complaints
        assert asked == [page_file.as_uri()]


def test_figures_for_a_paper(results: Path, tmp_path: Path) -> None:
    folder = tmp_path / "figures"
    done = robochoc_within("experiment", "report", results, "-o", folder)
    assert done.returncode == 0, done.stderr
    names = {path.name for path in folder.iterdir()}
    assert {"messages-over-agents.svg", "messages-over-agents.pdf", "medians.tex", "cost-over-ncccs.pdf"} <= names
    assert "NCCCs, agents" not in (folder / "medians.tex").read_text(), "only the metrics of the study's [report]"
    assert "cost-over-agents: cost over agents. Median of cost" in (folder / "captions.txt").read_text()
    for path in folder.glob("*.svg"):
        assert etree.parse(path).getroot().tag.endswith("svg")
    assert all(path.read_bytes().startswith(b"%PDF") for path in folder.glob("*.pdf"))
    refused = robochoc_within("experiment", "report", results, "-o", folder)
    assert (refused.returncode, "already exists (replace figures by --force)" in refused.stderr) == (1, True)


@pytest.mark.slow
def test_figures_are_the_same_again(results: Path, tmp_path: Path) -> None:
    folder = tmp_path / "figures"
    assert robochoc_within("experiment", "report", results, "-o", folder).returncode == 0
    first = {path.name: path.read_bytes() for path in folder.iterdir()}
    assert robochoc_within("experiment", "report", results, "-o", folder, "--force").returncode == 0
    assert {path.name: path.read_bytes() for path in folder.iterdir()} == first


@pytest.mark.slow  # tests/unit/experiments/test_markdown.py has the tables of parts
@pytest.mark.usefixtures("results")  # as it says: fonts
def test_parts_have_figures_and_tables_of_their_own(tmp_path: Path) -> None:
    path = tmp_path / "costs.sqlite"
    finished(COSTS + '[report]\nover = "problem_seed"\neach = "agents"\nmetrics = ["messages"]\n', path)
    done = robochoc_within("experiment", "report", path, "-o", tmp_path / "figures")
    assert done.returncode == 0, done.stderr
    names = {file.name for file in (tmp_path / "figures").iterdir()}
    wanted = {
        f"{name}-agents-{agents}.{end}"
        for name, end in (("medians", "tex"), ("profile-messages", "svg"))
        for agents in (5, 7)
    }
    assert wanted <= names
    assert "agents 5" in (tmp_path / "figures" / "medians-agents-5.tex").read_text()
    assert robochoc_within("experiment", "report", path, "-o", tmp_path / "page.html").returncode == 0
    page = (tmp_path / "page.html").read_text()
    assert all(f"<h3>messages: agents {agents}</h3>" in page for agents in (5, 7))
