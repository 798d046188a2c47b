"""RMF's dispatcher and bidders in every order of messages, with some losses, repetitions and delays.

Messages between two ends on one topic keep their order, as with reliable DDS. Time passes in steps, either when no
message is on its way, or, as often as `late` allows, before the messages on their way arrive.
"""

from __future__ import annotations

import io
import pickle
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from hashlib import blake2b

from robochoc.ros.rmf.bidder import Bidder
from robochoc.ros.rmf.dispatcher import Dispatcher
from robochoc.ros.rmf.messages import ApiResponse, DispatchStates, Message, TaskStateUpdate

DISPATCHER = "dispatcher"
_UNREAD = (ApiResponse, DispatchStates, TaskStateUpdate)
Link = tuple[str, str]
"""The receiver, and the sender with the topic."""


@dataclass(frozen=True)
class Budget:
    """The limits on lost, repeated and waiting messages, and on bidders that die."""

    lost: int = 0
    repeated: int = 0
    late: int = 0
    dying: int = 0


@dataclass
class State:
    """The two sides, and the messages on their way."""

    dispatcher: Dispatcher
    bidders: Mapping[str, Bidder]
    links: Mapping[Link, tuple[Message, ...]]
    budget: Budget
    now_s: float = 0.0
    dead: frozenset[str] = frozenset()

    def copy(self) -> State:
        """Return a copy; messages are shared."""
        dispatcher, bidders = pickle.loads(pickle.dumps((self.dispatcher, self.bidders)))  # noqa: S301 - made here
        return replace(self, dispatcher=dispatcher, bidders=bidders)

    @property
    def key(self) -> bytes:
        """Equal states have equal keys."""
        written = io.BytesIO()
        pickler = pickle.Pickler(written)
        pickler.fast = True  # without references between equal parts
        pickler.dump((self.dispatcher, self.bidders, self.links, self.budget, self.now_s))
        return blake2b(written.getvalue(), digest_size=16).digest()

    @property
    def is_over(self) -> bool:
        """True if all tasks have ended, and no message of a living bidder is on its way."""
        has_ended = self.dispatcher.is_idle or (self.dead and not self.dispatcher.states.active)
        return bool(has_ended and not self.links)

    def send(self) -> None:
        """Put the new messages of both sides on their way."""
        links = dict(self.links)

        def add(receiver: str, sender: str, messages: Sequence[Message]) -> None:
            for message in messages:
                if not isinstance(message, _UNREAD):
                    link = (receiver, f"{sender} {type(message).__name__}")
                    links[link] = (*links.get(link, ()), message)

        messages = self.dispatcher.drain()
        self.dispatcher.drain_finished()
        for name, bidder in self.bidders.items():
            if name not in self.dead:
                add(name, DISPATCHER, messages)
                add(DISPATCHER, name, bidder.drain())
        self.links = dict(sorted(links.items()))

    def receive(self, receiver: str, message: Message) -> None:
        if receiver == DISPATCHER:
            self.dispatcher.receive(message, self.now_s)
        else:
            self.bidders[receiver].receive(message, self.now_s)
        self.send()

    def next_states(self) -> Iterator[State]:
        """Yield the states after each possible event."""
        for link in self.links:
            yield self._without_first(link, arrives=True)
            if self.budget.lost:
                yield self._without_first(link, arrives=False)
            if self.budget.repeated:
                yield self._without_first(link, arrives=True, again=True)
        if not self.links or self.budget.late:
            yield self._later()
        for name in self.bidders if self.budget.dying else ():
            yield self._without_bidder(name)

    def _without_first(self, link: Link, *, arrives: bool, again: bool = False) -> State:
        found = self.copy()
        message, *rest = self.links[link]
        kept = (message, *rest) if again else tuple(rest)
        found.links = {one: waiting for one, waiting in {**self.links, link: kept}.items() if waiting}
        if again:
            found.budget = replace(self.budget, repeated=self.budget.repeated - 1)
        if not arrives:
            found.budget = replace(self.budget, lost=self.budget.lost - 1)
        else:
            found.receive(link[0], message)
        return found

    def _without_bidder(self, name: str) -> State:
        links = {link: messages for link, messages in self.links.items() if link[0] != name}
        budget = replace(self.budget, dying=self.budget.dying - 1)
        return replace(self.copy(), dead=self.dead | {name}, links=links, budget=budget)

    def _later(self) -> State:
        found = self.copy()
        if self.links:
            found.budget = replace(self.budget, late=self.budget.late - 1)
        found.now_s += 1.0
        found.dispatcher.tick(found.now_s)
        for name, bidder in found.bidders.items():
            if name not in self.dead:
                bidder.tick(found.now_s)
        found.send()
        return found


def ends_of(start: State, limit_s: float) -> Iterator[State]:
    """Yield all states in which all has ended. Raises `AssertionError` if something has not ended after `limit_s`."""
    start.send()
    known, waiting = {start.key}, [start]
    while waiting:
        state = waiting.pop()
        if state.is_over:
            yield state
            continue
        assert state.now_s < limit_s, "it does not end"
        for one in state.next_states():
            if one.key not in known:
                known.add(one.key)
                waiting.append(one)
