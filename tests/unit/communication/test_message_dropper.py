"""Messages that robots in processes and across machines drop (`--message-loss`), and how a search ends nevertheless."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from random import Random

import pytest

from robochoc.communication.control import Counters, RobotMessage, WentOn
from robochoc.communication.host import BadMessageError, Host
from robochoc.communication.kill_schedule import Kill
from robochoc.communication.message_dropper import MessageDropper
from robochoc.communication.robot_loop import RobotLoop
from robochoc.communication.search_state import SearchState
from robochoc.communication.session import Epoch
from robochoc.formats import read_team, write_team
from robochoc.generators.queens3d import queens3d
from robochoc.generators.random_csp import random_csp
from robochoc.model.outcome import Verdict
from robochoc.model.problem import Team
from robochoc.protocols.local_search.dsa import DSA
from robochoc.protocols.message import Envelope, Message
from robochoc.protocols.protocol import Protocol
from robochoc.protocols.satisfaction.abt import ABT
from robochoc.run import Options, Runtime, solve
from robochoc.run.choice import choose_for_private_team
from robochoc.solver.agent_problem import RunParameters
from robochoc.solver.compiled_team import ensure_compiled
from tests.support.brute_force import least_cost
from tests.support.cases import looped
from tests.support.cost_problems import random_cost_team
from tests.support.encrypted_problems import short_settings
from tests.support.examples import count


def lossy(protocol: str, runtime: Runtime, loss: float = 0.2, **settings: str) -> Options:
    return Options(protocol=protocol, runtime=runtime, message_loss=loss, settings=settings)


def quiet(names: str) -> SearchState:
    """A search of robots that have told twice that nothing is under way: three messages were sent in all."""
    state = SearchState(0, names)
    state.lossy = state.ordered = state.searching = True
    for name in names:
        state.handle(name, Counters(0, 0, 1, 1))
    wave = state.next_wave()
    assert wave is not None
    for name in names:
        state.handle(name, Counters(0, wave, 1, 1))
    return state


def test_each_sender_is_told_apart_and_told_once() -> None:
    dropper = MessageDropper(0.5, 3, "A")
    taken = [(sender, dropper.drops(sender)) for sender in "BCBCBCBCBC"]
    lost = {name: sum(was for sender, was in taken if sender == name) for name in "BC"}
    assert dropper.count == sum(lost.values()) > 0
    assert [dropper.missing_before("B"), dropper.missing_before("B"), dropper.missing_before("C")] == [
        lost["B"],
        0,
        lost["C"],
    ]


def test_the_same_seed_drops_the_same_and_each_robot_others() -> None:
    def drawn(seed: int, robot: str) -> list[bool]:
        dropper = MessageDropper(0.5, seed, robot)
        return [dropper.drops("B") for _ in range(50)]

    assert drawn(1, "A") == drawn(1, "A")
    assert drawn(1, "A") != drawn(2, "A")
    assert drawn(1, "A") != drawn(1, "C")


class Recorded(RobotLoop):
    """A robot whose messages and reports go into lists."""

    bundle_bytes = 1000

    def __init__(self) -> None:
        super().__init__(0, observed=False)
        self.said: list[RobotMessage] = []
        self.transmitted: list[Envelope] = []

    def _send_to_master(self, message: RobotMessage) -> None:
        self.said.append(message)

    def _transmit(self, envelopes: Sequence[Envelope]) -> None:
        self.transmitted += envelopes

    def _report_end(self) -> None:
        """Nobody asks."""


class Refusing(ABT):
    """Cannot use what it is sent, as happens where another robot has lost a message."""

    def receive(self, sender: str, message: Message) -> None:
        raise ValueError(sender, message)


class RefusingDSA(DSA):
    """The same, of a protocol that bears loss: there it is a mistake of the protocol."""

    def receive(self, sender: str, message: Message) -> None:
        raise ValueError(sender, message)


def sent_what_it_refuses(protocol: type[Protocol]) -> tuple[Recorded, Host, list[Envelope]]:
    """A robot that drops next to nothing, and what another one has sent it."""
    parts = Epoch(ensure_compiled(queens3d(2)), parameters=RunParameters(message_loss=1e-12)).parts(protocol)
    first, second = (Host.create(protocol, part) for part in list(parts.values())[:2])
    robot = Recorded()
    robot.confirm(second)
    robot.start(0.0)
    return robot, second, [one for one in first.start() if one.receiver == second.name]


def test_what_a_robot_cannot_use_as_others_have_lost_messages_counts_as_lost() -> None:
    robot, host, packet = sent_what_it_refuses(Refusing)
    before = len(robot.transmitted)
    assert packet
    for _ in range(2):
        robot.receive(packet)
    assert len(robot.transmitted) == before
    assert host.metrics().lost_messages == 1


def test_what_bears_loss_may_not_refuse_anything() -> None:
    robot, _, packet = sent_what_it_refuses(RefusingDSA)
    with pytest.raises(BadMessageError):
        robot.receive(packet)


def test_where_nothing_is_under_way_all_are_told_to_go_on_and_the_search_ends_when_none_does() -> None:
    state = quiet("ABC")
    assert state.start_continuation()
    assert not state.start_continuation()
    assert [state.handle(name, WentOn(0, went=False)) for name in "AB"] == ["", ""]
    assert state.next_wave(wanted=True) is None
    assert state.verdict is None
    state.handle("C", WentOn(0, went=False))
    assert state.counters.quiescent
    assert state.verdict is Verdict.SOLUTION


def test_where_one_has_gone_on_the_search_does_too() -> None:
    state = quiet("AB")
    assert state.start_continuation()
    state.handle("A", WentOn(0, went=True))
    state.handle("B", WentOn(0, went=False))
    assert state.verdict is None
    assert state.next_wave() is not None


def test_who_was_not_asked_is_not_heard_and_who_is_lost_is_not_waited_for() -> None:
    state = quiet("AB")
    assert state.handle("A", WentOn(0, went=True)) == "it answered whether it continues, without having been asked"
    assert state.start_continuation()
    state.handle("A", WentOn(0, went=False))
    state.lose("B", "gone")
    assert state.ended


def test_without_losses_quiescence_is_the_end() -> None:
    state = quiet("AB")
    state.lossy = False
    assert not state.start_continuation()
    assert state.next_wave() is None
    assert state.verdict is Verdict.SOLUTION


@looped(("runtime", "protocol"), [(Runtime.PROCESSES, "dsa"), (Runtime.PROCESSES, "mgm2"), (Runtime.NETWORK, "mgm2")])
def test_a_search_goes_on_without_what_robots_drop(runtime: Runtime, protocol: str) -> None:
    team = random_csp(4, 3, 0.7, 0, 4, max_cost=9)
    outcome = solve(team, lossy(protocol, runtime, cycles="4"))
    assert outcome.metrics.lost_messages > 0
    assert outcome.verdict is Verdict.SOLUTION
    assert outcome.verified
    assert outcome.cost is not None
    assert outcome.cost >= least_cost(team)


@looped("runtime", [Runtime.PROCESSES, Runtime.NETWORK])
def test_no_claim_of_a_protocol_that_needs_every_message_stands(runtime: Runtime) -> None:
    """`abt` would prove that two queens have no place."""
    assert solve(queens3d(2), lossy("abt", runtime, 0)).verdict is Verdict.NO_SOLUTION
    outcome = solve(queens3d(2), lossy("abt", runtime, 0.9))
    assert outcome.metrics.lost_messages > 0
    assert (outcome.verdict, outcome.witness) == (Verdict.UNKNOWN, None)
    assert outcome.reason is not None
    assert outcome.reason.endswith("messages were lost, and abt needs every one")


@count("runs", 2, 60)
def test_in_processes_no_verdict_is_wrong_where_a_tenth_is_lost(runs: int) -> None:
    names = ("dsa", "gdba", "maxsum", "async-maxsum", "sfb", "dpop", "adopt", "mgm2", "a-dsa", "lamdls", "maxsum-ad")
    for number in range(runs):
        name = names[number % len(names)]
        cycles = short_settings(name, 5)
        team = random_cost_team(Random(number), n_ary=False)
        outcome = solve(team, replace(lossy(name, Runtime.PROCESSES, 0.1, **cycles), seed=number))
        sure = not outcome.metrics.lost_messages
        assert sure or outcome.verdict is not Verdict.OPTIMAL
        if outcome.assignment:
            assert outcome.verdict is Verdict.UNKNOWN or outcome.verified
            assert outcome.cost is not None
            assert outcome.cost >= least_cost(team)


@pytest.mark.parametrize(
    "protocol",
    [
        "dsa",
        *(
            pytest.param(name, marks=pytest.mark.slow)
            for name in ("mgm", "mgm2", "gdba", "maxsum", "regret-matching", "lamdls", "dsa-sdp", "mixed-dsa")
        ),
    ],
)
def test_who_comes_back_is_caught_up_with_although_messages_are_lost(tmp_path: Path, protocol: str) -> None:
    """A robot's process is killed at once, and starts again, while a fifth of all messages is lost."""
    write_team(random_csp(4, 3, 0.7, 0, 4, max_cost=9), tmp_path / "team")
    team = read_team(tmp_path / "team")
    options = replace(lossy(protocol, Runtime.PROCESSES, cycles="6"), spares=1, kill=(Kill(team.order[0], 0.0),))
    outcome = solve(team, options)
    assert [epoch.opened_by for epoch in outcome.epochs[1:]] == [f"{team.order[0]} was lost, and came back"]
    assert outcome.metrics.lost_messages > 0
    assert outcome.withdrawn == ()
    assert outcome.verdict is Verdict.SOLUTION
    assert outcome.verified


@looped(
    ("team", "loss", "name"),
    lambda: [
        (random_csp(4, 3, 0.7, 0, max_cost=9), 0.1, "regret-matching"),
        (queens3d(2), 0.1, "gdba"),
        (queens3d(2), 0.2, "dsa"),
    ],
)
def test_of_robots_that_keep_their_constraints_the_kind_and_the_loss_decide(team: Team, loss: float, name: str) -> None:
    options = Options(runtime=Runtime.NETWORK, message_loss=loss)
    assert choose_for_private_team(team, options).options.protocol == name
