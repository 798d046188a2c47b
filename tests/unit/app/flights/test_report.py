"""The report of a run: what it tells, and that nothing in names is more than text."""

from __future__ import annotations

from html.parser import HTMLParser
from pathlib import Path

import msgspec

from robochoc.app.flights.report import Pages, report, summary
from robochoc.app.runs.options import RESULT, RunOptions
from robochoc.app.sketch import edits
from robochoc.app.sketch.sketch import Cell, Decision, DecisionKind, Sketch, SketchRobot, SketchRule
from tests.support.cases import looped
from tests.support.kept_runs import cube, kept_run

HOSTILE = "</script><img src=x onerror=\"alert('$1')\">"
PAGE = b"""<meta http-equiv="Content-Security-Policy"
content="default-src 'none'; script-src 'sha256-abc'; img-src data:">
<script>"a" && '<b>'</script>"""


class _Read(HTMLParser):
    """What a browser would make of a page."""

    def __init__(self, page: bytes) -> None:
        super().__init__()
        self.tags: list[str] = []
        self.attributes: list[tuple[str, str | None]] = []
        self.text: list[str] = []
        self.feed(page.decode())

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append(tag)
        self.attributes += attrs

    def handle_data(self, data: str) -> None:
        self.text.append(data)

    @property
    def words(self) -> str:
        """All its text."""
        return " ".join(" ".join(self.text).split())


def test_it_tells_who_decided_what_by_which_rules_and_how_to_repeat_it(tmp_path: Path) -> None:
    run = kept_run(tmp_path, cube())
    read = _Read(report(run.sketch, run, Pages(), "1.2.3"))
    for told in (
        "All 3 decide together, and it is proven that no answer costs less. It costs 6.",
        "Drone1 1 Drone2 2 Drone3 3",
        "In level, all robots choose different values. It must hold.",
        "Breaking it costs 3 each time. Broken by Drone2 and Drone3: costs 6.",
        "A map of 8 columns and 4 rows; 0 cells are blocked.",
        "Protocol syncbb",
        "Messages 12",
        "CPA 12",
        "robochoc solve Cube --seed 7",
        "Seed 7",
        "robochoc 1.2.3",
        "2023-11-14 22:13 UTC",
    ):
        assert told in read.words
    assert "iframe" not in read.tags
    assert "script" not in read.tags


def test_that_names_of_two_words_are_told(tmp_path: Path) -> None:
    sketch = Sketch("Home", robots=(SketchRobot("Ada", Cell(0, 0)), SketchRobot("Ben", Cell(1, 0))))
    sketch = edits.with_decision(sketch, Decision("task", DecisionKind.TASK, ("wash up", "dry")))
    sketch = edits.with_rule(sketch, SketchRule("", "prefers", "task", settings={"value": "dry"}, cost=3))
    run = kept_run(tmp_path, sketch, assignment={"Ada.task": "wash_up", "Ben.task": "dry"})
    run.record.labels, run.result = {"wash_up": "wash up"}, None
    run.read_result()
    read = _Read(report(sketch, run, Pages(), "1"))
    assert "Ada wash up Ben dry" in read.words
    assert "Broken by Ada: costs 3." in read.words


def test_that_names_are_text(tmp_path: Path) -> None:
    sketch = cube()
    robots = tuple(SketchRobot(f"{HOSTILE}{number}", robot.at) for number, robot in enumerate(sketch.robots))
    sketch = msgspec.structs.replace(sketch, name=HOSTILE, story=HOSTILE, robots=robots)
    run = kept_run(tmp_path, sketch, protocol=HOSTILE, withdrawn=[HOSTILE], chosen={"protocol": HOSTILE})
    run.record.arguments = ["solve", HOSTILE]
    read = _Read(report(sketch, run, Pages(), "1"))
    assert not {"img", "script", "iframe"} & {*read.tags}
    assert not [name for name, _ in read.attributes if name.startswith("on")]
    assert read.words.count("onerror") >= 8


def test_that_pages_stand_in_frames_that_can_do_nothing_else(tmp_path: Path) -> None:
    run = kept_run(tmp_path, cube())
    read = _Read(report(run.sketch, run, Pages(PAGE, PAGE), "1"))
    assert read.tags.count("iframe") == 2
    assert "script" not in read.tags
    given = [value for name, value in read.attributes if name == "srcdoc"]
    assert given == [PAGE.decode()] * 2
    assert [value for name, value in read.attributes if name == "sandbox"] == ["allow-scripts allow-downloads"] * 2
    policies = [value for name, value in read.attributes if name == "content" and value and "default-src" in value]
    assert policies[0]
    assert "script-src 'sha256-abc' 'sha256-abc';" in policies[0]
    assert "'unsafe-inline'" not in policies[0].split("script-src")[1].split(";")[0]


def test_without_an_answer_it_says_so(tmp_path: Path) -> None:
    sketch = cube()
    run = kept_run(tmp_path, sketch, verdict="no-solution", assignment={}, cost=None)
    assert summary(sketch, run) == "It is proven that no answer keeps all rules."
    run.result = None
    assert summary(sketch, run) == "There is no answer."
    assert b"Decisions of the robots" not in report(sketch, run, Pages(), "1")


def test_that_what_is_as_large_as_can_be_is_a_worth(tmp_path: Path) -> None:
    run = kept_run(tmp_path, cube())
    run.record.maximised = True
    assert summary(cube(), run) == (
        "All 3 decide together, and it is proven that no answer is worth more. It is worth 6."
    )


@looped("robots", [5, None, "all", [{}]])
def test_that_an_epoch_of_a_stranger_may_say_anything_of_its_robots(tmp_path: Path, robots: object) -> None:
    sketch = Sketch("Files", robots=(SketchRobot("Ada", Cell(0, 0)),))
    run = kept_run(tmp_path, sketch, epochs=[{"robots": robots}])
    assert summary(sketch, run)


def test_that_the_command_of_a_stranger_is_not_told(tmp_path: Path) -> None:
    run = kept_run(tmp_path, cube())
    run.record.opened, run.record.arguments = True, ["x; rm -rf ~"]
    told = _Read(report(run.sketch, run, Pages(), "1"))
    assert "robochoc solve Cube --json" in told.words
    assert "rm -rf" not in told.words
    run.record.options = RunOptions(more=("--html", "/home/me/.profile"))
    assert "solve" not in _Read(report(run.sketch, run, Pages(), "1")).words


@looped("started", [1e300, -1e300, float("inf"), float("nan")])
def test_a_strangers_numbers_are_no_error(tmp_path: Path, started: float) -> None:
    run = kept_run(tmp_path, cube())
    run.record.started = started
    result = run.folder / RESULT
    result.write_bytes(result.read_bytes().replace(b'"CPA":12', b'"CPA":1e400'))
    assert b"</html>" in report(cube(), run, Pages(), "1.0")
