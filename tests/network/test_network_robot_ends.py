"""How a run ends for a robot: what it cannot go on with, and what ends it."""

from __future__ import annotations

from collections.abc import Iterator
from typing import cast

import msgspec
import pytest

from robochoc.communication.control import Pause, Ready, RobotFailed
from robochoc.communication.network.constraint_records import PredicateRecord, SharedRecord
from robochoc.communication.network.control_messages import (
    Bye,
    CheckRequest,
    CheckResult,
    ControlMessage,
    Copies,
    DetailedReport,
    Joined,
    Leave,
    LostFrames,
    Objection,
    ProtocolMessage,
    Register,
    RegistrationDenied,
    StartSearch,
    Welcome,
)
from robochoc.communication.network.framing import MASTER, Frame, Framing
from robochoc.communication.network.inbox import FrameArrived, FramesLost, Item
from robochoc.communication.network.quotas import Backlog, Share
from robochoc.communication.network.robot import Ending, NetworkRobot
from robochoc.communication.network.transport import Transport
from robochoc.model.problem import INFINITE, ConstraintModel
from robochoc.protocols.protocol import Protocol
from robochoc.protocols.satisfaction.abt import ABT
from robochoc.protocols.satisfaction.awc import AWC
from robochoc.solver.compiled_team import CompiledRobot
from tests.support.cases import looped
from tests.support.in_memory_network import RUN, ScriptedTransport
from tests.support.lone_robot import LEAVE, UNPROVEN, Answers, From, answering, chain_of_three, ok, played, task


def failing(*said: ControlMessage | Item, protocol: type[Protocol] = ABT) -> RobotFailed:
    """Return the failure that RB reports, and ends with, when it receives these once it has joined."""
    end: Answers = [FrameArrived("RA", b"noise"), Leave("that was it", failed=True)]
    ending, transport = played(answering((Joined, said), (RobotFailed, end)), protocol)
    (failed,) = transport.heard_of(RobotFailed)
    assert isinstance(failed, RobotFailed)
    assert ending == Ending(failed.why, failed=True, assignment={})
    assert isinstance(transport.heard[-1], Bye)
    return failed


def test_an_unknown_protocol_is_told() -> None:
    failed = failing(msgspec.structs.replace(task(), protocol="Nonsense"))
    assert (failed.why, failed.unsupported) == ("RB: no protocol 'Nonsense'", True)


def test_lost_frames_are_told() -> None:
    failed = failing(FramesLost(MASTER, 3))
    assert (failed.why, failed.unsupported) == ("3 frames from the master to RB were lost", True)


