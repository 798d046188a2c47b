"""A question to the Directory Facilitator of a running master: who is there, and offers what."""

from __future__ import annotations

import secrets
import time
from collections.abc import Sequence
from queue import Empty

from robochoc.authority.identity import Identity
from robochoc.communication.network.letters import MASTER, Letters, Refused
from robochoc.communication.network.post import Arrived, CannotConnect, Post
from robochoc.communication.network.words import Ask, Told
from robochoc.machines.place import Place
from robochoc.services.communicative_acts import Performative
from robochoc.services.descriptions import AgentDescription, ServiceDescription
from robochoc.services.sl import Function, descriptions_in, df_on, request

ANSWER_S = 5.0
ASK_AGAIN_S = 1.0
_NUMBER_BITS = 32
SLOTS = ("name", "protocol", "variable", "topic", "ontology", "language")


class NoAnswer(Exception):  # noqa: N818 - named for what happened
    """The directory refuses, or says nothing."""


class BadTemplate(ValueError):  # noqa: N818 - named for what was given
    """That is nothing to search for."""


def template_of(slots: Sequence[str]) -> AgentDescription:
    """The template that `slot=value` words describe: all of them have to match. Raises `BadTemplate`.

    Names may go without their platform, which may call itself otherwise than whoever asks does.
    """
    given: dict[str, list[str]] = {slot: [] for slot in SLOTS}
    for word in slots:
        slot, equals, value = word.partition("=")
        if not equals or slot not in given or not value:
            raise BadTemplate(f"{word!r} is no SLOT=VALUE; slots are {', '.join(SLOTS)}")
        given[slot].append(value)
    if len(given["name"]) > 1:
        raise BadTemplate("an agent has one name")
    services = [ServiceDescription(name=one, type=kind) for kind in ("variable", "topic") for one in given[kind]]
    name = given["name"][0] if given["name"] else ""
    return AgentDescription(
        name=name,
        services=tuple(services),
        protocols=tuple(given["protocol"]),
        ontologies=tuple(given["ontology"]),
        languages=tuple(given["language"]),
    )


def platform_at(place: Place) -> str:
    """The name of the platform whose master is at `place`, as agents' names end."""
    return f"{place}/robochoc"


def search_words(place: Place, slots: Sequence[str], at_most: int | None = None) -> str:
    """The search as the directory is asked: an action in SL0. Raises `BadTemplate`."""
    platform = platform_at(place)
    return request(df_on(platform), Function.SEARCH, template_of(slots), at_most)


def consult(place: Place, identity: Identity, words: str, patience_s: float = 10.0) -> str:
    """What the directory answers to `words`, in SL0. Raises `CannotConnect` and `NoAnswer`."""
    letters = Letters(identity.name)
    number = secrets.randbits(_NUMBER_BITS)  # answers to earlier questions may still come
    with Post(str(place), identity, watch=(), patience_s=patience_s) as post:
        until = time.monotonic() + ANSWER_S
        asked = 0.0
        while time.monotonic() < until:
            if time.monotonic() - asked > ASK_AGAIN_S:
                asked = time.monotonic()
                post.send(MASTER, letters.write(MASTER, Ask(number, words)))
            try:
                item = post.inbox.get(timeout=0.1)
            except Empty:
                continue
            told = _told(letters, item) if isinstance(item, Arrived) and item.sender == MASTER else None
            if told and told.number == number:
                if told.performative != Performative.INFORM:
                    raise NoAnswer(f"the directory answers {told.performative}: {told.content}")
                return told.content
    raise NoAnswer(f"the master at {place} does not answer {identity.name}; is it enrolled with its Authority?")


def found(answer: str) -> tuple[AgentDescription, ...]:
    """The agents in an answer."""
    return descriptions_in(answer)


def _told(letters: Letters, item: Arrived) -> Told | None:
    try:
        word = letters.read(item.sender, item.content).word
    except Refused:
        return None
    return word if isinstance(word, Told) else None


__all__ = ["BadTemplate", "CannotConnect", "NoAnswer", "consult", "found", "search_words"]
