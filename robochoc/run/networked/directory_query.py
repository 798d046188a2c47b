"""A question to the Directory Facilitator of a running master: who is there, and offers what."""

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
from robochoc.model.communicative_acts import Performative
from robochoc.run.networked.address import Address
from robochoc.services.descriptions import AgentDescription, ServiceDescription
from robochoc.services.sl import Function, descriptions_in, df_on, request, searched_in
from robochoc.system.plain_text import LONGEST_REASON, on_one_line

ANSWER_S = 5.0
ASK_AGAIN_S = 1.0
_NUMBER_BITS = 32
SLOTS = ("name", "protocol", "variable", "topic", "ontology", "language")


class NoAnswerError(Exception):
    """The directory refuses, or says nothing."""


class TemplateError(ValueError):
    """That is nothing to search for."""


def search_template(slots: Sequence[str]) -> AgentDescription:
    """The template that `slot=value` words describe: all of them have to match. Raises `TemplateError`.

    Names may go without their platform, which may call itself otherwise than whoever asks does.
    """
    given: dict[str, list[str]] = {slot: [] for slot in SLOTS}
    for word in slots:
        slot, equals, value = word.partition("=")
        if not equals or slot not in given or not value:
            raise TemplateError(f"{word!r} is no SLOT=VALUE; slots are {', '.join(SLOTS)}")
        given[slot].append(value)
    if len(given["name"]) > 1:
        raise TemplateError("an agent has one name")
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
    """The name of the platform whose master is at `place`, as agents' names end."""
    return f"{place}/robochoc"


def search_request(place: Address, slots: Sequence[str], at_most: int | None = None) -> str:
    """The search as the directory is asked: an action in SL0. Raises `TemplateError`."""
    platform = platform_at(place)
    return request(df_on(platform), Function.SEARCH, search_template(slots), at_most)


def query_directory(place: Address, identity: Identity, words: str, patience_s: float = 10.0) -> str:
    """What the directory answers to `words`, in SL0. Raises `CannotConnectError` and `NoAnswerError`."""
    with Transport(str(place), identity, watch=(), patience_s=patience_s) as transport:
        return _Asking(place, identity, transport).asked(words, Performative.INFORM)


def watch_directory(place: Address, identity: Identity, words: str, patience_s: float = 10.0) -> Iterator[str]:
    """What the directory tells whoever subscribes to what `words` search for, now and whenever it changes, in SL0.

    It ends with `NoAnswerError` when the master is gone for `patience_s`. Raises `CannotConnectError` as well.
    """
    with Transport(str(place), identity, watch=(), patience_s=patience_s) as transport:
        asking = _Asking(place, identity, transport)
        asking.asked(words, Performative.AGREE, subscribe=True)
        heard = time.monotonic()
        while time.monotonic() - heard < patience_s:
            told = asking.told()
            if told:
                yield told.content
            if told or transport.router:
                heard = time.monotonic()
    raise NoAnswerError(f"the master at {place} is gone")


class _Asking:
    """One who asks; answers to others' questions, and to earlier ones, are none."""

    def __init__(self, place: Address, identity: Identity, transport: Transport) -> None:
        self._place = place
        self._name = identity.name
        self._transport = transport
        self._framing = Framing(identity.name)
        self._number = secrets.randbits(_NUMBER_BITS)
        self._early: list[DirectoryAnswer] = []

    def asked(self, words: str, wanted: Performative, *, subscribe: bool = False) -> str:
        """Ask until there is an answer; its content. Raises `NoAnswerError`."""
        until, asked = time.monotonic() + ANSWER_S, 0.0
        while time.monotonic() < until:
            if time.monotonic() - asked > ASK_AGAIN_S:
                asked = time.monotonic()
                self._transport.send(
                    MASTER, self._framing.write(MASTER, DirectoryRequest(self._number, words, subscribe))
                )
            told = self._next()
            if told is None:
                continue
            if told.performative == wanted:
                return told.content
            if told.performative != Performative.INFORM:
                raise NoAnswerError(
                    on_one_line(f"the directory answers {told.performative}: {told.content}", LONGEST_REASON)
                )
            self._early.append(told)
        raise NoAnswerError(
            f"the master at {self._place} does not answer {self._name}; is it enrolled with its Authority?"
        )

    def told(self) -> DirectoryAnswer | None:
        """The next INFORM; None: for a moment there was none."""
        if self._early:
            return self._early.pop(0)
        told = self._next()
        return told if told and told.performative == Performative.INFORM else None

    def _next(self) -> DirectoryAnswer | None:
        try:
            item = self._transport.inbox.get(timeout=0.1)
        except Empty:
            return None
        told = _told(self._framing, item) if isinstance(item, FrameArrived) and item.sender == MASTER else None
        return told if told and told.number == self._number else None


def agents_in(answer: str) -> tuple[AgentDescription, ...]:
    """The agents in an answer."""
    return descriptions_in(answer)


def subject_of(answer: str) -> str:
    """The name of the agent that an answer to a subscriber is about; empty where a search was for no name."""
    return searched_in(answer).name


def _told(framing: Framing, item: FrameArrived) -> DirectoryAnswer | None:
    try:
        word = framing.read(item.sender, item.content).message
    except FrameRefusedError:
        return None
    return word if isinstance(word, DirectoryAnswer) else None


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
