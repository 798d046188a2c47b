"""The sniffer's page: whole, closed to everything from elsewhere, and part of the wheel; and the scene beside it."""

from __future__ import annotations

import base64
import hashlib
import re
import zipfile
import zlib
from pathlib import Path

import msgspec
import pytest
import umsgpack
from hatchling.builders.wheel import WheelBuilder

from robochoc.journal.events import AnyEvent, Began, Decided, Settled
from robochoc.journal.journal import Journal, read_journal
from robochoc.model.expression import Name
from robochoc.model.outcome import Outcome, Verdict
from robochoc.model.problem import Domain, Robot, Topic, Variable
from robochoc.sniffer.page import sniffer_page
from robochoc.sniffer.scene import TraceScene, complete_scene
from robochoc.sniffer.trace import Trace
from tests.support.program import ROOT
from tests.support.sniffer_server import header, journal_of, run_events

HOSTILE = "</script></title><img src=x onerror=alert(1)>"


def policy_of(html: str) -> dict[str, str]:
    (policy,) = re.findall(r'<meta http-equiv="Content-Security-Policy" content="([^"]*)">', html)
    return dict(part.strip().split(" ", 1) for part in policy.split(";"))


def scripts_of(html: str) -> list[str]:
    return re.findall(r"<script>(.*?)</script>", html, re.DOTALL)


@pytest.mark.parametrize("mode", ["served", "embedded"])
def test_only_its_own_scripts_run_and_nothing_is_loaded(mode: str) -> None:
    answers = {"about": zlib.compress(b"{}"), "scene": zlib.compress(b"null")}
    html = sniffer_page("served" if mode == "served" else "embedded", None if mode == "served" else answers).decode()
    policy = policy_of(html)
    hashes = [
        f"'sha256-{base64.b64encode(hashlib.sha256(one.encode()).digest()).decode()}'" for one in scripts_of(html)
    ]
    assert policy["script-src"].split() == hashes
    assert policy["default-src"] == policy["base-uri"] == policy["form-action"] == "'none'"
    assert policy["connect-src"] == ("'self'" if mode == "served" else "'none'")
    document = re.sub(r"<script.*?</script>|<style>.*?</style>", "", html, flags=re.DOTALL)
    assert not re.search(r"""(src|href)=["'](?!#|data:)""", document)
    assert not re.search(r"\son\w+=", document)


def test_the_policy_stands_before_any_script() -> None:
    html = sniffer_page("served").decode()
    assert 0 < html.index("Content-Security-Policy") < html.index("<script")


def test_the_model_comes_first_and_whatever_begins_last() -> None:
    scripts = scripts_of(sniffer_page("embedded", {}).decode())
    assert "window.Sniffer = {}" in scripts[0]
    names = [path.name for path in (ROOT / "robochoc/sniffer/assets").glob("*.js")]
    assert len(scripts) == len(names)
    assert scripts[-1] == (ROOT / "robochoc/sniffer/assets/main.js").read_text()


def test_titles_and_answers_of_strangers_stay_text() -> None:
    html = sniffer_page("embedded", {"about": zlib.compress(HOSTILE.encode())}, title=HOSTILE).decode()
    assert HOSTILE not in html
    assert html.count("<title>") == 1
    (packed,) = re.findall(r'<script id="feed:about" type="application/octet-stream">([^<]*)</script>', html)
    assert zlib.decompress(base64.b64decode(packed)).decode() == HOSTILE


def test_the_same_answers_make_the_same_page() -> None:
    answers = {"about": b"1", "columns": b"2"}
    assert sniffer_page("embedded", answers) == sniffer_page("embedded", dict(answers))


def test_assets_are_in_the_wheel(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("ROBOCHOC_COMPILE", "0")
    (wheel,) = WheelBuilder(str(ROOT)).build(directory=str(tmp_path), versions=["standard"])
    with zipfile.ZipFile(wheel) as packed:
        names = {name.rpartition("/")[2] for name in packed.namelist() if "robochoc/sniffer/assets/" in name}
    assert names == {path.name for path in (ROOT / "robochoc/sniffer/assets").iterdir()}
    assert {"index.html", "style.css", "main.js", "scene.js", "counters.js"} <= names


# The scene


def trace_of(events: list[AnyEvent], outcome: Outcome | None = None) -> Trace:
    return Trace.of(read_journal(journal_of(events, outcome, header(team="a team"))))


def deciding(robot: str, *assignments: dict[str, int]) -> list[AnyEvent]:
    """A robot that decides, step after step."""
    events: list[AnyEvent] = []
    for clock, assignment in enumerate(assignments):
        events.append(Decided(t=clock, robot=robot, assignment=assignment, clock=clock))
        events.append(Settled(t=clock, robot=robot, clock=clock, checks=0))
    return events


def test_drones_stand_hover_and_land() -> None:
    trace = trace_of([Began(t=0, protocol="ABT"), *deciding("Robot2.3", {"V2.3": 4}, {"V2.3": 1}, {})])
    scene = TraceScene(trace, {}).answer()
    (drone,) = scene["drones"]
    x, y, ground = drone["ground"]
    assert scene["moves"] == [(0, 0, x, y, ground + 4), (1, 0, x, y, ground + 1), (2, 0, x, y, ground)]


def test_a_topic_says_where_a_drone_is() -> None:
    domain = Domain("D", (range(1, 5),))
    robot = Robot("Scout", (Variable("p", domain),), topics=(Topic("/p", x=Name("p"), y=Name("p"), z=Name("p")),))
    trace = trace_of([Began(t=0, protocol="ABT"), *deciding("Scout", {"p": 2}, {"p": 4})])
    stage = TraceScene(trace, {"Scout": robot})
    first, second = stage.answer()["moves"]
    assert [b - a for a, b in zip(first[2:], second[2:], strict=True)] == [2, 2, 2]


def test_all_land_when_another_run_begins() -> None:
    runs = [*deciding("R1.1", {"V1.1": 2}), Began(t=0, protocol="SFB"), *deciding("R1.1", {"V1.1": 3})]
    scene = TraceScene(trace_of([Began(t=0, protocol="ABT"), *runs]), {}).answer()
    heights = [(move[0], move[4] - scene["drones"][0]["ground"][2]) for move in scene["moves"]]
    assert [step for step, _ in heights] == [0, 1, 1]
    assert heights[1][1] == 0 < heights[0][1] < heights[2][1]


def test_meshcats_commands_hold_every_drone_and_no_animation() -> None:
    events, outcome = run_events()
    scene = msgspec.json.decode(complete_scene(trace_of(events, outcome)))
    commands = [umsgpack.unpackb(base64.b64decode(command)) for command in scene["commands"]]
    assert {command["type"] for command in commands} == {"set_transform", "set_property", "set_object"}
    paths = {command["path"] for command in commands}
    assert {f"/meshcat/{drone['path']}" for drone in scene["drones"]} <= paths


def test_nobody_to_be_seen_is_no_scene() -> None:
    assert (
        complete_scene(
            Trace.of(
                Journal(header(), (), Outcome(Verdict.UNKNOWN, team="t", protocol="abt", runtime="simulator", seed=0))
            )
        )
        == b"null"
    )
