"""Masters and robots that vote, in every order of messages, losses, repetitions, deaths and returns.

Messages that were sent may arrive at any later time, several times, or never. So a lost message, a partition, and a
dead or stopped master or robot are orders in which some messages do not arrive. A robot that returns has its stored
votes, and a master that returns has another run, and therefore another term. The explored states contain each of these.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import NamedTuple

import pytest

from robochoc.communication.network.leadership import NO_TERM, Acceptance, Leadership, Term, Votes

Held = Acceptance[str] | None


class World(NamedTuple):
    """What all robots have sent, and what all masters have proposed, so far.

    A promise or an acceptance that was sent may have arrived at its master or not. Robots are in no order, since all
    are alike.

    Attributes:
        robots: By robot, its votes, and the votes that it has sent: the terms that it has promised, each with the
            decision accepted before, and the terms in which it has accepted a decision.
        proposals: By term, the proposed decision, or None.
    """

    robots: tuple[tuple[Votes[str], frozenset[tuple[int, Held]], frozenset[int]], ...]
    proposals: tuple[str | None, ...]


class Masters(NamedTuple):
    """The masters' terms, and the robots that vote."""

    terms: tuple[Term, ...]
    team: tuple[str, ...]

    def start(self) -> World:
        return World(tuple((Votes[str](), frozenset(), frozenset()) for _ in self.team), (None,) * len(self.terms))

    def following(self, now: World) -> Iterator[World]:
        """Yield the worlds after a robot has received a message, or a master has proposed a decision."""
        for place, (votes, promised, accepted) in enumerate(now.robots):
            for number, term in enumerate(self.terms):
                if after := votes.promise(term):
                    yield with_robot(now, place, (after, promised | {(number, votes.accepted)}, accepted))
                decision = now.proposals[number]
                if decision is not None and (after := votes.accept(term, decision)):
                    yield with_robot(now, place, (after, promised, accepted | {number}))
        for number, decision in enumerate(now.proposals):
            for found in self.proposable(now, number) if decision is None else ():
                yield now._replace(proposals=(*now.proposals[:number], found, *now.proposals[number + 1 :]))

    def leadership(self, number: int) -> Leadership[str]:
        return Leadership[str](self.terms[number], frozenset(self.team))

    def proposable(self, now: World, number: int) -> set[str]:
        """Return the decisions that a master may propose, whichever of the promises have arrived at it."""
        reached = {self.leadership(number)}
        for name, (_, promised, _) in zip(self.team, now.robots, strict=True):
            answers = [held for term, held in promised if term == number]
            reached |= {master.note_promise(name, held) for master in reached for held in answers}
        return {str(one.propose(f"found in {number}").proposed) for one in reached if one.may_search}

    def published(self, now: World) -> set[str]:
        """Return the decisions that some master may have published."""
        found = set()
        for number, decision in enumerate(now.proposals):
            if decision is not None:
                master = self.leadership(number)._replace(proposed=decision)
                for name, (_, _, accepted) in zip(self.team, now.robots, strict=True):
                    master = master.note_acceptance(name) if number in accepted else master
                found |= {decision} if master.may_publish else set()
        return found

    def explored(self, following: Callable[[World], Iterator[World]] | None = None) -> tuple[set[World], str]:
        """Return all reachable worlds, and the first fault found in them."""
        seen, waiting = {self.start()}, [self.start()]
        while waiting:
            now = waiting.pop()
            if len(published := self.published(now)) > 1:
                return seen, "two decisions: " + ", ".join(sorted(published))
            for after in (following or self.following)(now):
                if after not in seen:
                    seen.add(after)
                    waiting.append(after)
        return seen, ""


def with_robot(now: World, place: int, robot: tuple[Votes[str], frozenset[tuple[int, Held]], frozenset[int]]) -> World:
    """Return the world with another state of a robot. The robots are sorted, because all of them are alike."""
    robots = (*now.robots[:place], robot, *now.robots[place + 1 :])
    return now._replace(robots=tuple(sorted(robots, key=repr)))


def masters(robots: int, terms: tuple[Term, ...]) -> Masters:
    return Masters(terms, tuple("ABCDE"[:robots]))


TWO = (Term(1, "a"), Term(2, "b"))


@pytest.mark.parametrize("robots", [1, 2, 3])
def test_two_masters_never_publish_different_decisions(robots: int) -> None:
    both = masters(robots, TWO)
    seen, fault = both.explored()
    assert not fault
    assert {len(both.published(one)) for one in seen} == {0, 1}


def test_masters_with_the_same_number_never_publish_different_decisions() -> None:
    three = masters(2, (Term(1, "a"), Term(1, "b"), Term(2, "a")))
    assert not three.explored()[1]


@pytest.mark.more
def test_four_robots_or_three_masters_never_publish_different_decisions() -> None:
    assert not masters(4, TWO).explored()[1]
    assert not masters(2, (*TWO, Term(3, "c"))).explored()[1]


def test_a_later_master_publishes_the_decision_of_an_earlier_one() -> None:
    both = masters(2, TWO)
    seen, _ = both.explored()
    assert any(one.proposals[1] == "found in 0" and both.published(one) for one in seen)
    assert any(one.proposals == ("found in 0", "found in 1") and both.published(one) for one in seen)


def test_a_minority_never_publishes() -> None:
    both = masters(3, TWO)

    def without_two(now: World) -> Iterator[World]:
        idle = both.start().robots[0]
        return (one for one in both.following(now) if one.robots.count(idle) >= len(both.team) - 1)

    seen, _ = both.explored(without_two)
    assert len(seen) > 1
    assert not any(both.published(one) or any(one.proposals) for one in seen)


# Faults that the exploration must find


def test_a_robot_that_loses_its_votes_is_a_fault() -> None:
    both = masters(2, TWO)

    def forgetful(now: World) -> Iterator[World]:
        yield from both.following(now)
        for place, (_, promised, accepted) in enumerate(now.robots):
            yield with_robot(now, place, (Votes[str](), promised, accepted))

    assert both.explored(forgetful)[1]


@pytest.mark.parametrize(
    ("owner", "name", "planted"),
    [
        (Leadership, "inherited", property(lambda _self: None)),
        (Leadership, "needed", property(lambda _self: 1)),
        (Votes, "accept", lambda self, term, decision: Votes(max(self.promised, term), Acceptance(term, decision))),
        (Votes, "promise", lambda self, term: Votes(max(self.promised, term), None)),
    ],
)
def test_a_planted_fault_is_found(owner: type, name: str, planted: object, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(owner, name, planted)
    assert masters(2, TWO).explored()[1]


def test_a_term_after_others() -> None:
    assert Term(1, "b").after([Term(4, "a"), NO_TERM]) == Term(5, "b")
    assert NO_TERM.after([]) == Term(1, "")


def test_votes_that_do_not_count() -> None:
    leadership = Leadership[str](TWO[1], frozenset({"A", "B", "C"}))
    assert leadership.note_promise("X", None) == leadership
    with pytest.raises(ValueError, match="majority"):
        leadership.propose("x")
    promised = leadership.note_promise("A", None).note_promise("A", Acceptance(TWO[0], "x")).note_promise("B", None)
    assert promised.inherited is None
    assert (set(promised.promised), promised.needed) == ({"A", "B"}, 2)
    assert promised.note_acceptance("A") == promised
    proposed = promised.propose("x").propose("y")
    assert (proposed.proposed, proposed.may_publish) == ("x", False)
    assert proposed.note_acceptance("A").note_acceptance("X").note_acceptance("C").may_publish
