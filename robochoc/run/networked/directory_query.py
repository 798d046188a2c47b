"""Queries about agents and their services to the Directory Facilitator of a running master."""

from __future__ import annotations

import secrets
import time
from collections.abc import Iterator, Sequence
from queue import Empty

from robochoc.authority.identity import Identity
from robochoc.communication.network.control_messages import DirectoryAnswer, DirectoryRequest
from robochoc.communication.network.framing import MASTER, FrameRefusedError, Framing
from robochoc.communication.network.inbox import FrameArrived
from robochoc.communication.network.transport import CannotConnectError, Transport
from robochoc.protocols.acts import Performative
from robochoc.run.networked.address import Address
from robochoc.services.descriptions import AgentDescription, ServiceDescription
from robochoc.services.sl import DirectoryFunction, descriptions_in, df_on, request, searched_in
from robochoc.system.errors import RobochocError
from robochoc.system.plain_text import LONGEST_REASON, on_one_line

ANSWER_S = 5.0
ASK_AGAIN_S = 1.0
_NUMBER_BITS = 32
SLOTS = ("name", "protocol", "variable", "topic", "ontology", "language")


class NoAnswerError(RobochocError):
    """Raised if the directory refuses a query or does not answer."""


class TemplateError(RobochocError, ValueError):
    """Raised for an invalid search template."""


def search_template(slots: Sequence[str]) -> AgentDescription:
    """Return the template for `slots`, texts of the form `slot=value` that must all match. Raises `TemplateError`.

    Agent names may omit the platform, since its name may be unknown outside its machine.
    """
    given: dict[str, list[str]] = {slot: [] for slot in SLOTS}
    for word in slots:
        slot, equals, value = word.partition("=")
        if not equals or slot not in given or not value:
            raise TemplateError(f"{word!r} is not of the form SLOT=VALUE; the slots are {', '.join(SLOTS)}")
        given[slot].append(value)
    if len(given["name"]) > 1:
        raise TemplateError("the slot `name` is given twice: give it once")
    services = [ServiceDescription(name=one, type=kind) for kind in ("variable", "topic") for one in given[kind]]
    name = given["name"][0] if given["name"] else ""
    return AgentDescription(
        name=name,
        services=tuple(services),
        protocols=tuple(given["protocol"]),
        ontologies=tuple(given["ontology"]),
        languages=tuple(given["language"]),
    )


def platform_at(place: Address) -> str:
    """Return the name of the platform whose master is at `place`. Names of agents end with it."""
    return f"{place}/robochoc"


def search_request(place: Address, slots: Sequence[str], at_most: int | None = None) -> str:
    """Return a search action in SL0. Raises `TemplateError`."""
    platform = platform_at(place)
    return request(df_on(platform), DirectoryFunction.SEARCH, search_template(slots), at_most)


def query_directory(place: Address, identity: Identity, words: str, patience_s: float = 10.0) -> str:
    """Return the directory's answer to the request `words`, in SL0. Raises `CannotConnectError` and `NoAnswerError`."""
    with Transport(str(place), identity, watch=(), patience_s=patience_s) as transport:
        return _Query(place, identity, transport).ask(words, Performative.INFORM)


def watch_directory(place: Address, identity: Identity, words: str, patience_s: float = 10.0) -> Iterator[str]:
    """Subscribe to the search `words`. Yield the directory's notices in SL0: one at once, then one at each change.

    Raises:
        CannotConnectError: if no master answers.
        NoAnswerError: if the directory refuses, or the master is absent for `patience_s` seconds.
    """
    with Transport(str(place), identity, watch=(), patience_s=patience_s) as transport:
        query = _Query(place, identity, transport)
        query.ask(words, Performative.AGREE, subscribe=True)
        last_seen = time.monotonic()
        while time.monotonic() - last_seen < patience_s:
            notice = query.next_notice()
            if notice:
                yield notice.content
            if notice or transport.router:
                last_seen = time.monotonic()
    raise NoAnswerError(f"the master at {place} is gone")


class _Query:
    """A query or subscription. Answers to other queries are ignored."""

    def __init__(self, place: Address, identity: Identity, transport: Transport) -> None:
        self._place = place
        self._name = identity.name
        self._transport = transport
        self._framing = Framing(identity.name)
        self._number = secrets.randbits(_NUMBER_BITS)
        self._early: list[DirectoryAnswer] = []

    def ask(self, words: str, expected: Performative, *, subscribe: bool = False) -> str:
        """Repeat the query until an answer arrives, and return the content of the answer. Raises `NoAnswerError`."""
        until, asked = time.monotonic() + ANSWER_S, 0.0
        while time.monotonic() < until:
            if time.monotonic() - asked > ASK_AGAIN_S:
                asked = time.monotonic()
                self._transport.send(
                    MASTER, self._framing.write(MASTER, DirectoryRequest(self._number, words, subscribe))
                )
            answer = self._next()
            if answer is None:
                continue
            if answer.performative == expected:
                return answer.content
            if answer.performative != Performative.INFORM:
                raise NoAnswerError(
                    on_one_line(f"the directory answers {answer.performative}: {answer.content}", LONGEST_REASON)
                )
            self._early.append(answer)
        raise NoAnswerError(
            f"the master at {self._place} does not answer {self._name}; is it enrolled with its Authority?"
        )

    def next_notice(self) -> DirectoryAnswer | None:
        """Return the next INFORM message, or None if none arrived within a short time."""
        if self._early:
            return self._early.pop(0)
        answer = self._next()
        return answer if answer and answer.performative == Performative.INFORM else None

    def _next(self) -> DirectoryAnswer | None:
        try:
            item = self._transport.inbox.get(timeout=0.1)
        except Empty:
            return None
        answer = _answer_in(self._framing, item) if isinstance(item, FrameArrived) and item.sender == MASTER else None
        return answer if answer and answer.number == self._number else None


def agents_in(answer: str) -> tuple[AgentDescription, ...]:
    """Return the agents in an answer."""
    return descriptions_in(answer)


def subject_of(answer: str) -> str:
    """Return the name of the agent described by a notice; empty if the search named no agent."""
    return searched_in(answer).name


def _answer_in(framing: Framing, item: FrameArrived) -> DirectoryAnswer | None:
    try:
        message = framing.read(item.sender, item.content).message
    except FrameRefusedError:
        return None
    return message if isinstance(message, DirectoryAnswer) else None


__all__ = [
    "CannotConnectError",
    "NoAnswerError",
    "TemplateError",
    "agents_in",
    "query_directory",
    "search_request",
    "subject_of",
    "watch_directory",
]
