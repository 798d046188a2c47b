"""Where drones are placed, what the page holds, and what the live viewer leaves behind."""

from __future__ import annotations

import base64
import math
import re
import subprocess
import sys
from collections.abc import Mapping
from dataclasses import replace
from itertools import combinations

import pytest

from robochoc.flight import preview as previews
from robochoc.flight.layout import Point
from robochoc.model.expression import Apply, Constant, Expression, Name
from robochoc.model.outcome import Metrics, Outcome, Verdict
from robochoc.model.problem import Domain, Robot, Team, Topic, Variable
from robochoc.view.page import scene_page
from robochoc.view.scene import DrawnDrone, Scene
from tests.support.cases import looped
from tests.support.flights import commands_of, scene_of, straight
from tests.support.outcomes import outcome_of

HOSTILE = "</script><img src=x onerror=alert(1)>/../__proto__"


@pytest.fixture(autouse=True)
def flown_straight(monkeypatch: pytest.MonkeyPatch) -> None:
    """Where drones are placed, no simulation has to tell."""
    monkeypatch.setattr(previews, "fly", lambda mission, progress: straight(mission))  # noqa: ARG005


def outcome(assignment: Mapping[str, int], verdict: Verdict = Verdict.SOLUTION, *withdrawn: str) -> Outcome:
    metrics = Metrics(messages={"Ok": 1200, "Nogood": 34})
    return outcome_of(dict(assignment), verdict, team="a team", withdrawn=withdrawn, metrics=metrics)


def robot(name: str, *variables: str, topics: tuple[Topic, ...] = ()) -> Robot:
    domain = Domain("D", (range(1, 5),))
    return Robot(name, tuple(Variable(variable, domain) for variable in variables), topics=topics)


def topic(x: Expression, y: Expression, z: Expression | None = None, name: str = "/waypoint") -> Topic:
    return Topic(name, x=x, y=y, z=z)


def queens(n: int) -> dict[str, int]:
    return {f"V{i}.{j}": (3 * i + 5 * j) % n + 1 for i in range(1, n + 1) for j in range(1, n + 1)}


def by_name(scene: Scene) -> dict[str, DrawnDrone]:
    return {drone.name: drone for drone in scene.drones}


def four() -> Scene:
    flying = dict(list(queens(4).items())[:10])
    away = [name.replace("V", "Robot") for name in queens(4) if name not in flying]
    return scene_of(outcome(flying, Verdict.OPTIMAL, *away))


def tracks_of(html: bytes) -> dict[str, list[tuple[float, Point]]]:
    """Key frames of positions, by the drone's path."""
    (animation,) = (command for command in commands_of(html) if command["type"] == "set_animation")
    assert animation["options"] == {"play": True, "repetitions": 1}
    return {
        clip["path"]: [(key["time"], tuple(key["value"])) for key in track["keys"]]
        for clip in animation["animations"]
        for track in clip["clip"]["tracks"]
        if track["name"] == ".position"
    }


# Where drones are placed


def test_a_topic_says_where_to_fly() -> None:
    team = Team(
        "t", (robot("A", "V", topics=(topic(Constant(2), Name("V"), Apply("add", (Name("V"), Constant(1)))),)),)
    )
    (drone,) = scene_of(outcome({"V": 3}), team).drones
    assert (drone.name, drone.place, drone.home[:2]) == ("A", (2, 3, 4), (2, 3))


def test_a_withdrawn_robot_stands_where_its_topic_says_if_that_is_constant() -> None:
    topics = [(topic(Constant(x), Constant(1), Name(f"V{x}")),) for x in (1, 2)]
    team = Team("t", (robot("A", "V1", topics=topics[0]), robot("B", "V2", topics=topics[1])))
    drone = by_name(scene_of(outcome({"V1": 1}, Verdict.SOLUTION, "B"), team))["B"]
    assert (drone.home[:2], drone.place) == ((2, 1), None)
    assert drone.landing


@pytest.mark.parametrize("x", [Apply("div", (Constant(1), Constant(0))), Name("elsewhere")])
def test_undefined_coordinates_fall_through_to_the_name(x: Expression) -> None:
    team = Team("t", (robot("Robot2.3", "V", topics=(topic(x, Constant(1)),)),))
    (drone,) = scene_of(outcome({"V": 1}), team).drones
    assert drone.place == (2, 3, 1)


def test_an_undefined_height_falls_through_to_the_value() -> None:
    z = Apply("div", (Constant(1), Constant(0)))
    (drone,) = scene_of(
        outcome({"V": 1}), Team("t", (robot("A", "V", topics=(topic(Constant(1), Constant(1), z),)),))
    ).drones
    assert drone.place == (1, 1, 1)


