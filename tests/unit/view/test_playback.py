"""What was flown, as a picture: key frames, epochs, what happened, and flights that there are none of."""

from __future__ import annotations

import json
import re
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import given
from hypothesis import strategies as st

from robochoc.flight import preview as previews
from robochoc.flight.flight import fly
from robochoc.flight.log import FlightEvent
from robochoc.flight.mission import mission_of
from robochoc.flight.quadrotor.conditions import FlightConditions, MotorFailure
from robochoc.formats import write_team
from robochoc.formats.result import result_json
from robochoc.model.outcome import EpochOutcome, Outcome, Verdict
from robochoc.view.keyframes import angle, attitude_keys, position_keys, slerp
from robochoc.view.page import scene_page
from robochoc.view.palette import GREY, RED, css_colour
from robochoc.view.playback import DroneState
from robochoc.view.scene import Scene, scene_of
from tests.support.cases import looped
from tests.support.examples import examples
from tests.support.flights import FPS, LEG_S, TILT, commands_of, epochs_of_three, five, straight
from tests.support.flights import scene_of as flown_scene_of
from tests.support.outcomes import outcome_of
from tests.support.program import robochoc_within

HOSTILE = "</script><img src=x onerror=alert(1)>"
Array = npt.NDArray[np.float64]


def playback_in(html: bytes) -> dict[str, Any]:
    block = re.search(rb'<script id="playback"[^>]*>([^<]*)</script>', html)
    assert block
    playback: dict[str, Any] = json.loads(block[1])
    return playback


def tracks_of(html: bytes) -> dict[str, list[tuple[float, list[float]]]]:
    """Key frames, by path and property."""
    (animation,) = (command for command in commands_of(html) if command["type"] == "set_animation")
    return {
        clip["path"].removeprefix("/meshcat/drones/") + track["name"]: [
            (key["time"], key["value"]) for key in track["keys"]
        ]
        for clip in animation["animations"]
        for track in clip["clip"]["tracks"]
    }


def shown(outcome: Outcome | None = None, **how: Any) -> Scene:  # noqa: ANN401 - `straight`'s
    mission = mission_of(outcome) if outcome else mission_of(epochs_of_three(), five())
    outcome = outcome or epochs_of_three()
    return scene_of(outcome, mission, straight(mission, **how))


# Key frames


def walks(width: int) -> st.SearchStrategy[Array]:
    steps = st.lists(st.tuples(*[st.floats(-1, 1)] * width), min_size=1, max_size=60)
    return steps.map(lambda taken: np.cumsum(np.array(taken), axis=0))


@examples(50)
@given(walks(3), st.floats(0.001, 1))
def test_positions_between_keys_are_nearly_those_that_were_flown(walk: Array, tolerance: float) -> None:
    times = np.arange(len(walk)) / FPS
    keys = position_keys(times, walk, tolerance)
    between = np.stack([np.interp(times, times[keys], walk[keys, axis]) for axis in range(3)], axis=1)
    assert np.linalg.norm(between - walk, axis=1).max() <= tolerance + 1e-9
    assert (keys[0], keys[-1]) == (0, len(walk) - 1)


@examples(50)
@given(walks(4), st.floats(0.001, 1))
def test_attitudes_between_keys_are_nearly_those_that_were_flown(walk: Array, tolerance: float) -> None:
    turned = walk + np.array([0, 0, 0, 0.1])
    turned = turned[np.linalg.norm(turned, axis=1) > 0.01]
    turned = np.array([[0, 0, 0, 1], *turned / np.linalg.norm(turned, axis=1, keepdims=True)])
    times = np.arange(len(turned)) / FPS
    keys = attitude_keys(times, turned, tolerance)
    for first, last in pairwise(keys):
        between = (times[first : last + 1] - times[first]) / (times[last] - times[first])
        played = slerp(turned[first], turned[last], between)
        assert angle(played, turned[first : last + 1]).max() <= tolerance + 1e-6


def test_what_goes_straight_needs_two_keys() -> None:
    times = np.arange(100) / FPS
    assert [*position_keys(times, np.outer(times, [1, 2, 3]), 0.002)] == [0, 99]
    lean = times[:, None] / 4
    turn = np.hstack([np.sin(lean), 0 * lean, 0 * lean, np.cos(lean)])
    assert [*attitude_keys(times, turn, 0.001)] == [0, 99]
    assert [*position_keys(times[:1], np.zeros((1, 3)), 0.1)] == [0]


def test_the_angle_between_attitudes() -> None:
    turn = np.array([[np.sin(0.05), 0, 0, np.cos(0.05)]])
    assert angle(turn, np.array([0, 0, 0, 1.0])) == pytest.approx(0.1)
    assert angle(-turn, turn) == pytest.approx(0)


