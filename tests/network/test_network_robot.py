"""A robot at its transport: what it does in what order, and what it objects to."""

from __future__ import annotations

from collections.abc import Iterator
from typing import cast

import msgspec

from robochoc.communication.control import Counters, CounterWave, Pause, Ready, RobotFailed
from robochoc.communication.network.control_messages import (
    Adopt,
    Bye,
    Charge,
    CheckRequest,
    CheckResult,
    ControlMessage,
    Copies,
    DetailedReport,
    DomainAnswer,
    DomainRequest,
    Exchanged,
    Joined,
    Leave,
    Objection,
    ProtocolMessage,
    Recall,
    Register,
    RegistrationDenied,
    StartSearch,
    Welcome,
)
from robochoc.communication.network.framing import MASTER, Frame, Framing
from robochoc.communication.network.inbox import FrameArrived, Item, PresenceChanged, WakeUp
from robochoc.communication.network.robot import Ending, NetworkRobot
from robochoc.communication.network.robot_settings import RobotSettings
from robochoc.communication.network.transport import Transport
from robochoc.protocols.satisfaction.abt import ABT
from robochoc.solver.compiled_team import CompiledRobot
from tests.support.cases import looped
from tests.support.in_memory_network import RUN, ScriptedTransport
from tests.support.lone_robot import (
    LEAVE,
    UNPROVEN,
    From,
    answering,
    chain_of_three,
    counted,
    ok,
    played,
    searching,
    task,
)


def test_a_run_from_beginning_to_end() -> None:
    def script(transport: ScriptedTransport, word: ControlMessage) -> Iterator[ControlMessage | Item]:
        match word:
            case Joined():
                yield from (PresenceChanged("RA", there=True), WakeUp(), DomainRequest(("B", "Z")), task())
            case Ready():
                yield StartSearch(1)
                yield transport.frame(ProtocolMessage(1, 5, ok(1)), "RA")
            case Counters(_, 0, _, 1):
                yield CounterWave(7)
            case Counters(_, 7):
                yield Pause()
            case DetailedReport():
                yield CheckRequest(1, {"A": 1, "C": 1})
            case CheckResult():
                yield LEAVE
            case _:
                pass

    ending, transport = played(script)
    assert ending == Ending("over", failed=False, assignment={"B": 2})
    assert transport.heard_of(DomainAnswer) == [DomainAnswer({"B": ((1, 2),)})]
    (account,) = transport.heard_of(DetailedReport)
    assert isinstance(account, DetailedReport)
    assert (account.assigned, account.assignment) == (True, {"B": 2})
    shared = (Charge("RB", ("A", "B"), 1, 0),)
    assert transport.heard_of(CheckResult) == [CheckResult(1, allowed=True, cost=0, held=1, shared=shared, hard=1)]
    assert account.exchanged == {"RA": Exchanged(0, 1, 5), "RC": Exchanged(2, 0, 0)}
    assert isinstance(transport.heard[-1], Bye)
    assert {receiver for receiver, _ in transport.sent} == {"RC"}


def test_what_others_say_before_the_task_and_the_start_waits() -> None:
    one, other = (From("RA", ProtocolMessage(1, 0, ok(value))) for value in (1, 2))
    ending, transport = played(
        answering((Joined, [one, task(), other]), (Ready, [one, StartSearch(1)]), (counted(3), [LEAVE]))
    )
    assert ending.assignment == {"B": 2}
    assert not transport.heard_of(Objection)


def test_what_was_said_in_another_search_is_passed_over() -> None:
    before = [From("RA", word) for word in (ProtocolMessage(1, 0, ok(3)), Copies(1, b"\x90"))]
    now, late, early = (
        From("RA", ProtocolMessage(epoch, 0, content)) for epoch, content in ((2, ok(1)), (1, b"-"), (3, b"-"))
    )
    ending, transport = played(
        answering(
            (Joined, [task()]),
            (Ready(1), [Pause()]),
            (DetailedReport, [*before, task(epoch=2)]),
            (Ready(2), [StartSearch(2), now, late, early]),
            (counted(1, epoch=2), [LEAVE]),
        )
    )
    assert ending == Ending("over", failed=False, assignment={"B": 2})
    assert not transport.heard_of(RobotFailed)


def test_what_comes_with_the_end_of_a_search_changes_nothing_any_more() -> None:
    late = From("RA", ProtocolMessage(1, 0, ok(1)))
    ending, transport = played(
        answering(
            (Joined, [task()]), (Ready, [StartSearch(1)]), (counted(0), [late, Pause()]), (DetailedReport, [LEAVE])
        )
    )
    (account,) = transport.heard_of(DetailedReport)
    assert isinstance(account, DetailedReport)
    assert account.assignment == ending.assignment == {"B": 1}