def test_names_say_row_and_column_without_a_team() -> None:
    scene = scene_of(outcome({"V1.1": 2, "V1.2": 1, "V2.1": 1}, Verdict.SOLUTION, "Robot2.2"))
    drones = by_name(scene)
    assert {name: drone.place for name, drone in drones.items()} == {
        "V1.1": (1, 1, 2),
        "V1.2": (1, 2, 1),
        "V2.1": (2, 1, 1),
        "Robot2.2": None,
    }
    assert drones["Robot2.2"].home == (2.0, 2.0, 0.0)
    assert [axis.name for axis in scene.axes] == ["row", "column", "level"]
    assert [drone.group for drone in scene.drones if drone.name.startswith("V")] == [1, 1, 2]


def test_a_variable_lends_its_numbers_to_a_robot_without() -> None:
    (drone,) = scene_of(outcome({"V3.1": 2}), Team("t", (robot("Anna", "V3.1"),))).drones
    assert (drone.name, drone.place and drone.place[:2]) == ("Anna", (3, 1))


def test_anything_else_stands_in_a_square_in_natural_order() -> None:
    scene = scene_of(outcome({f"Robot{number}": 1 for number in (10, 9, 2, 1)}))
    assert [(drone.name, drone.home[:2]) for drone in scene.drones] == [
        ("Robot1", (1, 1)),
        ("Robot2", (1, 2)),
        ("Robot9", (2, 1)),
        ("Robot10", (2, 2)),
    ]


def test_large_and_negative_values_are_scaled_in_proportion() -> None:
    drones = by_name(scene_of(outcome({"A": -1000, "B": 10**12, "C": 500 * 10**9 - 500})))
    low, high, middle = (drones[name].place for name in "ABC")
    assert low
    assert high
    assert middle
    assert (low[2], high[2]) == (1, 4)
    assert middle[2] == pytest.approx(2.5)


def test_small_negative_values_are_levels_above_the_ground() -> None:
    scene = scene_of(outcome({"A": -2, "B": 0}))
    assert [drone.place and drone.place[2] for drone in scene.drones] == [-2, 0]
    assert scene.ground == -3


def test_a_robot_with_several_topics_has_a_drone_for_each() -> None:
    topics = tuple(
        topic(Constant(3), Constant(column), Name(f"V3.{column}"), f"/drone3.{column}/waypoint3.{column}")
        for column in (1, 2)
    )
    scene = scene_of(outcome({"V3.1": 1, "V3.2": 2}), Team("t", (robot("Robot3", "V3.1", "V3.2", topics=topics),)))
    assert {drone.name: drone.place for drone in scene.drones} == {"drone3.1": (3, 1, 1), "drone3.2": (3, 2, 2)}


def test_a_robot_with_several_variables_that_name_cells_has_a_drone_for_each() -> None:
    scene = scene_of(outcome({"V3.1": 1, "V3.2": 2}), Team("t", (robot("Robot3", "V3.1", "V3.2"),)))
    assert {drone.name: drone.place for drone in scene.drones} == {"V3.1": (3, 1, 1), "V3.2": (3, 2, 2)}


def test_nobody_flies_without_a_solution() -> None:
    team = Team("t", (robot("Robot1.1", "V1.1"), robot("Robot1.2", "V1.2")))
    scene = scene_of(outcome({}, Verdict.NO_SOLUTION), team)
    assert "no solution" in scene.title
    assert [(drone.place, drone.landing, drone.home[2]) for drone in scene.drones] == [(None, None, scene.ground)] * 2
    assert not any(command["type"] == "set_animation" for command in commands_of(scene_page(scene)))


def test_an_outcome_without_any_robot_is_a_page_too() -> None:
    scene = scene_of(outcome({}, Verdict.UNKNOWN))
    assert scene.drones == ()
    assert commands_of(scene_page(scene))


def test_no_two_drones_coincide() -> None:
    crossing = (topic(Constant(1), Constant(1), Constant(1)),)
    robots = [robot(f"Guest{number}", f"G{number}", topics=crossing) for number in range(6)]
    robots += [robot("Robot1.1", "V1.1"), robot("Robot1.2", "V1.2"), robot("Anna", "A"), robot("Berta", "B")]
    values = {variable.name: 1 for each in robots for variable in each.variables}
    scene = scene_of(outcome(values), Team("t", tuple(robots)))
    assert len(scene.drones) == 10
    for points in ([drone.home for drone in scene.drones], [drone.place for drone in scene.drones if drone.place]):
        assert len(points) == 10
        assert min(math.dist(one, other) for one, other in combinations(points, 2)) > 0.15


