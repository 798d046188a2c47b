"""The simulator: deterministic from its seed, exact counts, golden journals, schedules that keep FIFO."""

from __future__ import annotations

from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from robochoc.communication.simulator.schedule import Concurrent, Cycles, RandomChannels, Schedule
from robochoc.communication.simulator.simulator import Simulation
from robochoc.generators.queens3d import queens3d
from robochoc.generators.random_csp import random_csp
from robochoc.journal.journal import Header, JournalRecorder, lines_of, metrics_of, read_journal
from robochoc.model.message import Envelope
from robochoc.model.outcome import Verdict
from robochoc.model.problem import Constraint, Relation, Semantics, Team
from robochoc.protocols.local_search.dsa import DSA
from robochoc.run import Options, Runtime, ScheduleName, Withdrawal, solve
from robochoc.solver.agent_problem import RunParameters
from tests.support import golden
from tests.support.examples import examples
from tests.support.problems import team_of, teams
from tests.support.steps import steps_of


@pytest.mark.parametrize(
    ("n", "model", "messages", "ncccs", "checks"),
    [
        (4, "planar", {"AddLink": 6, "Nogood": 77, "Ok": 573}, 77, 875),
        (4, "full", {"AddLink": 2, "Nogood": 87, "Ok": 483}, 60, 707),
        (7, "planar", {"AddLink": 74, "Nogood": 174, "Ok": 2364}, 262, 7663),
    ],
)
def test_counts_of_queens_are_exact(n: int, model: str, messages: dict[str, int], ncccs: int, checks: int) -> None:
    spent = solve(queens3d(n, model), Options(protocol="abt", runtime=Runtime.SIMULATOR)).metrics
    assert (spent.messages, spent.ncccs, spent.checks) == (messages, ncccs, checks)


@pytest.mark.parametrize("file", golden.files())
def test_journals_are_as_they_were(file: str) -> None:
    assert golden.content(file) == (golden.FOLDER / file).read_bytes()


@given(team=teams, seed=st.integers(0, 2**32), schedule=st.sampled_from(list(ScheduleName)))
@examples(50)
def test_a_seed_is_a_run(team: Team, seed: int, schedule: ScheduleName) -> None:
    delay = seed % 30 if schedule is ScheduleName.CONCURRENT else 0
    options = Options(protocol="abt", runtime=Runtime.SIMULATOR, seed=seed, schedule=schedule, delay=delay)
    once, again = (recorded(team, options) for _ in range(2))
    assert once == again


@given(team=teams, seed=st.integers(0, 2**32))
@examples(50)
def test_metrics_from_the_journal_are_the_hosts(team: Team, seed: int) -> None:
    recorder = JournalRecorder(Header(team=team.name, protocol="abt", runtime="simulator", seed=seed))
    options = Options(protocol="abt", runtime=Runtime.SIMULATOR, seed=seed, withdraw=Withdrawal.MAXIMAL)
    spent = solve(team, options, observer=recorder).metrics
    read = metrics_of(read_journal(recorder.content()).events)
    assert replace(read, wall_s=spent.wall_s) == spent


def recorded(team: Team, options: Options) -> list[bytes]:
    recorder = JournalRecorder(Header(team=team.name, protocol="abt", runtime="simulator", seed=options.seed))
    solve(team, options, observer=recorder)
    return [*lines_of(read_journal(recorder.content()))]


def test_other_seeds_are_other_runs() -> None:
    counts = {
        sum(solve(queens3d(4), Options(protocol="abt", runtime=Runtime.SIMULATOR, seed=seed)).metrics.messages.values())
        for seed in range(5)
    }
    assert len(counts) > 1


def test_delays_go_into_the_clock() -> None:
    quick, slow = (
        solve(queens3d(4), Options(protocol="abt", runtime=Runtime.SIMULATOR, delay=delay)).metrics.ncccs
        for delay in (0, 1000)
    )
    assert slow > 10 * quick


def test_a_timeout_is_an_unknown() -> None:
    outcome = solve(queens3d(8), Options(protocol="abt", runtime=Runtime.SIMULATOR, timeout=0.05))
    assert outcome.verdict is Verdict.UNKNOWN
    assert not outcome.assignment
    assert not outcome.verified


def test_a_timeout_holds_where_a_packet_takes_long() -> None:
    """The first one alone takes half an hour, and proves then that there is no solution."""
    never = Relation("R", 2, Semantics.SUPPORTS, ((-1, -1),))
    team = team_of({"X": range(20_000), "Y": range(20_000)}, [Constraint("C", never, ("X", "Y"), ("X", "Y"))])
    outcome = solve(team, Options(protocol="abt", runtime=Runtime.SIMULATOR, timeout=0.3))
    assert outcome.verdict is Verdict.UNKNOWN


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

    ten, thirty, fifty = (taken_by(cycles) for cycles in (10, 30, 50))
    assert fifty - thirty < 1.1 * (thirty - ten)


def test_one_by_one_abt_needs_more() -> None:
    team = random_csp(12, 5, 0.5, 0.4, 1, connected=True)
    found = [
        solve(team, Options(protocol="abt", runtime=Runtime.SIMULATOR, schedule=name))
        for name in list(ScheduleName)[:2]
    ]
    assert found[0].verdict is found[1].verdict
    assert found[1].metrics.ncccs > found[0].metrics.ncccs


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
