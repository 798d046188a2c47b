"""How a run ends for a robot: what it cannot go on with, and what ends it."""

from __future__ import annotations

from collections.abc import Iterator
from typing import cast

import msgspec
import pytest

from robochoc.communication.control import Failed, Pause, Ready
from robochoc.communication.network.control_messages import (
    Account,
    Bye,
    Checked,
    Copies,
    Denied,
    Gap,
    Joined,
    Judge,
    Leave,
    Objection,
    ProtocolMessage,
    Register,
    Search,
    Welcome,
    Word,
)
from robochoc.communication.network.framing import MASTER, Framing, Letter
from robochoc.communication.network.inbox import Arrived, Item, Missed
from robochoc.communication.network.quotas import Kept, Share
from robochoc.communication.network.robot import Ending, NetworkRobot
from robochoc.communication.network.shared import PredicateRecord, SharedRecord
from robochoc.communication.network.transport import Transport
from robochoc.model.problem import INFINITE, ConstraintModel
from robochoc.protocols.abt import ABT
from robochoc.protocols.awc import AWC
from robochoc.protocols.protocol import Protocol
from robochoc.solver.compiled_team import CompiledRobot
from tests.support.in_memory_network import RUN, ScriptedTransport
from tests.support.lone_robot import LEAVE, UNPROVEN, chain_of_three, ok, played, task


def failing(*said: Word | Item, protocol: type[Protocol] = ABT, at: type[Word] = Joined) -> tuple[Ending, Failed]:
    """How RB fails when `said` is answered to its first word of the kind `at`: what it says itself, and tells."""

    def script(_post: ScriptedTransport, word: Word) -> Iterator[Word | Item]:
        if isinstance(word, at):
            yield from said
        elif isinstance(word, Failed):
            yield Arrived("RA", b"noise")
            yield Leave("that was it", failed=True)

    ending, post = played(script, protocol)
    (failed,) = post.heard_of(Failed)
    assert isinstance(failed, Failed)
    assert ending == Ending(failed.why, failed=True, assignment={})
    assert isinstance(post.heard[-1], Bye)
    return ending, failed


def test_an_unknown_protocol_is_told() -> None:
    _, failed = failing(msgspec.structs.replace(task(), protocol="Nonsense"))
    assert (failed.why, failed.unsupported) == ("RB: no protocol 'Nonsense'", True)


def test_lost_letters_are_told() -> None:
    _, failed = failing(Missed(MASTER, 3))
    assert (failed.why, failed.unsupported) == ("3 letters of the master to RB were lost for good", True)


