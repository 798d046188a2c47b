"""Messages lost on their way: what is counted, what robots notice, and what it means for an answer."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise
from random import Random

import pytest

from robochoc.cli.reports.outcome import outcome_report
from robochoc.communication.host import BadMessageError
from robochoc.communication.search_result import SearchResult
from robochoc.communication.simulator.channel import ChannelModel
from robochoc.communication.simulator.losses import Losses
from robochoc.communication.simulator.schedule import Concurrent
from robochoc.communication.simulator.simulator import Simulation
from robochoc.communication.simulator.timed import Timed
from robochoc.formats.result import read_result, result_json
from robochoc.generators.queens3d import queens3d
from robochoc.generators.tasks import tasks
from robochoc.journal.events import AnyEvent, Received, Sent
from robochoc.model.orders import constraint_graph
from robochoc.model.outcome import Verdict
from robochoc.model.problem import Team
from robochoc.protocols.inference.maxsum import MaxSum
from robochoc.protocols.local_search.dsa import DSA
from robochoc.protocols.local_search.lamdls import LAMDLS
from robochoc.protocols.local_search.mgm import MGM
from robochoc.protocols.local_search.mgm2 import MGM2
from robochoc.protocols.message import Envelope
from robochoc.protocols.protocol import Protocol
from robochoc.protocols.satisfaction.abt import ABT
from robochoc.replay import CannotReplayError, replay
from robochoc.run import Options, Runtime, solve
from robochoc.run.choice import choose
from robochoc.run.options import ScheduleName
from robochoc.run.recording import journal_header
from robochoc.solver.errors import UnsupportedError
from tests.support.cases import looped
from tests.support.cost_problems import random_cost_team
from tests.support.problems import random_team
from tests.support.replays import recorded


def lossy(
    protocol: str,
    loss: float = 0.1,
    seed: int = 0,
    schedule: ScheduleName = ScheduleName.CONCURRENT,
) -> Options:
    return Options(protocol=protocol, runtime=Runtime.SIMULATOR, message_loss=loss, seed=seed, schedule=schedule)


def searched(team: Team, protocol: type[Protocol], seed: int = 0) -> tuple[SearchResult, list[AnyEvent]]:
    events: list[AnyEvent] = []
    run = Simulation(team, protocol, Concurrent(seed), losses=Losses(0.1, seed), observer=events.append)
    return run.search(), events


class _Sure(Losses):
    """Loses the messages at these places, counted from 0 over all that are sent."""

    def __init__(self, *places: int) -> None:
        super().__init__(0, 0)
        self._places = set(places)
        self._number = -1

    def loses(self, envelope: Envelope) -> bool:
        self._number += 1
        self._probability = float(self._number in self._places)
        return super().loses(envelope)


def test_what_comes_next_on_a_channel_shows_how_many_are_missing_before_it() -> None:
    losses = _Sure(1, 2, 4)
    sent = [Envelope("A", receiver, b"", 0) for receiver in "BBBBCC"]
    assert [losses.loses(one) for one in sent] == [False, True, True, False, True, False]
    assert [losses.missing_before(sent[place]) for place in (0, 3, 5)] == [0, 2, 1]
    assert (losses.reset(), losses.reset()) == (3, 0)


@looped("protocol", [DSA, MGM, MaxSum])
def test_each_message_has_arrived_or_is_counted_as_lost(protocol: type[Protocol]) -> None:
    result, events = searched(queens3d(4), protocol)
    sent, received = (sum(isinstance(event, kind) for event in events) for kind in (Sent, Received))
    assert result.metrics.lost_messages > 0
    assert sum(result.metrics.messages.values()) == sent == received + result.metrics.lost_messages


def test_the_same_seed_loses_the_same_messages() -> None:
    for schedule in ScheduleName:
        options = replace(lossy("mgm", schedule=schedule), settings={"cycles": "20"})
        once, again, other = (solve(queens3d(3), replace(options, seed=seed)) for seed in (1, 1, 2))
        assert replace(once.metrics, wall_s=0) == replace(again.metrics, wall_s=0)
        assert once.assignment == again.assignment
        assert once.metrics.lost_messages != other.metrics.lost_messages


@looped("protocol", [DSA, MGM2, LAMDLS])
def test_all_cycles_are_gone_through_whatever_is_lost(protocol: type[Protocol]) -> None:
    for seed in range(4):
        team = random_cost_team(Random(seed))
        result, _ = searched(team, protocol, seed)
        trails = [found.trail for found in result.findings.values() if found.trail]
        assert {trail.cycle for trail in trails} <= {100}


def test_two_neighbours_of_mgm_never_move_in_the_same_cycle_whatever_is_lost() -> None:
    moved = 0
    for seed in range(12):
        team = random_cost_team(Random(seed))
        result, _ = searched(team, MGM, seed)
        assert result.verdict is Verdict.NO_SOLUTION or result.findings
        moves = {
            name: {cycle for cycle, _ in found.trail.entries if cycle} if found.trail else set()
            for name, found in result.findings.items()
        }
        for name, others in constraint_graph(team).items():
            moved += len(moves[name])
            assert all(moves[name].isdisjoint(moves[other]) for other in others)
    assert moved > 20


def test_a_robot_uses_the_last_value_that_it_knows_and_keeps_in_step() -> None:
    """The second value of one robot is lost: the other one goes on with the first, and then with the third."""
    team = random_cost_team(Random(1), n_ary=False)
    result = Simulation(team, DSA, Concurrent(0), losses=_Sure(*range(10, 20))).search()
    assert result.metrics.lost_messages == 10
    assert {found.trail.cycle for found in result.findings.values() if found.trail} == {100}


def test_a_lost_message_takes_its_time_on_the_air_and_silence_its_timeout() -> None:
    channel = ChannelModel(name="slow", latency_ms=1, frame_us=500_000, timeout_ms=7_000)
    schedule = Timed(0, channel)
    schedule.lose(Envelope("A", "B", b"", 0))
    schedule.put(Envelope("A", "C", b"", 0))
    schedule.done("A", 0, 0)
    assert [one.receiver for one in schedule.get()] == ["C"]
    assert schedule.time(0) == pytest.approx(1.001)
    schedule.done("C", 0, 0)
    assert list(schedule.get()) == []
    schedule.wait()
    assert schedule.time(0) == pytest.approx(8.001)


def test_a_channel_model_can_lose_whole_messages_and_the_option_counts_before_it() -> None:
    channel = ChannelModel(name="field", latency_ms=1, timeout_ms=10, message_loss=0.2)
    options = Options(protocol="dsa", runtime=Runtime.SIMULATOR, channel=channel, seed=2)
    outcome = solve(queens3d(3), options)
    assert outcome.metrics.lost_messages > 0
    assert outcome.metrics.lost_messages == solve(queens3d(3), replace(options, message_loss=0.2)).metrics.lost_messages
    assert solve(queens3d(3), replace(options, message_loss=0.5)).metrics.lost_messages > outcome.metrics.lost_messages
    assert journal_header(queens3d(3), options).message_loss == 0.2
    assert choose(queens3d(3), replace(options, protocol="auto")).options.protocol == "dsa"
    with pytest.raises(UnsupportedError, match="--message-loss"):
        solve(queens3d(3), replace(options, settings={"anytime": "yes"}))


def test_no_claim_stands_that_may_rest_on_a_lost_message() -> None:
    """Without losses `abt` proves that two queens have no place, and `dpop` what costs least."""
    assert solve(queens3d(2), lossy("abt", 0)).verdict is Verdict.NO_SOLUTION
    spoiled = [solve(queens3d(2), lossy("abt", 0.5, seed=seed)) for seed in range(10)]
    assert {outcome.verdict for outcome in spoiled if outcome.metrics.lost_messages} == {Verdict.UNKNOWN}
    found = next(one for one in spoiled if one.metrics.lost_messages > 1)
    assert found.reason == f"{found.metrics.lost_messages:,} messages were lost, and abt needs every one"
    assert found.witness is None
    verdicts = set()
    for seed in range(20):
        outcome = solve(random_cost_team(Random(seed)), lossy("dpop", 0.2, seed=seed))
        if outcome.metrics.lost_messages:
            verdicts.add(outcome.verdict)
            assert (outcome.bound, outcome.count, outcome.tree) == (None, None, {})
    assert verdicts <= {Verdict.UNKNOWN, Verdict.SOLUTION}


def test_a_protocol_that_does_not_bear_loss_may_raise_anything_after_one() -> None:
    class Broken(ABT):
        def settle(self) -> None:
            raise KeyError(self.problem.agent)

    with pytest.raises(BadMessageError, match="KeyError: 'Robot"):
        Simulation(queens3d(3), Broken, Concurrent(0), losses=_Sure()).search()
    assert Simulation(queens3d(3), Broken, Concurrent(0), losses=_Sure(0)).search().verdict is Verdict.UNKNOWN


def test_an_auction_that_could_not_end_says_so_also_where_nobody_does_anything() -> None:
    """Nothing forbids that all robots stay idle, so that is a solution; but not what the auction ends with."""
    team = tasks(4, 4)
    whole = solve(team, lossy("ssi", 0))
    assert (whole.reason, whole.verdict) == (None, Verdict.SOLUTION)
    spoiled = [solve(team, lossy("ssi", 0.3, seed)) for seed in range(20)]
    assert any(not any(one.assignment.values()) for one in spoiled)
    for one in spoiled:
        many = one.metrics.lost_messages
        lost = f"{many:,} message{'s were' if many > 1 else ' was'} lost, and ssi needs every one: this is the best"
        assert (one.verdict, bool(one.reason)) == (Verdict.SOLUTION, many > 0)
        assert not many or f"checked against every constraint; {lost}" in outcome_report(team, one)
        assert read_result(result_json(one)).reason == one.reason


def test_a_solution_without_costs_is_one_whatever_was_lost() -> None:
    spoiled = [solve(random_team(Random(seed), n_ary=False), lossy("abt", 0.05, seed)) for seed in range(40)]
    solved = [one for one in spoiled if one.verdict is Verdict.SOLUTION and one.metrics.lost_messages]
    assert {(one.reason, one.verified) for one in solved} == {(None, True)}


def test_what_bears_loss_may_not_raise() -> None:
    class Broken(DSA):
        def settle(self) -> None:
            if self.cycle >= 0 and self._waiting:
                raise KeyError(self.problem.agent)

    with pytest.raises(KeyError):
        Simulation(queens3d(3), Broken, Concurrent(0), losses=_Sure(0)).search()


def test_the_result_says_how_many_messages_were_lost() -> None:
    outcome = solve(queens3d(3), lossy("dsa"))
    read = read_result(result_json(outcome))
    assert read.metrics.lost_messages == outcome.metrics.lost_messages > 0
    assert (outcome.metrics + outcome.metrics).lost_messages == 2 * outcome.metrics.lost_messages


def test_a_journal_of_lost_messages_is_not_replayed() -> None:
    team, options = queens3d(3), lossy("dsa")
    header = journal_header(team, options)
    assert header.message_loss == options.message_loss
    journal = replace(recorded(team, options), header=header)
    with pytest.raises(CannotReplayError, match="messages were lost"):
        replay(journal)


@looped(
    "options",
    [
        replace(lossy("dsa"), runtime=Runtime.ARRAYS),
        replace(lossy("dsa"), settings={"anytime": "yes"}),
        lossy("dsa", loss=0.95),
        lossy("central"),
    ],
)
def test_where_it_makes_no_sense_it_is_refused(options: Options) -> None:
    with pytest.raises(UnsupportedError, match="--message-loss"):
        solve(queens3d(2), options)


def test_more_loss_costs_no_more_than_quality() -> None:
    """DSA on queens finds a solution with half of all messages lost, in as many cycles."""
    costs = [sum(solve(queens3d(4), lossy("dsa", loss)).metrics.messages.values()) for loss in (0.1, 0.3, 0.5)]
    assert all(before >= after for before, after in pairwise(costs))
