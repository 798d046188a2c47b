"""The host: clocks, counts, decoding, events; and the local problem that counts the checks."""

from __future__ import annotations

import pytest

from robochoc.communication.host import BadMessageError, Host, MessageCache
from robochoc.journal.events import AnyEvent, Bounded, Concluded, Decided, Heard, Received, Sent, Settled
from robochoc.journal.team_events import NOTHING_INVALIDATED
from robochoc.model.problem import Constraint, Relation, Semantics, Team
from robochoc.protocols.chance import Chance
from robochoc.protocols.findings import Findings, Incumbent
from robochoc.protocols.local_search.dsa import DSA, DSASettings
from robochoc.protocols.message import Envelope, Message, encode
from robochoc.protocols.order import PriorityOrder
from robochoc.protocols.satisfaction.abt import ABT
from robochoc.protocols.satisfaction.abt_messages import AddLink, Ok
from robochoc.protocols.satisfaction.first_fit_messages import Placed
from robochoc.protocols.satisfaction.nogood_messages import Nogood
from robochoc.solver.agent_problem import RunParameters, agent_problems
from robochoc.solver.local_problem import LocalProblem
from tests.support.cases import looped
from tests.support.problems import team_of

DIFFERENT = Relation("R", 2, Semantics.CONFLICTS, ((1, 1), (2, 2)))


def chain() -> Team:
    pairs = (("A", "B"), ("B", "C"))
    return team_of(dict.fromkeys("ABC", (1, 2)), [Constraint("C", DIFFERENT, pair, pair) for pair in pairs])


def host(name: str) -> Host:
    team = chain()
    problem = LocalProblem(agent_problems(team)[name])
    return Host(ABT(problem, PriorityOrder(team.order)))


def test_the_clock_takes_up_the_message_s_and_counts_own_checks() -> None:
    b = host("RB")
    b.start()
    assert b.clock == 0
    (said,) = b.handle([Envelope("RA", "RB", encode(Ok((1,))), clock=7)])
    # B = 1 was checked and broken, then B = 2 was checked: two checks on top of A's seven.
    assert b.clock == 9
    assert said.clock == 9
    assert b.metrics().checks == 2


class Chatty(ABT):
    """Says something before, between and after its checks."""

    def receive(self, sender: str, message: Message) -> None:
        self.send("RA", AddLink())
        super().receive(sender, message)
        self._consistent(0, self.view)
        self.send("RA", AddLink())

    def settle(self) -> None:
        self._consistent(1, self.view)
        self.send("RC", AddLink())
        self._consistent(1, self.view)


def chatty() -> Host:
    team = chain()
    return Host(Chatty(LocalProblem(agent_problems(team)["RB"]), PriorityOrder(team.order)))


def test_a_message_carries_the_clock_of_when_it_was_said() -> None:
    b = chatty()
    said = b.handle([Envelope("RA", "RB", encode(Ok((1,))), clock=7)])
    assert [envelope.clock for envelope in said] == [7, 8, 9]
    assert b.clock == 10
    assert b.checks_at_send == [0, 1, 2]
    # Nothing rules out B = 2, so it is checked each time; what ruled out B = 1 is known.
    again = b.handle([Envelope("RA", "RB", encode(Ok((1,))), clock=0)])
    assert [envelope.clock for envelope in again] == [10, 10, 11]


def test_what_was_said_to_a_message_does_not_carry_the_clocks_of_those_that_were_read_after_it() -> None:
    b = chatty()
    first, second = (Envelope("RA", "RB", encode(Ok((1,))), clock) for clock in (7, 100))
    assert [envelope.clock for envelope in b.handle([first, second])] == [7, 8, 100, 100, 101]
    assert b.clock == 102


def test_an_old_clock_moves_nothing_back() -> None:
    b = host("RB")
    b.handle([Envelope("RA", "RB", encode(Ok((1,))), clock=7)])
    b.handle([Envelope("RA", "RB", encode(Ok((1,))), clock=0)])
    assert b.clock == 10


def test_messages_and_bytes_are_counted_by_type() -> None:
    b = host("RB")
    (said,) = b.start()
    assert said.content == encode(Ok((1,)))
    assert b.metrics().messages == {"Ok": 1}
    assert b.metrics().bytes == len(said.content)


@looped("content", [b"", b"\x00", encode(Placed((1,))), encode(Ok((1,)))[:-1], b"\x92\xa2Ok\x91\xa1x"])
def test_what_is_no_message_of_the_protocol_is_refused(content: bytes) -> None:
    with pytest.raises(BadMessageError, match="RA sent RB an invalid message"):
        host("RB").handle([Envelope("RA", "RB", content, 0)])


