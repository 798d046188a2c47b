"""Termination detection: never too early, whatever the order of things; and at last, when all is quiet."""

from __future__ import annotations

from collections import deque
from random import Random

from hypothesis import given
from hypothesis import strategies as st

from robochoc.communication.control import Counters, Ready
from robochoc.communication.quiescence import FourCounters, MessageCounts
from robochoc.communication.search_state import SearchState
from tests.support.examples import examples

ROBOTS = ("A", "B", "C", "D")


class Network:
    """Robots that pass on messages for a while; reports and waves take as long as they like, in FIFO channels."""

    def __init__(self, chance: Random, budget: int) -> None:
        self.chance = chance
        self.budget = budget
        self.counts = dict.fromkeys(ROBOTS, MessageCounts(0, 0))
        self.flying: list[str] = []
        self.orders: dict[str, deque[int]] = {name: deque() for name in ROBOTS}
        self.answers: dict[str, deque[tuple[int, MessageCounts]]] = {name: deque() for name in ROBOTS}
        for name in ROBOTS:
            self.speak(name, chance.randint(0, 2))

    def speak(self, name: str, messages: int) -> None:
        messages = min(messages, self.budget)
        self.budget -= messages
        self.flying += self.chance.choices(ROBOTS, k=messages)
        self.counts[name] = self.counts[name]._replace(sent=self.counts[name].sent + messages)

    def step(self, counters: FourCounters) -> None:
        """One thing happens: a message arrives, a robot reports, hears of a wave, or is heard."""
        name = self.chance.choice(ROBOTS)
        match self.chance.randrange(4):
            case 0 if self.flying:
                receiver = self.flying.pop(self.chance.randrange(len(self.flying)))
                self.speak(receiver, self.chance.choice((0, 0, 1, 2)))
                self.counts[receiver] = self.counts[receiver]._replace(received=self.counts[receiver].received + 1)
            case 1:
                self.answers[name].append((0, self.counts[name]))
            case 2 if self.orders[name]:
                self.answers[name].append((self.orders[name].popleft(), self.counts[name]))
            case 3 if self.answers[name]:
                counters.answer(name, *self.answers[name].popleft())
            case _:
                pass
        if counters.due and not counters.quiescent:
            wave = counters.start_wave()
            for orders in self.orders.values():
                orders.append(wave)


@given(seed=st.integers(0, 2**32), budget=st.integers(0, 40))
@examples(500)
def test_quiet_is_declared_when_it_is_true_and_only_then(seed: int, budget: int) -> None:
    network, counters = Network(Random(seed), budget), FourCounters(ROBOTS)
    for _ in range(20_000):
        network.step(counters)
        if counters.quiescent:
            assert not network.flying
            return
    raise AssertionError("quiet, and not noticed")


def test_nobody_is_quiet_before_all_have_been_heard() -> None:
    counters = FourCounters(("A", "B"))
    counters.update("A", MessageCounts(0, 0))
    assert not counters.due


def test_the_silent_are_those_of_whom_nothing_is_known_then_those_that_owe_an_answer() -> None:
    counters = FourCounters(("B", "A", "C"))
    counters.update("B", MessageCounts(2, 1))
    assert (counters.silent, counters.latest("A"), counters.latest("B")) == (("A", "C"), None, MessageCounts(2, 1))
    assert (counters.total, counters.sent) == (None, 2)
    counters.update("A", MessageCounts(0, 1))
    counters.update("C", MessageCounts(1, 1))
    assert (counters.silent, counters.is_wave_open) == ((), False)
    assert (counters.total, counters.sent) == (MessageCounts(3, 3), 3)
    wave = counters.start_wave()
    counters.answer("A", wave, MessageCounts(0, 1))
    assert (counters.silent, counters.is_wave_open) == (("B", "C"), True)


def waved(counters: FourCounters, a: MessageCounts, b: MessageCounts) -> int:
    """Ask A and B, who have counted this; return the number of the wave."""
    wave = counters.start_wave()
    counters.answer("A", wave, a)
    counters.answer("B", wave, b)
    return wave


def heard(a: MessageCounts, b: MessageCounts) -> FourCounters:
    """Return the counters once A and B have reported this by themselves."""
    counters = FourCounters(("A", "B"))
    counters.update("A", a)
    counters.update("B", b)
    return counters


def test_an_answer_to_an_older_wave_is_counted_and_ends_nothing() -> None:
    counters = heard(MessageCounts(1, 1), MessageCounts(1, 1))
    older = waved(counters, MessageCounts(2, 1), MessageCounts(2, 1))
    assert not counters.quiescent
    counters.update("A", MessageCounts(2, 2))
    counters.update("B", MessageCounts(2, 2))
    newer = counters.start_wave()
    assert newer == older + 1
    counters.answer("A", newer, MessageCounts(2, 2))
    counters.answer("B", older, MessageCounts(2, 2))
    assert (counters.quiescent, counters.silent) == (False, ("B",))
    counters.answer("B", newer, MessageCounts(2, 2))
    assert counters.quiescent


def test_a_wave_that_finds_the_same_is_not_enough_while_messages_are_under_way() -> None:
    counters = heard(MessageCounts(1, 0), MessageCounts(0, 0))
    waved(counters, MessageCounts(1, 0), MessageCounts(0, 0))  # as the count is wanted
    assert not counters.quiescent


def test_a_wave_begun_before_all_were_heard_has_nothing_to_be_compared_with() -> None:
    counters = FourCounters(("A", "B"))
    waved(counters, MessageCounts(0, 0), MessageCounts(0, 0))
    assert not counters.quiescent
    assert counters.due
    waved(counters, MessageCounts(0, 0), MessageCounts(0, 0))
    assert counters.quiescent


def test_one_balanced_wave_is_not_enough() -> None:
    counters = heard(MessageCounts(1, 0), MessageCounts(0, 1))
    waved(counters, MessageCounts(1, 0), MessageCounts(1, 1))  # B has spoken since
    assert not counters.quiescent
    assert not counters.due


def test_robots_that_have_not_answered_for_long_are_overdue() -> None:
    state = SearchState(1, ROBOTS[:2])
    for name in state.order:
        state.handle(name, Ready(1))
    state.start()
    wave = state.counters.start_wave()
    state.handle("A", Counters(1, wave, 0, 0))
    assert state.overdue(5) == ("", 0)
    state.handle("A", Counters(1, 0, 8, 0))  # the other robots continue
    names, silent_s = state.overdue(70)
    assert (names, silent_s) == ("B", 65)
    state.handle("B", Counters(1, wave, 0, 0))
    assert state.overdue(71) == ("", 0)


def test_a_robot_that_answers_each_wave_late_is_not_overdue() -> None:
    state = SearchState(1, ROBOTS[:2])
    for name in state.order:
        state.handle(name, Ready(1))
    state.start()
    for now in range(0, 60, 6):
        wave = state.counters.start_wave()
        assert state.overdue(now) == ("", 0)
        state.handle("A", Counters(1, wave, now, 0))
        assert state.overdue(now + 5) == ("", 0)
        state.handle("B", Counters(1, wave, now, 0))


def test_a_robot_that_is_not_ready_is_overdue() -> None:
    state = SearchState(1, ROBOTS[:2])
    state.handle("A", Ready(1))
    assert [state.overdue(now)[0] for now in (0, 10, 11)] == ["", "", "B"]