def test_the_page_plays_what_was_flown() -> None:
    scene = shown()
    playback = scene.playback
    assert playback
    tracks = tracks_of(scene_page(scene))
    frames = FPS * playback.times
    for number, drone in enumerate(scene.drones):
        path = f"{number + 1} {drone.name}"
        keys, values = zip(*tracks[f"{path}.position"], strict=True)
        played = np.stack([np.interp(frames, keys, part) for part in np.array(values).T], axis=1)
        assert np.abs(played - playback.positions[:, number]).max() < 0.0021
        leans = 2 * np.arcsin([value[0] for _, value in tracks[f"{path}/body.quaternion"]])
        assert max(leans) == pytest.approx(TILT, abs=0.001)


def test_metres_are_shown_in_cells() -> None:
    outcome = outcome_of({"V1.1": 1, "V1.2": 10**9, "V2.1": 5 * 10**8}, team="vast")
    mission = mission_of(outcome)
    scene = scene_of(outcome, mission, straight(mission))
    assert scene.playback
    assert mission.scale < 1e-6
    for drone, begin, end in zip(scene.drones, scene.playback.positions[0], scene.playback.positions[-1], strict=True):
        assert begin == pytest.approx(drone.home)
        assert end == pytest.approx(drone.end)
    assert [drone.place and drone.place[2] for drone in scene.drones] == pytest.approx([1, 4, 2.5], abs=0.1)


def test_vast_numbers_are_flown_as_they_are_drawn() -> None:
    outcome = outcome_of({"V1.1": -1000, "V1.2": 10**12}, team="vast")
    scene = flown_scene_of(outcome)
    assert scene.playback
    for drone, end in zip(scene.drones, scene.playback.positions[-1], strict=True):
        assert end == pytest.approx(drone.end, abs=0.1)
    assert (scene.axes[2].first, scene.axes[2].last) == (-1000, 10**12)


# Epochs


def test_each_epoch_says_what_opened_it_and_what_came_of_it() -> None:
    playback = playback_in(scene_page(shown()))
    assert playback["chapters"] == [
        {"at": 0, "opened": "the start", "says": "solution, 4 fly"},
        {"at": LEG_S, "opened": "-R5.1", "says": "no solution, 3 hover on"},
        {"at": 2 * LEG_S, "opened": "V2.1 without <2>", "says": "solution, 4 fly"},
    ]
    assert playback["duration"] == 3 * LEG_S


def test_nobody_flies_where_there_never_was_a_solution() -> None:
    outcome = outcome_of({}, Verdict.NO_SOLUTION)
    assert playback_in(scene_page(shown(outcome)))["chapters"] == [
        {"at": 0, "opened": "the start", "says": "no solution, no drone flies"}
    ]
    alone = flown_scene_of(outcome, five())
    assert alone.playback is None
    assert not {"flown", "flight"} & dict(alone.facts).keys()


def test_who_leaves_turns_grey_when_it_leaves() -> None:
    scene = shown()
    assert scene.playback
    assert [len(states) for states in scene.playback.states] == [0, 0, 0, 0, 1]
    assert [*scene.playback.states[4]] == [(LEG_S, DroneState.WITHDRAWN)]
    gone = scene.drones[4]
    assert gone.landing
    assert gone.place is None
    html = scene_page(scene)
    colours = tracks_of(html)["5 R5.1/body/<object>.material.color"]
    assert [frame for frame, _ in colours] == [0, FPS * LEG_S, FPS * LEG_S + 25]
    assert colours[-1][1] == pytest.approx(GREY)
    assert playback_in(html)["drones"][4]["states"] == [[LEG_S, "withdrawn", css_colour(GREY)]]


def test_who_comes_back_has_its_colour_again() -> None:
    outcome = epochs_of_three()
    first, second, third = outcome.epochs
    third = replace(third, robots=first.robots, assignment={**third.assignment, "V5.1": 2})
    outcome = replace(outcome, epochs=(first, second, third), assignment=third.assignment)
    mission = mission_of(outcome, five())
    scene = scene_of(outcome, mission, straight(mission))
    assert scene.playback
    assert [*scene.playback.states[4]] == [(LEG_S, DroneState.WITHDRAWN), (2 * LEG_S, DroneState.FLIES)]
    colours = tracks_of(scene_page(scene))["5 R5.1/body/<object>.material.color"]
    assert colours[-1][1] == pytest.approx(colours[0][1])


def test_the_flight_of_a_scenario_is_flown_here_if_need_be() -> None:
    scene = flown_scene_of(epochs_of_three(), five())
    assert scene.playback
    assert len(scene.playback.chapters) == 3
    assert scene.playback.duration_s > 3
    assert "flown" in dict(scene.facts)


# What happened