def test_events_tell_what_happened_in_order() -> None:
    events: list[AnyEvent] = []
    c = host("RC")
    c.observe(events.append, lambda: 1.5)
    c.start()
    c.handle([Envelope("RB", "RC", encode(Ok((1,))), 3)])
    assert events == [
        Decided(t=1.5, robot="RC", assignment={"C": 1}, clock=0),
        Settled(t=1.5, robot="RC", clock=0, checks=0),
        Received(t=1.5, sender="RB", receiver="RC", type="Ok", clock=3),
        Decided(t=1.5, robot="RC", assignment={"C": 2}, clock=5),
        Settled(t=1.5, robot="RC", clock=5, checks=2),
    ]


def test_a_verdict_is_an_event_once() -> None:
    events: list[AnyEvent] = []
    a = host("RA")
    a.observe(events.append, lambda: 0.0)
    a.start()
    for value in (1, 2):
        a.handle([Envelope("RB", "RA", encode(Nogood({}, (value,))), 0)])
    a.handle([Envelope("RB", "RA", encode(Nogood({}, (1,))), 0)])
    assert [event for event in events if isinstance(event, Concluded)] == [
        Concluded(t=0.0, robot="RA", verdict="no-solution")
    ]
    assert any(isinstance(event, Sent) and event.content == {"value": (2,)} for event in events)


class Large(Message, frozen=True):
    """A message of any size, which receivers may share."""

    part: bytes

    shareable = True


def test_of_large_messages_only_the_last_ones_are_kept_to_be_shared() -> None:
    under_way = MessageCache()
    messages = [Large(bytes([number]) * 1_000_000) for number in range(8)]
    contents = [under_way.content(message) for message in messages]
    kept = [number for number, content in enumerate(contents) if under_way.get(content) is messages[number]]
    assert kept == [4, 5, 6, 7]
    largest = Large(b"0" * 9_000_000)
    assert under_way.get(under_way.content(largest)) is largest
    assert under_way.get(contents[-1]) is None


def test_a_message_that_is_sent_on_is_encoded_once() -> None:
    under_way, message = MessageCache(), Large(b"1")
    content = under_way.content(message)
    assert content == encode(message)
    assert under_way.content(message) is content
    equal = under_way.content(Large(b"1"))
    assert equal == content
    assert under_way.get(equal) is message


class Informed(ABT):
    """Reports the best assignment and the lower bound that a test sets."""

    cost: float | None = None
    bound: float | None = None

    @property
    def incumbent(self) -> Incumbent | None:
        return None if self.cost is None else Incumbent(self.cost, {})

    @property
    def findings(self) -> Findings:
        return Findings(bound=self.bound)


def informed(events: list[AnyEvent]) -> Host:
    team = chain()
    host = Host(Informed(LocalProblem(agent_problems(team)["RB"]), PriorityOrder(team.order)))
    host.observe(events.append, lambda: 0.0, bounds=True)
    return host


def reported(host: Host, events: list[AnyEvent], cost: float | None, bound: float | None) -> list[float]:
    """Return the costs and bounds that `host` reports after a step in which it knows these."""
    events.clear()
    assert isinstance(host.protocol, Informed)
    host.protocol.cost, host.protocol.bound = cost, bound
    host.handle([])
    return [one.cost if isinstance(one, Heard) else one.bound for one in events if isinstance(one, Heard | Bounded)]


def test_best_assignments_and_bounds_are_reported_once_and_again_after_a_change() -> None:
    events: list[AnyEvent] = []
    host = informed(events)
    known: list[tuple[float | None, float | None]] = [(5, 2), (5, 2), (6, 1), (4, 3), (None, None)]
    assert [reported(host, events, *one) for one in known] == [[5, 2], [], [], [4, 3], []]
    host.change(agent_problems(chain())["RB"], NOTHING_INVALIDATED)
    assert reported(host, events, 9, 1) == [9, 1]


def test_protocols_receive_their_settings_and_random_numbers() -> None:
    part = agent_problems(chain())["RB"]._replace(parameters=RunParameters(7, {"cycles": "3"}))
    one, other = Host.create(DSA, part), Host.create(DSA, part)
    assert isinstance(one.protocol.settings, DSASettings)
    assert one.protocol.settings.cycles == 3
    numbers = Chance(7, "RB")
    assert [one.protocol.chance(), one.protocol.chance()] == [numbers(), numbers()]
    assert other.protocol.chance() == Chance(7, "RB")()
