"""What decisions mean for drones: who stands where, who flies where, who lands."""

from __future__ import annotations

import math
from dataclasses import replace
from itertools import combinations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from robochoc.flight.crafts import Craft, crafts_of
from robochoc.flight.layout import BoxAxis, layout_of
from robochoc.flight.mission import VAST_M, Mission, mission_of
from robochoc.model.expression import Apply, Constant, Name
from robochoc.model.outcome import EpochOutcome, Outcome, Verdict
from robochoc.model.problem import AddAgent, Domain, Robot, ScenarioEvent, Team, Topic, Variable
from tests.support.outcomes import outcome_of


def robot(name: str, z: str, x: int, y: int, *, times: int = 1) -> Robot:
    topic = Topic(f"/{name}/waypoint", x=Constant(x * times), y=Constant(y * times), z=Name(z))
    return Robot(name, (Variable(z, Domain("D", (range(1, 5),))),), topics=(topic,))


TEAM = Team("duo", (robot("A", "a", 1, 1), robot("B", "b", 1, 2)))


def result(values: dict[str, int], *withdrawn: str, verdict: Verdict = Verdict.SOLUTION) -> Outcome:
    return outcome_of(values, verdict, team="duo", withdrawn=withdrawn)


def goals(mission: Mission, leg: int = -1) -> dict[str, tuple[tuple[float, float, float], bool]]:
    return {mission.drones[number].name: (goal.at, goal.lands) for number, goal in mission.legs[leg].goals.items()}


def test_a_decision_is_a_place_in_metres() -> None:
    mission = mission_of(result({"a": 3, "b": 4}), TEAM)
    assert goals(mission) == {"A": ((1, 1, 3), False), "B": ((1, 2, 4), False)}
    assert [drone.home for drone in mission.drones] == [(1, 1, 0), (1, 2, 0)]
    assert [drone.robot for drone in mission.drones] == ["A", "B"]
    assert mission.ground == 0


def test_a_unit_is_as_long_as_one_says() -> None:
    mission = mission_of(result({"a": 3, "b": 4}), TEAM, scale=0.5)
    assert goals(mission)["B"] == ((0.5, 1, 2), False)
    assert [drone.home for drone in mission.drones] == [(0.5, 0.5, 0), (0.5, 1, 0)]


def test_who_withdraws_lands_at_the_edge() -> None:
    mission = mission_of(result({"a": 3}, "B", verdict=Verdict.OPTIMAL), TEAM)
    (x, y, z), lands = goals(mission)["B"]
    assert lands
    assert z == mission.ground
    assert y < min(drone.home[1] for drone in mission.drones)
    assert math.isfinite(x)


def test_without_a_solution_everybody_stays() -> None:
    assert goals(mission_of(result({}, verdict=Verdict.NO_SOLUTION), TEAM)) == {}


def test_each_epoch_is_a_leg() -> None:
    late = robot("C", "c", 2, 2)
    team = Team("trio", TEAM.robots, (ScenarioEvent((AddAgent(late),)),))
    epochs = (
        EpochOutcome(Verdict.SOLUTION, robots=("A", "B"), assignment={"a": 1, "b": 2}),
        EpochOutcome(Verdict.SOLUTION, robots=("A", "B", "C"), opened_by="+C", assignment={"a": 1, "b": 3, "c": 2}),
        EpochOutcome(Verdict.NO_SOLUTION, robots=("A", "B", "C"), opened_by="fog"),
        EpochOutcome(Verdict.SOLUTION, robots=("B", "C"), opened_by="-A", assignment={"b": 4, "c": 1}),
    )
    outcome = outcome_of({"b": 4, "c": 1}, team="trio", protocol="dynabt", epochs=epochs)
    mission = mission_of(outcome, team)
    assert [leg.opened_by for leg in mission.legs] == ["the start", "+C", "fog", "-A"]
    assert [sorted(goals(mission, leg)) for leg in range(4)] == [["A", "B"], ["A", "B", "C"], [], ["A", "B", "C"]]
    assert goals(mission)["A"][1]
    assert goals(mission)["B"] == ((1, 2, 4), False)
    assert mission.drones[2].home == (2, 2, 0)


def test_without_the_team_variables_fly() -> None:
    mission = mission_of(result({"V1.1": 3}, "Robot1.2", verdict=Verdict.OPTIMAL))
    assert goals(mission)["V1.1"] == ((1, 1, 3), False)
    assert goals(mission)["Robot1.2"][1]
    assert [drone.topic for drone in mission.drones] == [None, None]


def test_a_vast_field_is_flown_smaller_unless_one_says() -> None:
    for times, longest_m in ((100, VAST_M), (1000, 225)):
        team = Team("far", (robot("A", "a", 0, 0), robot("B", "b", 9, 9, times=times)))
        mission = mission_of(result({"a": 3, "b": 4}), team)
        assert max(part for goal, _ in goals(mission).values() for part in goal) == pytest.approx(longest_m)
    at, _ = goals(mission_of(result({"a": 3, "b": 4}), team, scale=1.0))["B"]
    assert at == pytest.approx((9000, 9000, 4))