def test_who_falls_turns_red_and_stays_where_it_lies() -> None:
    scene = shown(falls={1: 3.0})
    assert scene.playback
    assert scene.playback.states[1] == ((3.0, DroneState.FALLEN),)
    html = scene_page(scene)
    assert playback_in(html)["marks"] == [{"at": 3.0, "drone": 1, "says": "motor 2 stopped"}]
    tracks = tracks_of(html)
    assert tracks["2 R2.1/body/<object>.material.color"][-1][1] == pytest.approx(RED, abs=1e-6)
    assert tracks["2 R2.1.position"][-1][1][2] == pytest.approx(scene.ground)
    assert ("fallen", "R2.1 (motor 2 stopped)") in scene.facts


def test_what_the_flight_tells_of_one_that_falls_is_understood() -> None:
    outcome = epochs_of_three()
    mission = mission_of(outcome, five())
    failure = MotorFailure(mission.drones[1].name, 3.0, 1)
    scene = scene_of(outcome, mission, fly(mission, FlightConditions(failures=(failure,))))
    assert scene.playback
    ((at_s, state),) = scene.playback.states[1]
    assert at_s == pytest.approx(3.0, abs=0.05)
    assert state is DroneState.FALLEN
    assert "motor" in dict(scene.facts)["fallen"]


def test_who_has_fallen_does_not_turn_grey_later() -> None:
    scene = shown(falls={4: 1.0})
    assert scene.playback
    assert scene.playback.states[4] == ((1.0, DroneState.FALLEN),)


def test_obstacles_are_boxes_in_their_cells() -> None:
    scene = shown(obstacles=((2.0, 3.0, 4.0), (1.0, 1.0, 1.0)))
    drawn = {command["path"]: command for command in commands_of(scene_page(scene)) if command["type"] == "set_object"}
    (body,) = (drawn[path] for path in drawn if path.endswith("obstacles/1/body"))
    corners = np.frombuffer(body["object"]["geometries"][0]["data"]["attributes"]["position"]["array"].data, "<f4")
    assert corners.reshape(-1, 3).mean(axis=0) == pytest.approx([2, 3, 4])
    assert body["object"]["materials"][0]["opacity"] < 0.5
    assert any(path.endswith("obstacles/2/edges") for path in drawn)


def test_obstacles_appear_when_they_are_seen() -> None:
    mission = mission_of(epochs_of_three(), five())
    flight = straight(mission, obstacles=((2.0, 3.0, 4.0), (1.0, 1.0, 1.0)))
    html = scene_page(scene_of(epochs_of_three(), mission, replace(flight, seen_s=(0.0, 1.5))))
    (animation,) = (command for command in commands_of(html) if command["type"] == "set_animation")
    appearing = {
        clip["path"]: track["keys"]
        for clip in animation["animations"]
        for track in clip["clip"]["tracks"]
        if track["name"] == ".material.opacity"
    }
    assert [path.rpartition("obstacles/")[2] for path in appearing] == ["2/body/<object>", "2/edges/<object>"]
    for keys in appearing.values():
        assert [(key["time"], key["value"]) for key in keys[:2]] == [(0, [0]), (1.5 * FPS, [0])]
        assert keys[2]["value"][0] > 0.3


def test_what_happened_is_told_in_its_order() -> None:
    outcome = epochs_of_three()
    mission = mission_of(outcome)
    seen = (FlightEvent(4.0, 0, "second"), FlightEvent(1.0, 2, "first"))
    scene = scene_of(outcome, mission, replace(straight(mission), events=seen))
    assert [mark["says"] for mark in playback_in(scene_page(scene))["marks"]] == ["first", "second"]


def test_the_caption_tells_of_the_flight() -> None:
    facts = dict(shown().facts)
    assert facts["flown"] == "6.0 s"
    assert facts["separation"] == "0.98 m (set: 0.5 m)"
    assert "fallen" not in facts


# No flight


@looped("error", [MemoryError("no room"), FloatingPointError(), ValueError("nonsense")])
def test_drones_that_cannot_fly_are_where_they_would_be(error: Exception, monkeypatch: pytest.MonkeyPatch) -> None:
    def fails(*_: object, **__: object) -> None:
        raise error

    monkeypatch.setattr(previews, "fly", fails)
    scene = flown_scene_of(epochs_of_three(), five())
    assert scene.playback is None
    assert ("flight", f"none: {str(error) or 'FloatingPointError'}") in scene.facts
    commands = commands_of(scene_page(scene))
    assert not any(command["type"] == "set_animation" for command in commands)
    placed = {
        command["path"]: np.frombuffer(command["matrix"].data, "<f4").reshape(4, 4)[3, :3]
        if hasattr(command["matrix"], "data")
        else np.array(command["matrix"]).reshape(4, 4)[3, :3]
        for command in commands
        if command["type"] == "set_transform"
    }
    for number, drone in enumerate(scene.drones, 1):
        assert placed[f"/meshcat/drones/{number} {drone.name}"] == pytest.approx(drone.end)


