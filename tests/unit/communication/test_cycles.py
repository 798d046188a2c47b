"""The schedule in which all robots go in step, and limits on cycles and NCCCs."""

from __future__ import annotations

from dataclasses import replace
from random import Random

from hypothesis import given
from hypothesis import strategies as st

from robochoc.communication.simulator.schedule import Cycles
from robochoc.generators.queens3d import queens3d
from robochoc.journal.events import AnyEvent, Decided, Improved, Received, Sent
from robochoc.journal.recorder import improvements
from robochoc.model.outcome import Outcome, Verdict
from robochoc.model.problem import INFINITE
from robochoc.protocols.message import Envelope
from robochoc.run import Options, Runtime, ScheduleName, solve
from robochoc.run.recording import objective_to_record
from tests.support import golden
from tests.support.cases import looped
from tests.support.cost_problems import random_cost_team
from tests.support.examples import examples

IN_STEP = Options(protocol="abt", runtime=Runtime.SIMULATOR, schedule=ScheduleName.CYCLES)


@given(
    rounds=st.lists(st.lists(st.tuples(st.sampled_from("ABC"), st.sampled_from("DEF")), max_size=8), max_size=6),
    seed=st.integers(0, 1000),
)
@examples(50)
def test_a_cycle_brings_what_was_sent_in_the_one_before(rounds: list[list[tuple[str, str]]], seed: int) -> None:
    """Each receiver has one packet in it, with all that was sent to it, and answers wait for the next cycle."""
    schedule = Cycles(seed)
    for cycle, sends in enumerate(filter(None, rounds), 1):
        for number, (sender, receiver) in enumerate(sends):
            schedule.put(Envelope(sender, receiver, str(number).encode(), 0))
        assert (schedule.cycles, schedule.next_cycle) == (cycle - 1, cycle)
        receivers = {receiver for _, receiver in sends}
        packets = [schedule.get() for _ in receivers]
        assert schedule.cycles == cycle
        assert schedule.next_cycle == 0
        assert {packet[0].receiver for packet in packets} == receivers
        for packet in packets:
            sent = [number for number, (_, receiver) in enumerate(sends) if receiver == packet[0].receiver]
            assert [int(envelope.content) for envelope in packet] == sent
    assert schedule.get() == ()


def test_what_is_said_in_a_cycle_arrives_in_the_next() -> None:
    events: list[AnyEvent] = []
    outcome = solve(queens3d(4), IN_STEP, observer=events.append)
    sent: dict[tuple[str, str], list[float]] = {}
    taken: dict[tuple[str, str], list[float]] = {}
    for event in events:
        if isinstance(event, (Sent, Received)):
            channels = sent if isinstance(event, Sent) else taken
            channels.setdefault((event.sender, event.receiver), []).append(event.t)
    for channel, times in taken.items():
        assert times == [said + 1 for said in sent[channel][: len(times)]]
    assert outcome.metrics.cycles == max(time for times in taken.values() for time in times)


def test_a_local_search_takes_a_cycle_for_each_round_of_messages() -> None:
    team = random_cost_team(Random("in step"), n_ary=False)
    for protocol, messages in (("dsa", 1), ("mgm", 2)):
        options = replace(IN_STEP, protocol=protocol, settings={"cycles": "7"})
        assert solve(team, options).metrics.cycles == 7 * messages, protocol


@looped("limit", [1, 2, 5])
def test_a_limit_on_cycles_is_exact(limit: int) -> None:
    found = solve(queens3d(4), replace(IN_STEP, cycles=limit))
    assert (found.verdict, found.metrics.cycles) == (Verdict.UNKNOWN, limit)
    assert found.reason == f"the limit of cycles was reached (--cycles {limit})"


def test_a_limit_that_suffices_changes_nothing() -> None:
    free = solve(queens3d(4), IN_STEP)
    enough = solve(queens3d(4), replace(IN_STEP, cycles=free.metrics.cycles, ncccs=free.metrics.ncccs + 1))
    assert _plain(enough) == _plain(free)
    assert free.verdict is Verdict.NO_SOLUTION


def _plain(outcome: Outcome) -> Outcome:
    return replace(outcome, metrics=replace(outcome.metrics, wall_s=0, compile_s=0))


@looped("schedule", [*ScheduleName])
def test_a_limit_on_ncccs_ends_the_step_in_which_it_is_reached(schedule: ScheduleName) -> None:
    events: list[AnyEvent] = []
    found = solve(queens3d(4), replace(IN_STEP, schedule=schedule, ncccs=20), observer=events.append)
    assert found.verdict is Verdict.UNKNOWN
    assert found.reason == "the limit of non-concurrent constraint checks was reached (--ncccs 20)"
    assert 20 <= found.metrics.ncccs < solve(queens3d(4), replace(IN_STEP, schedule=schedule)).metrics.ncccs


def test_limits_are_on_all_epochs_together() -> None:
    """What earlier problems have taken is not left for later ones."""
    team = golden.fixed_teams("dynabt")["rescue"]
    options = replace(IN_STEP, protocol="dynabt")
    free = solve(team, options)
    assert sum(bool(epoch.metrics.cycles) for epoch in free.epochs) > 1
    limit = free.metrics.cycles - 1
    cut = solve(team, replace(options, cycles=limit))
    assert cut.verdict is Verdict.UNKNOWN
    assert cut.metrics.cycles == limit
    assert cut.reason == f"the limit of cycles was reached (--cycles {limit})"


@looped("seed", range(20))
def test_in_step_only_whole_cycles_have_a_cost(seed: int) -> None:
    """What the team has when some have decided in a cycle, and others not yet, is no assignment that it ever had."""
    chance = Random(f"whole cycles {seed}")
    team = random_cost_team(chance, n_ary=False)
    options = replace(IN_STEP, protocol="dsa", seed=seed, settings={"cycles": "12", "probability": "0.9"})
    events: list[AnyEvent] = []
    solve(team, options, observer=events.append)
    decided = [event for event in events if isinstance(event, Decided)]
    make = objective_to_record(team, options)
    assert make is not None
    told = [event for event in improvements(decided, make()) if isinstance(event, Improved)]
    weighed = make()
    expected, best = [], INFINITE
    for cycle in sorted({event.t for event in decided}):
        weighed.change({event.robot: event.assignment for event in decided if event.t == cycle})
        if weighed.cost < best:
            best = weighed.cost
            expected.append((cycle, weighed.in_user_units(best)))
    assert [(event.t, event.cost) for event in told] == expected
