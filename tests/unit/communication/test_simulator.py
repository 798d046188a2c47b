"""The simulator: deterministic from its seed, exact counts, golden journals, schedules that keep FIFO."""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import pytest
from hypothesis import given
from hypothesis import strategies as st

from robochoc.communication.simulator.schedule import Concurrent, Cycles, RandomChannels, Schedule
from robochoc.communication.simulator.simulator import Simulation
from robochoc.generators.queens3d import queens3d
from robochoc.generators.random_csp import random_csp
from robochoc.journal.journal import Header, JournalRecorder, lines_of, metrics_of, read_journal
from robochoc.model.outcome import Metrics, Verdict
from robochoc.model.problem import Constraint, Relation, Semantics, Team
from robochoc.protocols.local_search.dsa import DSA
from robochoc.protocols.message import Envelope
from robochoc.run import Options, Runtime, ScheduleName, Withdrawal, solve
from robochoc.solver.agent_problem import RunParameters
from tests.support import golden
from tests.support.cases import cases, looped
from tests.support.examples import examples
from tests.support.growth import steps_of
from tests.support.problems import team_of, teams

IN_SIMULATOR = Options(protocol="abt", runtime=Runtime.SIMULATOR)


@looped(
    ("n", "model", "messages", "ncccs", "checks"),
    [
        (4, "planar", {"AddLink": 6, "Nogood": 77, "Ok": 573}, 77, 875),
        (4, "full", {"AddLink": 2, "Nogood": 87, "Ok": 483}, 60, 707),
        (7, "planar", {"AddLink": 74, "Nogood": 174, "Ok": 2364}, 262, 7663),
    ],
)
def test_counts_of_queens_are_exact(n: int, model: str, messages: dict[str, int], ncccs: int, checks: int) -> None:
    metrics = solve(queens3d(n, model), IN_SIMULATOR).metrics
    assert (metrics.messages, metrics.ncccs, metrics.checks) == (messages, ncccs, checks)


@pytest.mark.parametrize("protocol", sorted(folder.name for folder in golden.FOLDER.iterdir()))
def test_journals_are_as_they_were(protocol: str) -> None:
    ours = [file for file in golden.files() if file.startswith(f"{protocol}/")]
    assert {f"{protocol}/{path.name}" for path in (golden.FOLDER / protocol).iterdir()} == {*ours}
    with cases() as each:
        for file in ours:
            with each(file):
                assert golden.content(file) == (golden.FOLDER / file).read_bytes()


def test_each_protocol_has_golden_journals() -> None:
    assert {file.partition("/")[0] for file in golden.files()} == {folder.name for folder in golden.FOLDER.iterdir()}


@given(team=teams, seed=st.integers(0, 2**32), schedule=st.sampled_from(list(ScheduleName)))
@examples(50)
def test_a_seed_is_a_run(team: Team, seed: int, schedule: ScheduleName) -> None:
    delay = seed % 30 if schedule is ScheduleName.CONCURRENT else 0
    once, again = (recorded(team, replace(IN_SIMULATOR, seed=seed, schedule=schedule, delay=delay)) for _ in range(2))
    assert once.events == again.events


@given(team=teams, seed=st.integers(0, 2**32))
@examples(50)
def test_metrics_from_the_journal_are_the_hosts(team: Team, seed: int) -> None:
    once = recorded(team, replace(IN_SIMULATOR, seed=seed, withdraw=Withdrawal.MAXIMAL))
    assert replace(once.read, wall_s=once.metrics.wall_s) == once.metrics


class Recorded(NamedTuple):
    """A run, its journal line by line, and the metrics that the journal says."""

    metrics: Metrics
    events: list[bytes]
    read: Metrics


def recorded(team: Team, options: Options) -> Recorded:
    recorder = JournalRecorder(Header(team=team.name, protocol="abt", runtime="simulator", seed=options.seed))
    metrics = solve(team, options, observer=recorder).metrics
    journal = read_journal(recorder.content())
    return Recorded(metrics, [*lines_of(journal)], metrics_of(journal.events))