def test_too_many_are_not_flown(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(previews, "_FLIGHTS_MAX", 14)
    scene = flown_scene_of(epochs_of_three(), five())
    assert scene.playback is None
    assert dict(scene.facts)["flight"].startswith("none: 5 drones in 3 epochs are too many")


def test_a_flight_whose_legs_are_others_still_plays() -> None:
    outcome = epochs_of_three()
    mission = mission_of(outcome)
    flown = straight(mission)
    html = scene_page(scene_of(outcome, mission, replace(flown, legs=flown.legs[:1])))
    assert len(playback_in(html)["chapters"]) == 1


# The page


def test_hostile_names_and_words_stay_text() -> None:
    outcome = Outcome(
        Verdict.SOLUTION,
        team=HOSTILE,
        protocol=HOSTILE,
        runtime="processes",
        seed=0,
        assignment={HOSTILE: 1, "__proto__": 2, "\ud800": 3},
    )
    mission = mission_of(outcome)
    seen = (FlightEvent(1.0, 0, HOSTILE),)
    html = scene_page(scene_of(outcome, mission, replace(straight(mission), events=seen)))
    assert b"<img" not in html
    assert html.count(b"</script>") == 4
    playback = playback_in(html)
    assert playback["marks"][0]["says"] == HOSTILE
    assert {"__proto__", HOSTILE} < {drone["name"] for drone in playback["drones"]}


def test_equal_flights_make_equal_pages() -> None:
    assert scene_page(shown(falls={1: 3.0})) == scene_page(shown(falls={1: 3.0}))


@pytest.mark.parametrize(("n", "most"), [(4, 1_200_000), (9, 2_000_000)])
def test_pages_of_large_teams_are_small(n: int, most: int) -> None:
    places = {f"V{i}.{j}": (3 * i + 5 * j) % n + 1 for i in range(1, n + 1) for j in range(1, n + 1)}
    scene = flown_scene_of(outcome_of(places))
    html = scene_page(scene)
    assert len(html) < most
    assert len(tracks_of(html)) >= n * n


# Saved runs


@pytest.mark.usefixtures("in_a_folder")
def test_animate_shows_all_epochs_whoever_opened_them(tmp_path: Path) -> None:
    outcome = epochs_of_three()
    first, second, third = outcome.epochs
    outcome = replace(outcome, epochs=(first, second, replace(third, opened_by="obstacle at (2, 1, 5)")))
    write_team(five(), tmp_path / "watch")
    (tmp_path / "result.json").write_bytes(result_json(outcome))
    told = robochoc_within("animate", "result.json", "--team", "watch", "-o", "page.html")
    assert (told.returncode, told.stderr.count("\n")) == (0, 1)
    chapters = playback_in((tmp_path / "page.html").read_bytes())["chapters"]
    assert [chapter["opened"] for chapter in chapters] == ["the start", "-R5.1", "obstacle at (2, 1, 5)"]


@pytest.mark.usefixtures("in_a_folder")
def test_animate_refuses_a_team_whose_robots_are_others(tmp_path: Path) -> None:
    outcome = epochs_of_three()
    strangers = replace(outcome.epochs[0], robots=("Nobody",), assignment={})
    write_team(five(), tmp_path / "watch")
    (tmp_path / "result.json").write_bytes(result_json(replace(outcome, epochs=(strangers, *outcome.epochs[1:]))))
    told = robochoc_within("animate", "result.json", "--team", "watch", "-o", "page.html")
    assert told.returncode == 1
    assert "is not watch, the team of result.json" in told.stderr
    assert not (tmp_path / "page.html").exists()


# Flights for a picture


@looped(
    ("values", "scale"),
    [({"V1.1": 1, "V1.2": 10**12}, None), ({"V1.1": 1, "V1.2": 2}, 1e9), ({"V1.1": 10**7, "V1.2": 10**7 + 1}, None)],
)
def test_what_is_flown_in_cells_is_said_not_to_be_to_scale(values: dict[str, int], scale: float | None) -> None:
    outcome = outcome_of(values, team="vast")
    scene = flown_scene_of(outcome, mission=mission_of(outcome, None, scale))
    facts = dict(scene.facts)
    assert scene.playback
    assert scene.playback.duration_s < 10
    assert facts["flown"].endswith(" s, not to scale")
    assert "separation" not in facts


def test_more_epochs_than_are_flown_for_a_picture() -> None:
    many = tuple(
        EpochOutcome(Verdict.SOLUTION, robots=(), assignment={"V1.1": number % 3 + 1}) for number in range(100)
    )
    scene = flown_scene_of(outcome_of({"V1.1": 1}, team="many", protocol="dynabt", epochs=many))
    assert scene.playback is None
    assert dict(scene.facts)["flight"].startswith("none: 1 drone in 100 epochs")