@looped("word", [StartSearch(1), CounterWave(1), Pause(), CheckRequest(1, {}), Recall(1, 1), Adopt(1, 1)])
def test_orders_out_of_place_are_objected_to(word: ControlMessage) -> None:
    ending, transport = played(answering((Joined, [word]), (Objection, [LEAVE])))
    assert not ending.failed
    assert transport.heard_of(Objection) == [
        Objection(MASTER, "a frame to RB", f"{type(word).__name__} is not expected now")
    ]


@looped(
    "word",
    [StartSearch(2), CheckRequest(2, {}), CheckRequest(1, {}, 7), Recall(2, 1), Adopt(2, 0), Adopt(1, 7, "solution")],
)
def test_orders_of_another_search_are_objected_to(word: ControlMessage) -> None:
    script = answering((Joined, [task()]), (Ready, [word]), (Objection, [LEAVE]))
    assert len(played(script)[1].heard_of(Objection)) == 1


def packed(word: ControlMessage, number: int = 1) -> bytes:
    """Return a frame of this run, as a robot of our own would not write it."""
    return msgspec.msgpack.encode(Frame(RUN, number, word))


@looped(
    ("content", "why"),
    [
        (b"", "malformed"),
        (packed(ProtocolMessage(1, 2**64 - 1, ok(1))), "malformed"),
        (packed(ProtocolMessage(1, -1, ok(1))), "malformed"),
        (b"\x93\xa3run\x01", "malformed"),
        (packed(Pause()), "malformed"),
        (packed(Leave("now", failed=False)), "malformed"),
        (packed(Welcome("v", RUN, (), observed=False, private=False)), "malformed"),
        (Framing("RA", "another").write("RB", ProtocolMessage(1, 0, ok(1))), "another run"),
        (packed(ProtocolMessage(1, 0, ok(1)), 2), "frame 1 is missing"),
        (packed(ProtocolMessage(1, 0, ok(1)), 0), "replay"),
        (packed(ProtocolMessage(1, 0, b"no message")), "not a message of the protocol"),
    ],
)
def test_frames_that_are_refused_are_objected_to_and_change_nothing(content: bytes, why: str) -> None:
    ending, transport = played(searching(FrameArrived("RA", content), From("RA", ProtocolMessage(1, 0, ok(1)))))
    assert ending == Ending("over", failed=False, assignment={"B": 2})
    (objection,) = transport.heard_of(Objection)
    assert isinstance(objection, Objection)
    assert (objection.who, objection.what) == ("RA", "a frame to RB")
    assert why in objection.why


def test_replays_are_objected_to() -> None:
    frame = FrameArrived("RA", packed(ProtocolMessage(1, 0, ok(1))))
    ending, transport = played(searching(frame, frame, frame))
    assert not ending.failed
    assert len(transport.heard_of(Objection)) == 1  # of a kind, the 1st, the 10th, ...


def test_who_takes_no_part_is_not_heard() -> None:
    """Such as a robot that was lost before: the protocol knows nothing of it."""
    said = ProtocolMessage(1, 0, ok(1))
    ending, transport = played(searching(From("R9", said), From("RA", said)))
    assert ending == Ending("over", failed=False, assignment={"B": 2})
    assert transport.heard_of(Objection) == [Objection("R9", "a frame to RB", "R9 does not take part in this search")]


def test_objections_are_limited() -> None:
    ending, transport = played(answering((Joined, [*[FrameArrived("RA", b"noise")] * 150, LEAVE])))
    assert not ending.failed
    assert len(transport.heard_of(Objection)) == 3  # the 1st, the 10th and the 100th


def test_noise_before_the_welcome_is_nothing_to_tell() -> None:
    transport = ScriptedTransport("RB", lambda _word: ())
    transport.inbox.put(FrameArrived("RA", b"noise"))
    for number, word in ((1, LEAVE), (0, RegistrationDenied("another's", "no"))):
        transport.inbox.put(FrameArrived(MASTER, msgspec.msgpack.encode(Frame("", number, word))))
    transport.router = ""
    robot = NetworkRobot(
        CompiledRobot(chain_of_three()["RB"]),
        UNPROVEN,
        cast("Transport", transport),
        lambda _name: ABT,
        RobotSettings(0.01),
    )
    assert robot.run().why == "the master is gone: no link to it for 0.01 s"
    assert [type(word) for word in transport.heard] == [Register]
    assert not played(answering((Joined, [LEAVE])))[0].failed