def test_other_seeds_are_other_runs_and_delays_go_into_the_clock() -> None:
    runs = [solve(queens3d(4), replace(IN_SIMULATOR, seed=seed)).metrics for seed in range(5)]
    assert len({sum(metrics.messages.values()) for metrics in runs}) > 1
    assert solve(queens3d(4), replace(IN_SIMULATOR, delay=1000)).metrics.ncccs > 10 * runs[0].ncccs


@pytest.mark.usefixtures("a_second_a_look")
def test_a_timeout_is_an_unknown() -> None:
    outcome = solve(queens3d(8), replace(IN_SIMULATOR, timeout=0.05))
    assert outcome.verdict is Verdict.UNKNOWN
    assert not outcome.assignment
    assert not outcome.verified


def test_a_timeout_holds_where_a_packet_takes_long() -> None:
    """The first one alone takes half an hour, and proves then that there is no solution."""
    never = Relation("R", 2, Semantics.SUPPORTS, ((-1, -1),))
    team = team_of({"X": range(20_000), "Y": range(20_000)}, [Constraint("C", never, ("X", "Y"), ("X", "Y"))])
    assert solve(team, replace(IN_SIMULATOR, timeout=0.3)).verdict is Verdict.UNKNOWN


@given(
    sends=st.lists(st.tuples(st.sampled_from("ABC"), st.sampled_from("DE"), st.integers(0, 20)), max_size=60),
    seed=st.integers(0, 1000),
    longest=st.integers(0, 50),
)
def test_channels_are_fifo_and_lose_nothing(sends: list[tuple[str, str, int]], seed: int, longest: int) -> None:
    asynchronous = RandomChannels(seed), Concurrent(seed, longest), Concurrent(seed, longest, one_by_one=True)
    for schedule in (*asynchronous, Cycles(seed)):
        arrived = delivered(schedule, sends)
        for edge in {send[:2] for send in sends}:
            sent = [number for number, send in enumerate(sends) if send[:2] == edge]
            assert [int(e.content) for e in arrived if (e.sender, e.receiver) == edge] == sent


def test_one_by_one_a_packet_is_the_first_message_of_the_inbox() -> None:
    """The next one is read when the first has been answered, even if both were there."""
    for one_by_one, packets in ((False, [["1", "2", "3"]]), (True, [["1"], ["2"], ["3"]])):
        schedule = Concurrent(0, one_by_one=one_by_one)
        for number, sender in enumerate("ABA", 1):
            schedule.put(Envelope(sender, "D", str(number).encode(), 0))
        read = []
        while packet := taken(schedule):
            read.append([envelope.content.decode() for envelope in packet])
        assert read == packets


def test_a_cycle_takes_no_longer_than_those_before() -> None:
    """A robot has one turn in the agenda, and not one for each message that came while it was busy."""
    team = random_csp(12, 3, 0.5, 0.3, 1, connected=True)

    def taken_by(cycles: int) -> int:
        parameters = RunParameters(settings={"cycles": str(cycles)})
        return steps_of(Simulation(team, DSA, Concurrent(0), parameters=parameters).search)

    _, thirty, fifty, seventy = (taken_by(cycles) for cycles in (30, 30, 50, 70))  # the first one fills caches
    assert seventy - fifty < 1.1 * (fifty - thirty)


def test_one_by_one_abt_needs_more() -> None:
    team = random_csp(12, 5, 0.5, 0.4, 1, connected=True)
    one, other = (solve(team, replace(IN_SIMULATOR, schedule=name)) for name in list(ScheduleName)[:2])
    assert one.verdict is other.verdict
    assert other.metrics.ncccs > one.metrics.ncccs


def delivered(schedule: Schedule, sends: list[tuple[str, str, int]]) -> list[Envelope]:
    """Put everything, some of it between packets; then take what arrives."""
    arrived: list[Envelope] = []
    for number, (sender, receiver, clock) in enumerate(sends):
        schedule.put(Envelope(sender, receiver, str(number).encode(), clock))
        if number % 5 == 4:
            arrived += taken(schedule)
    while packet := taken(schedule):
        arrived += packet
    return arrived


def taken(schedule: Schedule) -> list[Envelope]:
    packet = list(schedule.get())
    assert len({envelope.receiver for envelope in packet}) <= 1
    if packet:
        schedule.done(packet[0].receiver, max(envelope.clock for envelope in packet), 0)
    return packet