def test_withdrawn_drones_line_up_on_the_ground_outside_the_box() -> None:
    scene = four()
    landings = [drone.landing for drone in scene.drones if drone.landing]
    assert len(set(landings)) == 6
    assert {landing[1] for landing in landings} == {scene.axes[1].low - 2}
    assert {landing[2] for landing in landings} == {scene.ground}
    assert scene.title == "a team: 10 of 16 fly (proven best)"


def test_the_caption_says_what_happened() -> None:
    assert (
        dict(four().facts).items()
        >= {
            "verdict": "no solution for all 16",
            "withdrawn": "6",
            "protocol": "abt",
            "messages": "1,234",
        }.items()
    )
    placed = replace(outcome({"A": 1}, Verdict.OPTIMAL, "RB"), placed_by="sfb")
    assert ("protocol", "abt, then sfb") in scene_of(placed).facts


# The page


def test_the_legend_says_what_colours_mean() -> None:
    html = scene_page(four()).decode()
    (found,) = re.findall(r'<ul id="legend"[^>]*>(.*?)</ul>', html)
    assert re.findall(r"</i>([^<]*)<", found) == ["row 1", "row 2", "row 3", "row 4", "withdrawn"]


def test_many_rows_are_one_ramp_in_the_legend() -> None:
    html = scene_page(scene_of(outcome({f"V{row}.1": 1 for row in range(1, 21)}))).decode()
    (found,) = re.findall(r'<ul id="legend"[^>]*>(.*?)</ul>', html)
    assert re.findall(r"</i>([^<]*)<", found) == ["row 1 to 20"]


def test_drones_that_look_alike_need_no_legend() -> None:
    assert b'<ul id="legend"' not in scene_page(scene_of(outcome({"V1.1": 1, "V1.2": 2})))


def test_key_frames_begin_at_home_and_end_at_the_place() -> None:
    scene = four()
    tracks = tracks_of(scene_page(scene))
    for number, drone in enumerate(scene.drones, 1):
        keys = tracks[f"/meshcat/drones/{number} {drone.name}"]
        assert keys[0][0] == 0
        assert keys[0][1] == pytest.approx(drone.home, abs=0.05)
        assert keys[-1][1] == pytest.approx(drone.end, abs=0.1)
        assert drone.end == (drone.place or drone.landing)
        frames = [frame for frame, _ in keys]
        assert frames == sorted(set(frames))


def test_every_drone_bears_its_name() -> None:
    pictures = {
        command["path"]: base64.b64decode(command["object"]["images"][0]["url"].partition(",")[2]).decode()
        for command in commands_of(scene_page(four()))
        if command["path"].endswith("/name") and command["type"] == "set_object"
    }
    for number, drone in enumerate(four().drones, 1):
        assert f">{drone.name}</text>" in pictures[f"/meshcat/drones/{number} {drone.name}/name"]


def test_the_page_loads_nothing() -> None:
    html = scene_page(four()).decode()
    assert not re.search(r"""(?:src|href)\s*=\s*["']?(?!data:)[\w/]""", html.split("<script>")[0])
    assert not re.search(r"""(?:@import|url\()""", html.split("<script>")[0])
    assert set(re.findall(r"https?://[^\"'` )\\]+", html)) == {"http://www.w3.org/1999/xhtml"}  # names a namespace
    assert "connect-src 'none'" in html


def test_hostile_names_stay_text() -> None:
    scene = scene_of(
        Outcome(
            Verdict.SOLUTION,
            team=HOSTILE,
            protocol=HOSTILE,
            runtime="processes",
            seed=0,
            assignment={HOSTILE: 1, "constructor": 2},
        )
    )
    html = scene_page(scene)
    assert b"<img" not in html
    assert html.count(b"</script>") == 4
    assert {command["path"].count("/") for command in commands_of(html) if "/drones/" in command["path"]} <= {3, 4}
    assert not any("script" in path and "<" in path for path in tracks_of(html))


@looped("name", ["\x00\x1b[31m", "\ud800", "$title ${x} {y} %s", "x" * 500, "机器人1.1", ""])
def test_no_name_breaks_the_page(name: str) -> None:
    html = scene_page(
        scene_of(Outcome(Verdict.SOLUTION, team=name, protocol=name, runtime="processes", seed=0, assignment={name: 1}))
    )
    assert b"\x00" not in html
    assert commands_of(html)


def test_equal_scenes_make_equal_pages() -> None:
    assert scene_page(four()) == scene_page(four())


def test_meshcats_package_is_not_imported() -> None:
    code = (
        "import sys; from robochoc.view.page import scene_page; from tests.unit.view.test_view import four;"
        " scene_page(four()); sys.exit('meshcat' in sys.modules or 'zmq' in sys.modules)"
    )
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0
