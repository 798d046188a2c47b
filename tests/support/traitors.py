"""One traitor among honest robots: the words that it says to the master in the place of its own.

`install` makes a robot of this process one; `main` is a robot's program on a machine of its own that is one.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace

import msgspec

from robochoc.communication.control import Conclusion, Counters, Ready
from robochoc.communication.network.control_messages import (
    Bye,
    CheckResult,
    DetailedReport,
    Exchanged,
    SearchTask,
    ToMaster,
)
from robochoc.communication.network.searcher import RobotContext, Searcher
from robochoc.model.outcome import Metrics
from robochoc.protocols.findings import Findings
from robochoc.protocols.protocol import Protocol
from robochoc.solver.compiled_team import CompiledRobot

Lie = Callable[[Searcher, ToMaster], Iterator[ToMaster]]
changed = msgspec.structs.replace


def concluding(verdict: str, *, at: type = Counters) -> Lie:
    """It concludes something of its own once it says a word of a kind."""

    def lie(me: Searcher, word: ToMaster) -> Iterator[ToMaster]:
        if isinstance(word, at):
            yield Conclusion(me.epoch, verdict)
        yield word

    return lie


def leaving(at: type = Counters) -> Lie:
    """It takes its leave once it says a word of a kind, and goes on."""

    def lie(_me: Searcher, word: ToMaster) -> Iterator[ToMaster]:
        if isinstance(word, at):
            yield Bye()
        yield word

    return lie


def counting(sent: Callable[[int], int], received: Callable[[int], int] = lambda count: count) -> Lie:
    """Its counters are what these make of the true ones, or of how often they were told."""

    def lie(_me: Searcher, word: ToMaster) -> Iterator[ToMaster]:
        if isinstance(word, Counters):
            word = changed(word, sent=sent(word.sent), received=received(word.received))
        yield word

    return lie


def reporting(change: Callable[[DetailedReport], DetailedReport]) -> Lie:
    """What it reports at the end is another."""

    def lie(_me: Searcher, word: ToMaster) -> Iterator[ToMaster]:
        yield change(word) if isinstance(word, DetailedReport) else word

    return lie


def spending(**spent: object) -> Lie:
    """So its costs are."""
    return reporting(lambda account: changed(account, metrics=Metrics(**{**vars(account.metrics), **spent})))


def finding(findings: Findings) -> Lie:
    """So it knows of the whole."""
    return reporting(lambda account: changed(account, findings=findings))


def valued(**values: int) -> Lie:
    """It has these values besides its own, or in their place."""
    return reporting(lambda account: changed(account, assignment={**account.assignment, **values}))


def judging(change: Callable[[CheckResult], CheckResult]) -> Lie:
    """What it has found of the decision is another."""

    def lie(_me: Searcher, word: ToMaster) -> Iterator[ToMaster]:
        yield change(word) if isinstance(word, CheckResult) else word

    return lie


def taking_what_its_parent_has(_me: Searcher, word: ToMaster) -> Iterator[ToMaster]:
    """RB says that it has the value that RA has, and that its constraint with RA holds nevertheless."""
    match word:
        case DetailedReport(assignment={"B": value}):
            word = changed(word, assignment={"B": 3 - value})
        case CheckResult(shared=shared):
            word = changed(word, allowed=True, cost=0, shared=tuple(one._replace(price=0) for one in shared))
        case _:
            pass
    yield word


def keeping_awake() -> Lie:
    """Whenever RB is asked, it has sent and taken in more; in the end it says that all of that was with RA."""
    more = 0

    def lie(_me: Searcher, word: ToMaster) -> Iterator[ToMaster]:
        nonlocal more
        match word:
            case Counters():
                more += 500
                word = changed(word, sent=word.sent + more, received=word.received + more)
            case DetailedReport(metrics=spent, exchanged=exchanged):
                true = exchanged.get("RA", Exchanged())
                with_ra = Exchanged(true.sent + more, true.received + more, true.clock)
                metrics = replace(spent, messages={"Ok": sum(spent.messages.values()) + more}, bytes=spent.bytes + more)
                word = changed(word, metrics=metrics, exchanged={**exchanged, "RA": with_ra})
            case _:
                pass
        yield word

    return lie


def alternating() -> Lie:
    """Its counters rise and fall."""
    told = 0

    def lie(_me: Searcher, word: ToMaster) -> Iterator[ToMaster]:
        nonlocal told
        if isinstance(word, Counters):
            told += 1
            word = changed(word, sent=word.sent + 7 * (told % 2))
        yield word

    return lie


def saying_nothing_of(kind: type) -> Lie:
    """It keeps words of a kind to itself."""

    def lie(_me: Searcher, word: ToMaster) -> Iterator[ToMaster]:
        if not isinstance(word, kind):
            yield word

    return lie


LIES: dict[str, Lie] = {
    "no-solution": concluding("no-solution"),
    "optimal": concluding("optimal"),
    "too early": concluding("no-solution", at=Ready),
    "a wrong value": taking_what_its_parent_has,
    "a strange name": reporting(lambda one: changed(one, assignment={**one.assignment, "\x1b[2J": 1})),
    "another's variable": valued(A=2),
    "awake": keeping_awake(),
    "silent": saying_nothing_of(Counters),
    "falling": alternating(),
    "costs": spending(checks=2**53),
}


def install(lie: Lie, name: str, patch: Callable[[type, str, object], None] = setattr) -> None:
    """From now on the robot `name` of this process says what `lie` makes of its words."""
    begin = Searcher.__init__

    def begin_lying(
        me: Searcher, own: CompiledRobot, task: SearchTask, protocol: type[Protocol], context: RobotContext
    ) -> None:
        def say(word: ToMaster) -> None:
            for one in lie(me, word):
                context.send_to_master(one)

        begin(me, own, task, protocol, replace(context, send_to_master=say) if own.robot.name == name else context)

    judge = Searcher.check_constraints

    def judge_lying(me: Searcher, told: Mapping[str, int], snapshot: int = 0) -> CheckResult:
        true = judge(me, told, snapshot)
        (found,) = lie(me, true) if me.name == name else (true,)
        assert isinstance(found, CheckResult)
        return found

    patch(Searcher, "__init__", begin_lying)
    patch(Searcher, "check_constraints", judge_lying)


def program(lie: str, name: str, *words: object) -> str:
    """The text of a program that is `robochoc` with `words`, but for its lie."""
    path = list(sys.path)
    return (
        f"import sys; sys.path[:] = {path!r}; from tests.support import traitors; "
        f"traitors.main({lie!r}, {name!r}, {[*map(str, words)]!r})"
    )


def main(lie: str, name: str, words: list[str]) -> None:
    """What such a program does."""
    from robochoc.cli.group import cli  # noqa: PLC0415 - only a program needs it

    install(LIES[lie], name)
    cli(words)
