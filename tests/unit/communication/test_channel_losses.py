"""Messages that a channel model loses by distance, in bursts, and on links that are named."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Mapping
from dataclasses import replace
from itertools import pairwise

import pytest

from robochoc.communication.simulator.channel import ChannelModel
from robochoc.communication.simulator.channel_losses import ChannelLosses
from robochoc.communication.simulator.loss_models import (
    SPEED_OF_LIGHT,
    Bursts,
    NamedLink,
    PathLoss,
    distance,
    loss_by_table,
    place_of,
)
from robochoc.communication.simulator.simulator import Simulation
from robochoc.communication.simulator.timed import Timed
from robochoc.generators.queens3d import queens3d
from robochoc.generators.random_csp import random_csp
from robochoc.journal.events import AnyEvent, Received, Sent
from robochoc.model.expression import Name
from robochoc.model.outcome import Verdict
from robochoc.model.problem import AddAgent, Constraint, Parent, Robot, ScenarioEvent, Team, Topic
from robochoc.protocols.local_search.dsa import DSA
from robochoc.protocols.message import Envelope
from robochoc.run import Options, Runtime, solve
from robochoc.run.choice import choose
from robochoc.solver.errors import UnsupportedError
from tests.support.problems import PREDICATES, team_of

STEP = ((10.0, 0.0), (20.0, 1.0))
"""Everything arrives within 10 m, nothing beyond 20 m."""


def channel(**fields: object) -> ChannelModel:
    return ChannelModel(name="field", latency_ms=1, timeout_ms=10, **fields)  # type: ignore[arg-type]


def lossy(model: ChannelModel, protocol: str = "dsa", seed: int = 0) -> Options:
    return Options(protocol=protocol, runtime=Runtime.SIMULATOR, channel=model, seed=seed)


def lost_share(model: ChannelModel, link: tuple[str, str] = ("A", "B"), many: int = 20_000) -> float:
    """The part of the messages of a link that is lost."""
    losses = ChannelLosses(model, 3)
    return sum(losses.loses(Envelope(*link, b"", 0)) for _ in range(many)) / many


# What is lost at which distance


def test_an_exponent_of_two_is_free_space() -> None:
    """Friis: what arrives falls with the square of the distance, in wavelengths."""
    radio = PathLoss(power_dbm=20, sensitivity_dbm=-70)
    for metres in (1, 10, 100):
        wavelength = SPEED_OF_LIGHT / radio.frequency_hz
        friis = 20 * math.log10(4 * math.pi * metres / wavelength)
        assert radio.margin_db(metres) == pytest.approx(20 - friis + 70)
    assert radio.margin_db(1) == pytest.approx(90 - 40.05, abs=0.01)
    assert radio.margin_db(0) == radio.margin_db(1)


def test_beyond_the_reference_each_factor_of_ten_costs_ten_times_the_exponent() -> None:
    radio = PathLoss(power_dbm=20, sensitivity_dbm=-70, exponent=3.5, reference_m=5)
    assert radio.margin_db(5) - radio.margin_db(50) == pytest.approx(35)


def test_without_shadowing_the_receiver_s_threshold_is_a_range() -> None:
    radio = PathLoss(power_dbm=0, sensitivity_dbm=-90)
    reach = 10 ** (radio.margin_db(1) / 20)
    assert (radio.loss_at(0.99 * reach), radio.loss_at(1.01 * reach)) == (0, 1)


def test_with_shadowing_half_is_lost_at_the_threshold_and_a_sixth_one_deviation_before_it() -> None:
    radio = PathLoss(power_dbm=0, sensitivity_dbm=-90, exponent=3, shadowing_db=6)
    reach = 10 ** (radio.margin_db(1) / 30)
    assert radio.loss_at(reach) == pytest.approx(0.5)
    assert radio.loss_at(reach * 10 ** (-6 / 30)) == pytest.approx(0.1587, abs=1e-4)
    assert all(near < far for near, far in pairwise(radio.loss_at(metres) for metres in (50, 100, 200, 400)))


def test_a_table_is_read_on_straight_lines_and_constant_at_both_ends() -> None:
    table = ((10.0, 0.1), (20.0, 0.5), (30.0, 0.7))
    found = [loss_by_table(table, metres) for metres in (0, 10, 15, 20, 25, 30, 1000)]
    assert found == pytest.approx([0.1, 0.1, 0.3, 0.5, 0.6, 0.7, 0.7])
    assert loss_by_table(((5.0, 0.4),), 1) == loss_by_table(((5.0, 0.4),), 9) == 0.4


def test_coordinates_are_in_units_and_a_point_without_a_height_is_on_the_ground() -> None:
    assert distance((0, 0), (3, 4)) == 5
    assert distance((0, 0), (0, 0, 2)) == 2
    assert [channel(distance_loss=STEP, unit_m=unit).loss_at(5) for unit in (1, 3, 5)] == [0, 0.5, 1]


# Where robots are


def robot_with(*topics: Topic) -> Robot:
    return replace(team_of({"A": (1, 2)}, []).robots[0], topics=topics)


def test_a_robot_is_where_its_first_topic_with_coordinates_says() -> None:
    a = Name("A")
    flies = robot_with(Topic("/battery"), Topic("/goal", x=a, y=a, z=a), Topic("/other", x=a, y=a))
    assert place_of(flies, {"A": 2}) == (2, 2, 2)
    assert place_of(flies, {}) == (1, 1, 1)  # the first value
    assert place_of(robot_with(Topic("/goal", x=a, y=a)), {"A": 1}) == (1, 1)
    assert place_of(robot_with(Topic("/goal", x=a)), {"A": 1}) is None


def on_the_diagonal() -> Team:
    """Two robots that stand where their values say, from (0, 0) to (99, 99)."""
    names = "AB"
    team = team_of(dict.fromkeys(names, range(100)), [])
    return replace(
        team,
        robots=tuple(
            replace(robot, topics=(Topic("/goal", x=Name(name), y=Name(name)),))
            for robot, name in zip(team.robots, names, strict=True)
        ),
    )


def test_the_values_that_robots_have_now_decide_and_positions_come_before_them() -> None:
    team = on_the_diagonal()
    values: dict[str, Mapping[str, int]] = {"RA": {"A": 0}, "RB": {"B": 5}}
    one = Envelope("RA", "RB", b"", 0)

    def takes(model: ChannelModel) -> bool:
        losses = ChannelLosses(model, 0)
        losses.follow(team, values.__getitem__)
        return losses.loses(one)

    model = channel(distance_loss=STEP)
    assert not takes(model)
    values["RB"] = {"B": 50}
    assert takes(model)
    assert not takes(channel(distance_loss=STEP, positions={"RB": (0.0, 9.0)}))
    values["RB"] = {}  # as if it had its first value
    assert not takes(model)


def test_a_robot_that_goes_elsewhere_again_and_again_takes_no_more_memory() -> None:
    losses = ChannelLosses(channel(distance_loss=STEP), 0)
    values = {"RA": {"A": 0}, "RB": {"B": 0}}
    losses.follow(on_the_diagonal(), values.__getitem__)
    for place in (*range(8), *range(20, 100), *range(8)):
        values["RB"]["B"] = place
        assert losses.loses(Envelope("RA", "RB", b"", 0)) == (place >= 20)
    assert len(losses._places) == 2  # noqa: SLF001 - what is kept


def test_a_robot_whose_place_is_not_known_is_refused_and_so_is_a_name_that_is_none() -> None:
    team = random_csp(4, 3, 0.7, 0.2, 1)
    first, *others = team.order
    everywhere = {name: (0.0, float(place)) for place, name in enumerate(team.order)}
    unplaced = f"position of {', '.join(team.order[:3])}, ... is unknown; give positions"
    with pytest.raises(UnsupportedError, match=unplaced):
        solve(team, lossy(channel(distance_loss=STEP)))
    with pytest.raises(UnsupportedError, match=f"position of {others[-1]} is unknown"):
        solve(team, lossy(channel(distance_loss=STEP, positions={name: everywhere[name] for name in team.order[:-1]})))
    with pytest.raises(UnsupportedError, match=rf"positions: there is no robot .* \(did you mean '{first}'"):
        solve(team, lossy(channel(distance_loss=STEP, positions={**everywhere, f"{first}x": (0.0, 0.0)})))
    with pytest.raises(UnsupportedError, match="links: there is no robot nobody"):
        solve(team, lossy(channel(links=(NamedLink(between=(first, "nobody"), loss=1),))))
    assert solve(team, lossy(channel(distance_loss=STEP, positions=everywhere))).verdict is not Verdict.NO_SOLUTION


def joining() -> Team:
    """A pair of robots; a third one joins when they are done."""
    constraint = Constraint("C", PREDICATES[0], ("A", "C"), ("A", "C"))
    pair = team_of(dict.fromkeys("AB", (1, 2)), [Constraint("C", PREDICATES[0], ("A", "B"), ("A", "B"))])
    third = replace(team_of({"A": (1, 2), "C": (1, 2)}, [constraint])["RC"], parents=(Parent("RA", (constraint,)),))
    return replace(pair, scenario=(ScenarioEvent((AddAgent(third),)),))


def test_a_robot_that_joins_has_its_place_too() -> None:
    places = {"RA": (0.0, 0.0), "RB": (1.0, 0.0), "RC": (50.0, 0.0)}
    with pytest.raises(UnsupportedError, match="position of RC is unknown"):
        solve(joining(), lossy(channel(distance_loss=STEP, positions={"RA": (0.0, 0.0), "RB": (1.0, 0.0)})))
    outcome = solve(joining(), lossy(channel(distance_loss=STEP, positions=places)))
    assert [epoch.metrics.lost_messages > 0 for epoch in outcome.epochs] == [False, True]


# Bursts and named links


def test_bursts_lose_their_part_in_the_long_run_and_come_one_after_the_other() -> None:
    bursts = Bursts(begin=0.02, end=0.25, loss=0.8)
    assert bursts.mean == pytest.approx(0.0593, abs=1e-4)
    assert lost_share(channel(bursts=bursts)) == pytest.approx(bursts.mean, abs=0.01)
    losses = ChannelLosses(channel(bursts=replace_bursts(bursts, loss=1)), 0)
    drawn = [losses.loses(Envelope("A", "B", b"", 0)) for _ in range(20_000)]
    begun = sum(now and not before for before, now in pairwise([False, *drawn]))
    assert sum(drawn) / begun == pytest.approx(1 / bursts.end, rel=0.1)


def replace_bursts(bursts: Bursts, loss: float) -> Bursts:
    return Bursts(begin=bursts.begin, end=bursts.end, loss=loss)


def test_each_link_has_bursts_of_its_own() -> None:
    losses = ChannelLosses(channel(bursts=Bursts(begin=0.5, end=0.5, loss=1)), 0)
    drawn = {
        link: [losses.loses(Envelope(*link, b"", 0)) for _ in range(40)]
        for link in (("A", "B"), ("B", "A"), ("A", "C"))
    }
    assert len({tuple(one) for one in drawn.values()}) == 3


def test_causes_are_independent_of_each_other_and_a_named_link_has_none_but_its_own() -> None:
    bursts = Bursts(begin=0.5, end=0.5, loss=0.4)
    links = (NamedLink(between=("A", "B"), loss=0, one_way=True), NamedLink(between=("C", "D"), loss=1))
    model = channel(message_loss=0.5, bursts=bursts, links=links)
    assert lost_share(model, ("A", "E")) == pytest.approx(1 - 0.5 * 0.8, abs=0.02)
    assert lost_share(model, ("B", "A")) == pytest.approx(0.6, abs=0.02)
    assert lost_share(model, ("A", "B"), 100) == 0
    assert [lost_share(model, link, 100) for link in (("C", "D"), ("D", "C"))] == [1, 1]


def test_the_largest_loss_of_a_link_is_what_a_protocol_is_chosen_by() -> None:
    assert channel().most_loss == 0
    assert channel(message_loss=0.1, distance_loss=((1, 0.5), (2, 0.2))).most_loss == pytest.approx(0.55)
    assert channel(path_loss=PathLoss(power_dbm=0, sensitivity_dbm=-90)).most_loss == 1
    assert channel(links=(NamedLink(between=("A", "B"), loss=0.3),)).most_loss == 0.3
    near = channel(distance_loss=((1, 0.05),))
    assert choose(queens3d(3), lossy(near, "auto")).options.protocol == "gdba"
    assert choose(queens3d(3), lossy(channel(distance_loss=STEP), "auto")).options.protocol == "dsa"


# Whole runs


def test_of_each_link_so_many_messages_arrive_as_its_distance_says() -> None:
    """Queens stand in rows and columns: the farther apart, the more is lost, and each message is counted."""
    model = channel(distance_loss=((1, 0.0), (5, 0.8)))
    events: list[AnyEvent] = []
    team = queens3d(3)
    run = Simulation(team, DSA, Timed(1, model), losses=ChannelLosses(model, 1), observer=events.append)
    result = run.search()
    sent = Counter((one.sender, one.receiver) for one in events if isinstance(one, Sent))
    received = Counter((one.sender, one.receiver) for one in events if isinstance(one, Received))
    assert result.metrics.lost_messages == sent.total() - received.total() > 0
    values = {name: values for own in result.assignments.values() for name, values in own.items()}
    shares: dict[int, list[float]] = {}
    for link in sent:
        one, other = (place_of(team[name], values) for name in link)
        assert one is not None
        assert other is not None
        shares.setdefault(round(distance(one[:2], other[:2]) ** 2), []).append(1 - received[link] / sent[link])
    means = [sum(found) / len(found) for _, found in sorted(shares.items())]
    assert means == sorted(means)


def test_the_same_seed_loses_the_same_and_another_one_other_messages() -> None:
    model = channel(distance_loss=((1, 0.0), (5, 0.8)), bursts=Bursts(begin=0.1, end=0.5, loss=1))
    once, again, other = (solve(queens3d(3), lossy(model, seed=seed)) for seed in (1, 1, 2))
    assert replace(once.metrics, wall_s=0) == replace(again.metrics, wall_s=0)
    assert once.assignment == again.assignment
    assert once.metrics.lost_messages != other.metrics.lost_messages


def test_the_option_counts_before_all_that_the_model_says() -> None:
    team = random_csp(4, 3, 0.7, 0.2, 1)
    model = channel(distance_loss=((0, 1.0),), links=(NamedLink(between=("nobody", "somebody"), loss=1),))
    outcome = solve(team, replace(lossy(model), message_loss=0.1))
    assert 0 < outcome.metrics.lost_messages < sum(outcome.metrics.messages.values()) / 2


def test_out_of_range_every_message_is_lost_and_all_is_over_nevertheless() -> None:
    outcome = solve(queens3d(3), lossy(channel(distance_loss=((0, 1.0),))))
    assert outcome.metrics.lost_messages == sum(outcome.metrics.messages.values()) > 0
    claimed = solve(queens3d(3), lossy(channel(distance_loss=((0, 1.0),)), "abt"))
    assert claimed.verdict in {Verdict.UNKNOWN, Verdict.SOLUTION}