def test_who_says_too_much_ahead_of_the_task_takes_nobodys_place(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("robochoc.communication.network.robot.Kept", lambda: Kept(Share(2, 1000)))

    def script(post: ScriptedTransport, word: Word) -> Iterator[Word | Item]:
        if isinstance(word, Joined):
            yield from (post.letter(ProtocolMessage(1, 0, ok(1)), name) for name in ("RA", "RA", "RA", "RA", "RC"))
            yield task()
        elif isinstance(word, Ready):
            yield Leave("that was it", failed=False)

    _, post = played(script)
    first, second = post.heard_of(Objection)
    assert first == Objection("RA", "a letter to RB", "it is more than is kept of RA for epoch 1")
    assert second == Objection("RA", "a letter to RB", "letter 3 is missing before letter 4")


def test_a_gap_is_told_once_a_search_of_each() -> None:
    """A neighbour that makes it look as if letters were missing, again and again, is not to flood the master by RB."""
    before: list[Item] = [Missed("RA", 5), Missed("RA", 9)]
    then: list[Item] = [Missed("RA", 2), Missed("RC", 1), Missed("RA", 7)]

    def script(_post: ScriptedTransport, word: Word) -> Iterator[Word | Item]:
        if isinstance(word, Joined):
            yield from before
            yield task()
            yield from then
        elif isinstance(word, Ready):
            yield Leave("that was it", failed=False)

    _, post = played(script)
    assert post.heard_of(Gap) == [Gap("RA", 5), Gap("RA", 2), Gap("RC", 1)]


def copy(scope: tuple[str, ...] = ("B", "C"), body: str = "ne(X, Y)") -> SharedRecord:
    return SharedRecord(
        "RC<RB:C", "C", PredicateRecord("p", ("X", "Y"), body), scope, scope, ConstraintModel.TKC, INFINITE
    )


def copies(sender: str, *records: SharedRecord, number: int = 1) -> Arrived:
    return Arrived(sender, msgspec.msgpack.encode(Letter(RUN, number, Copies(1, msgspec.msgpack.encode(records)))))


@pytest.mark.parametrize(
    ("told", "why"),
    [
        ([copies("RC", copy(body="ne(X,"))], "the predicate 'p'"),
        ([copies("RC", copy(body="(" * 9000))], "the predicate 'p'"),
        ([copies("RC", copy(scope=("B", "B", "C")))], "3 arguments where 2"),
        ([copies("RC", copy(scope=("B", "Z")))], "RC holds 'C' over what it cannot"),
        ([copies("RC", copy(scope=("A", "C")))], "RC holds 'C' over what it cannot"),
        ([copies("RC", copy(scope=("A", "B")))], "RC holds 'C' over what it cannot"),
        ([copies("RA", copy(scope=("A", "B"))), copies("RC", copy())], "RA holds 'C' over what it cannot"),
    ],
)
def test_copies_that_cannot_be_are_told(told: list[Arrived], why: str) -> None:
    _, failed = failing(task(AWC), *told, protocol=AWC)
    assert failed.why.startswith("RB was told what cannot be: ")
    assert why in failed.why
    assert failed.unsupported


def test_copies_before_the_task_are_kept_and_later_ones_change_nothing() -> None:
    def script(_post: ScriptedTransport, word: Word) -> Iterator[Word | Item]:
        match word:
            case Joined():
                yield copies("RC", copy())
                yield task(AWC)
            case Ready():
                yield copies("RC", copy(body="eq(X, Y)"), number=2)
                yield LEAVE
            case _:
                pass

    ending, post = played(script, AWC)
    assert not ending.failed
    assert len(post.heard_of(Ready)) == 1
    ((receiver, content),) = post.sent
    assert receiver == "RA"
    assert isinstance(Framing("RA", RUN).read("RB", content).word, Copies)


def test_without_copies_a_robot_is_not_ready_but_reports() -> None:
    def script(_post: ScriptedTransport, word: Word) -> Iterator[Word | Item]:
        match word:
            case Joined():
                yield task(AWC)
                yield Search(1)
                yield Pause()
                yield Judge(1, {})
            case Checked():
                yield LEAVE
            case _:
                pass

    ending, post = played(script, AWC)
    assert ending == Ending("over", failed=False, assignment={})
    assert not post.heard_of(Ready)
    (account,) = post.heard_of(Account)
    assert isinstance(account, Account)
    assert (account.assigned, account.assignment, account.metrics.messages) == (False, {}, {})


# The end


def test_who_is_denied_ends() -> None:
    def answers(word: Word) -> Iterator[Item]:
        assert isinstance(word, Register)
        yield post.letter(Denied("another's visit", "not meant"))
        yield post.letter(Denied(word.visit, "a robot called RB is registered already"))

    post = ScriptedTransport("RB", answers)
    ending = NetworkRobot(
        CompiledRobot(chain_of_three()["RB"]), UNPROVEN, cast("Transport", post), lambda _name: ABT
    ).run()
    assert ending == Ending(
        "the master does not take RB: a robot called RB is registered already", failed=True, assignment={}
    )


def test_another_master_ends_the_run_the_same_one_does_not() -> None:
    def script(post: ScriptedTransport, word: Word) -> Iterator[Word | Item]:
        if isinstance(word, Joined):
            (register,) = post.heard_of(Register)
            assert isinstance(register, Register)
            for visit, run in (("another's", "new"), (register.visit, RUN), (register.visit, "new")):
                yield Welcome(visit, run, (), observed=False, private=False)

    ending, post = played(script)
    assert ending == Ending("the master was started anew; start this robot anew as well", failed=True, assignment={})
    assert len(post.heard_of(Joined)) == 2, "one for each welcome of the same run"


def test_behind_another_router_a_robot_registers_until_it_is_welcomed(monkeypatch: pytest.MonkeyPatch) -> None:
    """Whatever it says at first may get lost there, and so may the answer."""
    monkeypatch.setattr("robochoc.communication.network.registration.REGISTER_AGAIN_S", 0.01)

    def script(post: ScriptedTransport, word: Word) -> Iterator[Word | Item]:
        match word, len(post.heard_of(Register)):
            case Register(visit=visit), 4:
                yield Welcome(visit, RUN, (), observed=False, private=False)
            case Joined(), 1:
                post.router = "opened anew"
            case Joined(), 4:
                yield LEAVE
            case _:
                pass

    ending, post = played(script)
    assert ending == Ending("over", failed=False, assignment={})
    assert [type(word) for word in post.heard] == [Register, Joined, Register, Register, Register, Joined, Bye]


def test_a_master_that_is_gone_ends_the_run() -> None:
    def script(post: ScriptedTransport, word: Word) -> Iterator[Word | Item]:
        if isinstance(word, Joined):
            post.router = ""
        yield from ()

    ending, _ = played(script, patience_s=0.1)
    assert ending == Ending("the master is gone: no link to it for 0.1 s", failed=True, assignment={})


def test_who_fails_does_not_wait_for_a_master_that_is_gone() -> None:
    def script(post: ScriptedTransport, word: Word) -> Iterator[Word | Item]:
        if isinstance(word, Joined):
            yield Missed(MASTER, 1)
        elif isinstance(word, Failed):
            post.router = ""

    assert played(script)[0].failed
