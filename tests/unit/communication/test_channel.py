"""Channel models: what a message needs, simulated time, and that verdicts stay what they are."""

from __future__ import annotations

import statistics
from dataclasses import replace
from itertools import pairwise
from random import Random

import msgspec
import pytest
from hypothesis import given
from hypothesis import strategies as st

from robochoc.communication.simulator.channel import CHANNELS, ChannelModel
from robochoc.communication.simulator.schedule import Concurrent
from robochoc.communication.simulator.timed import Timed
from robochoc.formats import read_team
from robochoc.formats.result import read_result, result_json
from robochoc.generators.queens3d import queens3d
from robochoc.journal.events import Sent, Settled
from robochoc.journal.journal import Header, JournalRecorder, lines_of, metrics_of, read_journal
from robochoc.model.outcome import Verdict
from robochoc.model.problem import Team
from robochoc.protocols.message import Envelope
from robochoc.run import Options, Runtime, ScheduleName, Withdrawal, solve
from robochoc.solver.errors import UnsupportedError
from tests.support.brute_force import solutions
from tests.support.cases import looped
from tests.support.examples import examples
from tests.support.problems import random_team, teams
from tests.support.program import ROOT

RESCUE = ROOT / "docs" / "examples" / "rescue"
PATROL = ROOT / "docs" / "examples" / "patrol"
NOTHING = ChannelModel(name="nothing", latency_ms=0, check_ns=0)
LOSSY = ChannelModel(name="lossy", latency_ms=1, loss=0.5, timeout_ms=10, longest_timeout_ms=40)

models = st.builds(
    ChannelModel,
    name=st.just("any"),
    latency_ms=st.floats(5, 50),
    minimum_ms=st.floats(0, 5),
    sigma=st.floats(0, 2),
    bandwidth_bps=st.none() | st.floats(1e3, 1e9),
    payload_bytes=st.integers(8, 100),
    overhead_bytes=st.integers(0, 100),
    loss=st.floats(0, 0.5),
    timeout_ms=st.floats(0, 20),
    shared=st.booleans(),
)


def simulated(channel: ChannelModel, protocol: str = "abt", seed: int = 0) -> Options:
    return Options(protocol=protocol, runtime=Runtime.SIMULATOR, seed=seed, channel=channel)


def recorded(team: Team, options: Options) -> list[bytes]:
    recorder = JournalRecorder(
        Header(team=team.name, protocol=options.protocol, runtime="simulator", seed=options.seed)
    )
    solve(team, options, observer=recorder)
    return [*lines_of(read_journal(recorder.content()))]


# What a message needs


@looped("model", CHANNELS.values())
def test_what_is_shipped_has_the_median_that_it_says_and_nothing_below_the_minimum(model: ChannelModel) -> None:
    chance = Random(1)
    latencies = [model.crossing(100, chance).latency / 1e6 for _ in range(4001)]
    assert min(latencies) >= model.minimum_ms
    assert statistics.median(latencies) == pytest.approx(model.latency_ms, rel=0.1)


def test_wlan_has_the_percentiles_that_were_measured() -> None:
    chance = Random(2)
    latencies = [CHANNELS["wlan"].crossing(100, chance).latency / 1e6 for _ in range(4001)]
    assert statistics.quantiles(latencies, n=10)[-1] == pytest.approx(20, rel=0.1)


def test_twice_the_bytes_are_twice_as_long_on_the_air() -> None:
    model = ChannelModel(name="slow", latency_ms=0, bandwidth_bps=1000)
    assert [model.crossing(size, Random(0)).air for size in (0, 1, 125, 250, 1448, 2896)] == [
        size * 8_000_000 for size in (0, 1, 125, 250, 1448, 2896)
    ]


def test_each_frame_has_its_headers_and_its_own_time() -> None:
    model = ChannelModel(
        name="framed", latency_ms=0, bandwidth_bps=8000, payload_bytes=10, overhead_bytes=5, frame_us=2000
    )
    for size, frames in ((0, 1), (1, 1), (10, 1), (11, 2), (20, 2), (21, 3)):
        assert model.crossing(size, Random(0)).air == frames * (5_000_000 + 2_000_000) + size * 1_000_000