def test_who_says_too_much_ahead_of_the_task_takes_nobodys_place(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("robochoc.communication.network.robot.Backlog", lambda: Backlog(Share(2, 1000)))

    said = [From(name, ProtocolMessage(1, 0, ok(1))) for name in ("RA", "RA", "RA", "RA", "RC")]
    _, transport = played(answering((Joined, [*said, task()]), (Ready, [LEAVE])))
    first, second = transport.heard_of(Objection)
    assert first == Objection("RA", "a frame to RB", "too many frames of RA are stored for epoch 1")
    assert second == Objection("RA", "a frame to RB", "frame 3 is missing before frame 4")


def test_a_gap_is_told_once_a_search_of_each() -> None:
    """A neighbour that makes it look as if frames were missing, again and again, is not to flood the master by RB."""
    before: list[Item] = [FramesLost("RA", 5), FramesLost("RA", 9)]
    then: list[Item] = [FramesLost("RA", 2), FramesLost("RC", 1), FramesLost("RA", 7)]
    _, transport = played(answering((Joined, [*before, task(), *then]), (Ready, [LEAVE])))
    assert transport.heard_of(LostFrames) == [LostFrames("RA", 5), LostFrames("RA", 2), LostFrames("RC", 1)]


def copy(scope: tuple[str, ...] = ("B", "C"), body: str = "ne(X, Y)", cost: float = INFINITE) -> SharedRecord:
    return SharedRecord("RC<RB:C", "C", PredicateRecord("p", ("X", "Y"), body), scope, scope, ConstraintModel.TKC, cost)


def copies(sender: str, *records: SharedRecord, number: int = 1) -> FrameArrived:
    return FrameArrived(sender, msgspec.msgpack.encode(Frame(RUN, number, Copies(1, msgspec.msgpack.encode(records)))))


@looped(
    ("told", "why"),
    [
        ([copies("RC", copy(body="ne(X,"))], "the definition 'p'"),
        ([copies("RC", copy(body="(" * 9000))], "the definition 'p'"),
        ([copies("RC", copy(scope=("B", "B", "C")))], "3 arguments, but requires 2"),
        ([copies("RC", copy(cost=-1.0))], "the cost -1.0 of 'C' must be 0 or more"),
        ([copies("RC", copy(cost=float("nan")))], "the cost nan of 'C' must be 0 or more"),
        ([copies("RC", copy(scope=("B", "Z")))], "RC has sent 'C', whose scope is not allowed"),
        ([copies("RC", copy(scope=("A", "C")))], "RC has sent 'C', whose scope is not allowed"),
        ([copies("RC", copy(scope=("A", "B")))], "RC has sent 'C', whose scope is not allowed"),
        ([copies("RA", copy(scope=("A", "B"))), copies("RC", copy())], "RA has sent 'C', whose scope is not allowed"),
    ],
)
def test_copies_that_cannot_be_are_told(told: list[FrameArrived], why: str) -> None:
    failed = failing(task(AWC), *told, protocol=AWC)
    assert failed.why.startswith("RB received invalid data: ")
    assert why in failed.why
    assert failed.unsupported


def test_copies_before_the_task_are_kept_and_later_ones_change_nothing() -> None:
    later = copies("RC", copy(body="eq(X, Y)"), number=2)
    ending, transport = played(answering((Joined, [copies("RC", copy()), task(AWC)]), (Ready, [later, LEAVE])), AWC)
    assert not ending.failed
    assert len(transport.heard_of(Ready)) == 1
    ((receiver, content),) = transport.sent
    assert receiver == "RA"
    assert isinstance(Framing("RA", RUN).read("RB", content).message, Copies)


def test_without_copies_a_robot_is_not_ready_but_reports() -> None:
    orders: Answers = [task(AWC), StartSearch(1), Pause(), CheckRequest(1, {})]
    ending, transport = played(answering((Joined, orders), (CheckResult, [LEAVE])), AWC)
    assert ending == Ending("over", failed=False, assignment={})
    assert not transport.heard_of(Ready)
    (account,) = transport.heard_of(DetailedReport)
    assert isinstance(account, DetailedReport)
    assert (account.assigned, account.assignment, account.metrics.messages) == (False, {}, {})


# The end


def test_who_is_denied_ends() -> None:
    def answers(word: ControlMessage) -> Iterator[Item]:
        assert isinstance(word, Register)
        yield transport.frame(RegistrationDenied("another's incarnation", "not meant"))
        yield transport.frame(RegistrationDenied(word.incarnation, "a robot called RB is registered already"))

    transport = ScriptedTransport("RB", answers)
    ending = NetworkRobot(
        CompiledRobot(chain_of_three()["RB"]), UNPROVEN, cast("Transport", transport), lambda _name: ABT
    ).run()
    assert ending == Ending(
        "the master does not admit RB: a robot called RB is registered already", failed=True, assignment={}
    )


def test_another_master_ends_the_run_the_same_one_does_not() -> None:
    def script(transport: ScriptedTransport, word: ControlMessage) -> Iterator[ControlMessage | Item]:
        if isinstance(word, Joined):
            (register,) = transport.heard_of(Register)
            assert isinstance(register, Register)
            for incarnation, run in (("another's", "new"), (register.incarnation, RUN), (register.incarnation, "new")):
                yield Welcome(incarnation, run, (), observed=False, private=False)

    ending, transport = played(script)
    assert ending == Ending("the master was restarted: restart this robot as well", failed=True, assignment={})
    assert len(transport.heard_of(Joined)) == 2, "one for each welcome of the same run"


def test_behind_another_router_a_robot_registers_until_it_is_welcomed(monkeypatch: pytest.MonkeyPatch) -> None:
    """Whatever it says at first may get lost there, and so may the answer."""
    monkeypatch.setattr("robochoc.communication.network.robot.REGISTER_AGAIN_S", 0.01)

    def script(transport: ScriptedTransport, word: ControlMessage) -> Iterator[ControlMessage | Item]:
        match word, len(transport.heard_of(Register)):
            case Register(incarnation=incarnation), 4:
                yield Welcome(incarnation, RUN, (), observed=False, private=False)
            case Joined(), 1:
                transport.router = "opened anew"
            case Joined(), 4:
                yield LEAVE
            case _:
                pass

    ending, transport = played(script)
    assert ending == Ending("over", failed=False, assignment={})
    assert [type(word) for word in transport.heard] == [Register, Joined, Register, Register, Register, Joined, Bye]


def test_a_master_that_is_gone_ends_the_run() -> None:
    def script(transport: ScriptedTransport, word: ControlMessage) -> Iterator[ControlMessage | Item]:
        if isinstance(word, Joined):
            transport.router = ""
        yield from ()

    ending, _ = played(script, patience_s=0.1)
    assert ending == Ending("the master is gone: no link to it for 0.1 s", failed=True, assignment={})


def test_who_fails_does_not_wait_for_a_master_that_is_gone() -> None:
    def script(transport: ScriptedTransport, word: ControlMessage) -> Iterator[ControlMessage | Item]:
        if isinstance(word, Joined):
            yield FramesLost(MASTER, 1)
        elif isinstance(word, RobotFailed):
            transport.router = ""

    assert played(script)[0].failed