def test_two_sent_to_one_place_do_not_meet() -> None:
    team = Team("crowd", tuple(robot(name, name.lower(), 1, 1) for name in "ABCDEFGH"))
    mission = mission_of(result(dict.fromkeys("abcdefgh", 2)), team)
    places = [at for at, _ in goals(mission).values()]
    assert min(math.dist(one, two) for one, two in combinations(places, 2)) >= 0.5
    homes = [drone.home for drone in mission.drones]
    assert min(math.dist(one, two) for one, two in combinations(homes, 2)) >= 0.5


def test_a_robot_without_coordinates_still_has_its_topic() -> None:
    plain = Robot(
        "Robot3.1", (Variable("V3.1", Domain("D", (range(1, 5),))),), topics=(Topic("/drone3.1/waypoint3.1"),)
    )
    mission = mission_of(result({"V3.1": 2}), Team("figure 2", (plain,)))
    assert mission.drones[0].topic == plain.topics[0]
    assert goals(mission) == {"Robot3.1": ((3, 1, 2), False)}


def test_several_topics_are_several_drones() -> None:
    topics = tuple(Topic(f"/drone{n}/waypoint", x=Constant(n), y=Constant(0), z=Name(f"v{n}")) for n in (1, 2))
    domain = Domain("D", (range(5),))
    pair = Robot("Pair", (Variable("v1", domain), Variable("v2", domain)), topics=topics)
    mission = mission_of(result({"v1": 1, "v2": 3}), Team("pair", (pair,)))
    assert [(drone.name, drone.robot, drone.topic) for drone in mission.drones] == [
        ("drone1", "Pair", topics[0]),
        ("drone2", "Pair", topics[1]),
    ]
    assert goals(mission) == {"drone1": ((1, 0, 1), False), "drone2": ((2, 0, 3), False)}


def test_a_place_that_is_not_defined_is_known_by_the_name() -> None:
    divided = Topic("/odd", x=Apply("div", (Constant(1), Name("V1.2"))), y=Constant(1), z=Name("V1.2"))
    odd = Robot("Robot1.2", (Variable("V1.2", Domain("D", (range(3),))),), topics=(divided,))
    (craft,) = crafts_of(odd, {"V1.2": 0})
    assert (craft.cell, craft.level) == ((1, 2), 0)


@given(st.lists(st.integers(-5000, 5000), min_size=1), st.integers(2, 40), st.integers(2, 40), st.floats(-9, 9))
def test_an_axis_goes_both_ways(values: list[int], most: int, scaled: int, cell: float) -> None:
    axis = BoxAxis.spanning("x", values, most=most, scaled=scaled)
    assert axis.at(axis.value(cell)) == pytest.approx(cell)
    assert [axis.at(axis.first), axis.at(axis.last)] == [axis.low, axis.high]


def test_an_axis_of_a_map_is_labelled_in_metres() -> None:
    axis = replace(BoxAxis.spanning("x", [-2, 18], most=40, scaled=40), unit_m=0.75)  # from -1.5 m to 13.5 m
    assert axis.title == "x (m)"
    assert [text for _, text in axis.ticks] == ["0", "2", "4", "6", "8", "10", "12"]
    assert all(axis.value(at) * 0.75 == pytest.approx(float(text)) for at, text in axis.ticks)
    small = replace(BoxAxis.spanning("y", [0, 3], most=40, scaled=40), unit_m=0.05)
    assert [text for _, text in small.ticks][:3] == ["0", "0.02", "0.04"]
    at, text = small.ticks[-1]
    assert (round(at, 9), text) == (2.8, "0.14")
    assert replace(BoxAxis.spanning("z", [1], most=6, scaled=6), unit_m=0.75).ticks == [(1, "0.75")]


def test_axes_without_a_map_are_labelled_in_their_own_values() -> None:
    assert BoxAxis.spanning("x", [3, 5], most=40, scaled=40).ticks == [(3, "3"), (4, "4"), (5, "5")]
    assert BoxAxis.spanning("level", [0, 10**18], most=6, scaled=6).ticks[-1] == (6, str(10**18))


@given(st.lists(st.tuples(st.integers(0, 3), st.integers(0, 3), st.integers(0, 2)), min_size=1, max_size=30))
def test_places_of_a_field_are_apart(cells: list[tuple[int, int, int]]) -> None:
    crew = [Craft(f"c{number}", (x, y), z) for number, (x, y, z) in enumerate(cells)]
    field = layout_of(crew)
    places = [place for place in field.places(crew) if place]
    assert len(places) == len(crew)
    for spots in (places, field.homes):
        assert all(math.dist(one, two) >= 0.5 for one, two in combinations(spots, 2))