def test_without_a_bandwidth_bytes_take_no_time() -> None:
    assert NOTHING.crossing(10**6, Random(0)) == (0, 0, 0)


def test_what_is_lost_is_sent_again_after_timeouts_that_grow() -> None:
    waited = {LOSSY.crossing(100, Random(seed)).waiting for seed in range(400)}
    assert waited >= {0, 10_000_000, 30_000_000, 70_000_000, 110_000_000}
    model = msgspec.structs.replace(LOSSY, bandwidth_bps=8000)
    crossings = [model.crossing(100, Random(seed)) for seed in range(50)]
    again = {(crossing.air // 100_000_000, crossing.waiting) for crossing in crossings}
    assert {(1, 0), (2, 10_000_000), (3, 30_000_000)} <= again


@looped("loss", [0.0, 0.1, 0.5])
def test_as_many_transmissions_are_lost_as_it_says(loss: float) -> None:
    model = msgspec.structs.replace(LOSSY, loss=loss, bandwidth_bps=8000, payload_bytes=100)
    frames = model.crossing(100 * 4000, Random(0)).air / 100_000_000
    assert frames == pytest.approx(4000 / (1 - loss), rel=0.05)


# The schedule


@given(model=models, seed=st.integers(0, 2**32), messages=st.lists(st.tuples(*[st.integers(0, 2)] * 3), max_size=30))
@examples(60)
def test_every_message_arrives_once_in_its_channels_order_and_not_too_soon(
    model: ChannelModel, seed: int, messages: list[tuple[int, int, int]]
) -> None:
    schedule = Timed(seed, model)
    put: dict[tuple[str, str], list[bytes]] = {}
    for sender in range(3):
        for number, (_, receiver, _) in enumerate(message for message in messages if message[0] == sender):
            edge = f"S{sender}", f"R{receiver}"
            content = bytes([number]) * (1 + number * 7)
            put.setdefault(edge, []).append(content)
            schedule.put(Envelope(*edge, content, 0))
        schedule.done(f"S{sender}", 0, sum(message[2] for message in messages if message[0] == sender))
    got: dict[tuple[str, str], list[bytes]] = {}
    before = 0
    while packet := schedule.get():
        assert schedule.now >= max(before, model.minimum_ms * 1e6 - 1)
        before = schedule.now
        assert len({envelope.receiver for envelope in packet}) == 1
        for envelope in packet:
            got.setdefault((envelope.sender, envelope.receiver), []).append(envelope.content)
        schedule.done(packet[0].receiver, 0, 3)
    assert got == put


def arrivals(shared: object, ready: list[tuple[str, int]]) -> list[int]:
    """When messages of a second each get to robots that have nothing else to do, sent after so many checks of 1 s."""
    model = ChannelModel(
        name="second", latency_ms=0, bandwidth_bps=8, payload_bytes=8, shared=bool(shared), check_ns=10**9
    )
    schedule = Timed(0, model)
    for number, (sender, checks) in enumerate(ready):
        schedule.put(Envelope(sender, f"R{number}", b"x", 0), checks)
        schedule.done(sender, 0, checks)
    times = []
    while packet := schedule.get():
        times.append(round(schedule.now / 1e9))
        schedule.done(packet[0].receiver, 0, 0)
    return times


def test_a_shared_medium_carries_one_message_at_a_time() -> None:
    together = [("A", 0), ("B", 0), ("C", 0)]
    assert arrivals(True, together) == [1, 2, 3]
    assert arrivals(False, together) == [1, 1, 1]


def test_a_robot_has_one_radio() -> None:
    assert arrivals(False, [("A", 0), ("A", 0), ("B", 0)]) == [1, 1, 2]


def test_a_message_leaves_when_it_was_said_and_its_sender_computes_on() -> None:
    model = ChannelModel(name="even", latency_ms=1, check_ns=1000)
    schedule = Timed(0, model)
    for checks in (2, 5000):
        schedule.put(Envelope("A", "B", b"x", 0), checks)
    schedule.done("A", 0, 6000)
    times = []
    while schedule.get():
        times.append(schedule.now)
        schedule.done("B", 0, 0)
    assert times == [1_002_000, 6_000_000]
    assert schedule.elapsed_s == 0.006


def test_the_medium_is_given_to_whom_is_ready_first_not_to_whom_began_first() -> None:
    assert arrivals(True, [("A", 10), ("B", 2)]) == [3, 11]


@given(team=teams, seed=st.integers(0, 2**32), model=models)
@examples(30)
def test_a_seed_is_a_run(team: Team, seed: int, model: ChannelModel) -> None:
    assert recorded(team, simulated(model, seed=seed)) == recorded(team, simulated(model, seed=seed))


def test_other_seeds_are_other_times() -> None:
    team = queens3d(3)
    times = {solve(team, simulated(CHANNELS["wlan"], seed=seed)).metrics.simulated_s for seed in range(4)}
    assert len(times) == 4


# Runs


SATISFY = ("aas", "abt", "abt-hyb", "afc", "afc-ng", "awc", "disfc", "dynabt", "sbt")


@looped("channel", sorted(CHANNELS))
def test_verdicts_are_those_of_brute_force(channel: str) -> None:
    for seed in range(6):
        team = random_team(Random(f"{channel} {seed}"), n_ary=False)
        solvable = next(solutions(team), None) is not None
        for protocol in SATISFY:
            outcome = solve(team, simulated(CHANNELS[channel], protocol, seed))
            assert outcome.verdict == (Verdict.SOLUTION if solvable else Verdict.NO_SOLUTION), (protocol, seed)
            assert outcome.channel == channel


def test_the_least_cost_is_the_same_by_every_channel() -> None:
    team = read_team(PATROL)
    least = solve(team, Options(protocol="syncbb", runtime=Runtime.SIMULATOR)).cost
    for model in (LOSSY, *CHANNELS.values()):
        for protocol in ("adopt", "bnb-adopt", "dpop", "sfb"):
            outcome = solve(team, simulated(model, protocol))
            assert (outcome.verdict, outcome.cost) == (Verdict.OPTIMAL, least), (model.name, protocol)


@looped("loss", [0.1, 0.5, 0.9])
def test_loss_only_delays(loss: float) -> None:
    team = queens3d(3)
    perfect = msgspec.structs.replace(LOSSY, loss=0)
    # One robot works at a time: what is said does not depend on when it comes.
    lost = solve(team, simulated(msgspec.structs.replace(LOSSY, loss=loss), "sbt", 1))
    none = solve(team, simulated(perfect, "sbt", 1))
    assert lost.metrics.simulated_s > none.metrics.simulated_s
    assert (lost.verdict, lost.metrics.messages) == (none.verdict, none.metrics.messages)


def test_latency_does_not_leak_into_ncccs() -> None:
    team = queens3d(3)
    slow = msgspec.structs.replace(NOTHING, name="slow", latency_ms=1000)
    # One robot works at a time: by any channel the same checks follow each other.
    ncccs = {solve(team, simulated(model, "sbt")).metrics.ncccs for model in (NOTHING, slow, *CHANNELS.values())}
    ncccs.add(solve(team, Options(protocol="sbt", runtime=Runtime.SIMULATOR)).metrics.ncccs)
    assert len(ncccs) == 1
    assert solve(team, Options(protocol="sbt", runtime=Runtime.SIMULATOR, delay=1000)).metrics.ncccs > 10 * ncccs.pop()


@given(team=teams, seed=st.integers(0, 2**32))
@examples(25)
def test_where_nothing_takes_time_no_time_passes(team: Team, seed: int) -> None:
    outcome = solve(team, simulated(NOTHING, seed=seed))
    assert outcome.metrics.simulated_s == 0
    assert outcome.verdict == (Verdict.SOLUTION if next(solutions(team), None) else Verdict.NO_SOLUTION)


@given(team=teams, seed=st.integers(0, 2**32))
@examples(25)
def test_where_only_checks_take_time_it_lies_between_the_longest_chain_of_them_and_all(team: Team, seed: int) -> None:
    spent = solve(team, simulated(msgspec.structs.replace(NOTHING, check_ns=1000), seed=seed)).metrics
    assert spent.ncccs <= round(spent.simulated_s * 1e6) <= spent.checks


def test_a_chain_of_messages_takes_latencies_and_checks() -> None:
    model = ChannelModel(name="even", latency_ms=100, check_ns=1000)
    spent = solve(queens3d(2), simulated(model, "sbt")).metrics
    messages = sum(spent.messages.values())
    assert spent.simulated_s == pytest.approx(messages * 0.1 + spent.ncccs * 1e-6, abs=0.1)


def test_journals_have_the_simulated_times() -> None:
    model = CHANNELS["wman"]
    recorder = JournalRecorder(Header(team="four", protocol="abt", runtime="simulator", seed=0, channel="wman"))
    spent = solve(queens3d(3), simulated(model), observer=recorder).metrics
    journal = read_journal(recorder.content())
    assert journal.header.channel == "wman"
    assert max(event.t for event in journal.events if isinstance(event, Settled)) == spent.simulated_s
    assert [event.t for event in journal.events] == sorted(event.t for event in journal.events)
    assert min(event.t for event in journal.events if isinstance(event, Sent)) < 0.01 < spent.simulated_s
    read = metrics_of(journal.events)
    assert replace(read, wall_s=spent.wall_s, simulated_s=spent.simulated_s) == spent


def test_epochs_and_those_who_step_aside_add_up() -> None:
    changing = solve(read_team(RESCUE), simulated(CHANNELS["wlan"], "dynabt"))
    times = [epoch.metrics.simulated_s for epoch in changing.epochs]
    assert len(times) > 1
    assert min(times) > 0
    assert changing.metrics.simulated_s == pytest.approx(sum(times))
    team = queens3d(3)
    alone = solve(team, simulated(CHANNELS["wwan"]))
    aside = solve(team, replace(simulated(CHANNELS["wwan"]), withdraw=Withdrawal.MAXIMAL))
    assert aside.metrics.simulated_s > alone.metrics.simulated_s > 0


def test_what_is_cleared_begins_again() -> None:
    schedule = Timed(0, ChannelModel(name="even", latency_ms=100, check_ns=1000))
    for _ in range(2):
        assert (schedule.elapsed_s, schedule.time(5)) == (0, 5e-6)
        schedule.put(Envelope("A", "B", b"x", 0), 4)
        schedule.done("A", 0, 10)
        assert schedule.get()
        assert (schedule.time(0), schedule.elapsed_s) == (0.100004, 0.00001)
        schedule.put(Envelope("B", "A", b"x", 0), 0)
        schedule.done("B", 0, 10)
        assert schedule.elapsed_s == 0.100014
        schedule.clear()
        assert not schedule.get()


def test_other_schedules_simulate_no_seconds() -> None:
    assert Concurrent(0).elapsed_s == 0
    assert solve(queens3d(2), Options(runtime=Runtime.SIMULATOR)).metrics.simulated_s == 0


def test_the_result_is_read_back() -> None:
    for outcome in (
        solve(read_team(RESCUE), simulated(CHANNELS["wpan"], "dynabt")),
        solve(queens3d(2), Options(runtime=Runtime.SIMULATOR)),
    ):
        read = read_result(result_json(outcome))
        assert (read.channel, read.metrics.simulated_s) == (outcome.channel, outcome.metrics.simulated_s)
        assert [e.metrics.simulated_s for e in read.epochs] == [e.metrics.simulated_s for e in outcome.epochs]


@looped(
    "options",
    [
        Options(channel=NOTHING),
        Options(channel=NOTHING, runtime=Runtime.SIMULATOR, delay=1),
        Options(channel=NOTHING, runtime=Runtime.SIMULATOR, schedule=ScheduleName.RANDOM),
    ],
)
def test_a_channel_is_not_ignored(options: Options) -> None:
    with pytest.raises(UnsupportedError, match="--channel"):
        solve(queens3d(2), options)


def test_times_grow_from_one_event_to_the_next_of_a_robot() -> None:
    recorder = JournalRecorder(Header(team="t", protocol="abt", runtime="simulator", seed=0))
    solve(queens3d(2), simulated(CHANNELS["wlan"]), observer=recorder)
    for robot in queens3d(2).order:
        events = read_journal(recorder.content()).events
        own = [event.t for event in events if isinstance(event, Settled) and event.robot == robot]
        assert all(before <= after for before, after in pairwise(own))
