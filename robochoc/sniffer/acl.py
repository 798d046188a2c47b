r"""FIPA ACL messages (FIPA00061), and their text form (FIPA00070).

>>> from robochoc.protocols.acts import Performative
>>> from robochoc.services.identifier import AgentIdentifier
>>> print(text(ACLMessage(Performative.INFORM, AgentIdentifier("a@p"), (AgentIdentifier("b@p"),), content='say "hi"')))
(INFORM :sender (agent-identifier :name a@p) :receiver (set (agent-identifier :name b@p)) :content "say \"hi\"")
"""

from __future__ import annotations

import re
from functools import lru_cache

import msgspec

from robochoc.protocols.acts import Performative
from robochoc.services.identifier import AgentIdentifier, expression_of, identifier_of
from robochoc.services.symbolic import (
    Caps,
    Expression,
    String,
    SymbolicExpressionError,
    head_of,
    items_of,
    name,
    parameters,
    read,
    text_form,
    text_of,
)
from robochoc.system.errors import RobochocError

CAPS = Caps(characters=1 << 25, expressions=10_000, depth=16)
"""The limits on a message. The largest message of a protocol, a part of a `dpop` table, has 4 MiB (6 MiB as text)."""

_DATE_TIME = re.compile(r"[+-]?[0-9]{8}T[0-9]{9}[A-Za-z]?")
_USER_DEFINED = re.compile(r"x-[a-z0-9_.-]{1,64}")


class ACLError(RobochocError, ValueError):
    """An invalid text or message. `at`: the position of the error in the text; None: unknown."""

    def __init__(self, message: str, at: int | None = None) -> None:
        super().__init__(message if at is None else f"character {at}: {message}")
        self.at = at


class ACLMessage(msgspec.Struct, frozen=True):
    """A message with the thirteen parameters of FIPA00061, and user-defined ones (`user`). None: not given.

    `reply_by` is a DateTime of FIPA00008: `20260131T120000000Z`, or with a `+`, the time from now. Names in `user`
    begin with `x-` and are in lower case.

    Raises:
        ValueError: if `reply_by` or a name in `user` does not have this form.
    """

    performative: Performative
    sender: AgentIdentifier | None = None
    receiver: tuple[AgentIdentifier, ...] = ()
    reply_to: tuple[AgentIdentifier, ...] = ()
    content: str | None = None
    language: str | None = None
    encoding: str | None = None
    ontology: str | None = None
    protocol: str | None = None
    conversation_id: str | None = None
    reply_with: str | None = None
    in_reply_to: str | None = None
    reply_by: str | None = None
    user: tuple[tuple[str, str], ...] = ()

    def __post_init__(self) -> None:
        if self.reply_by is not None and not _DATE_TIME.fullmatch(self.reply_by):
            raise ValueError(f"reply-by {self.reply_by[:40]!r} is not a DateTime such as 20260131T120000000Z")
        for key, _ in self.user:
            if not _USER_DEFINED.fullmatch(key):
                raise ValueError(f"{key[:40]!r} is not a valid name of a user-defined parameter, such as x-clock")
        if len(dict(self.user)) < len(self.user):
            raise ValueError("a user-defined parameter is given more than once")


_TEXTS = ("content", "language", "encoding", "ontology", "protocol", "conversation-id", "reply-with", "in-reply-to")
_KNOWN = {"sender", "receiver", "reply-to", *_TEXTS, "reply-by"}


def text(message: ACLMessage) -> str:
    """Return the message in the form of FIPA00070, without missing parameters. Only strings can contain line breaks."""
    items = [message.performative.upper()]
    if message.sender is not None:
        items += [":sender", _agent_text(message.sender)]
    for key, agents in (("receiver", message.receiver), ("reply-to", message.reply_to)):
        if agents:
            items += [f":{key}", f"(set {' '.join(map(_agent_text, agents))})"]
    for key in _TEXTS:
        value: str | None = getattr(message, key.replace("-", "_"))
        if value is not None:
            items += [f":{key}", text_form(String(value) if key == "content" else name(value))]
    if message.reply_by is not None:
        items += [":reply-by", message.reply_by]
    for key, value in message.user:
        items += [f":X-{key[2:]}", text_form(name(value))]
    return f"({' '.join(items)})"


@lru_cache(maxsize=4096)
def _agent_text(agent: AgentIdentifier) -> str:
    return text_form(expression_of(agent))


def parse(message: str) -> ACLMessage:
    """Return the message in a text in the form of FIPA00070.

    As values, only words and strings are accepted, although FIPA00070 allows other expressions for some parameters.

    Raises:
        ACLError: if the text has any other form.
    """
    try:
        return _message(read(message, CAPS))
    except SymbolicExpressionError as bad:
        raise ACLError(str(bad), bad.at) from None


def _message(whole: Expression) -> ACLMessage:
    act = head_of(whole, "a message")
    try:
        performative = Performative(act)
    except ValueError:
        raise SymbolicExpressionError(f"{act[:40]!r} is not a performative of FIPA00037", whole.at) from None
    found = _parameters(whole, act)
    texts = {key: text_of(value, f":{key}") for key, value in found.items() if key in _TEXTS or key == "reply-by"}
    try:
        return ACLMessage(
            performative,
            identifier_of(found["sender"]) if "sender" in found else None,
            _agents(found.get("receiver"), ":receiver"),
            _agents(found.get("reply-to"), ":reply-to"),
            content=texts.get("content"),
            language=texts.get("language"),
            encoding=texts.get("encoding"),
            ontology=texts.get("ontology"),
            protocol=texts.get("protocol"),
            conversation_id=texts.get("conversation-id"),
            reply_with=texts.get("reply-with"),
            in_reply_to=texts.get("in-reply-to"),
            reply_by=texts.get("reply-by"),
            user=tuple((key, text_of(value, f":{key[:40]}")) for key, value in found.items() if key.startswith("x-")),
        )
    except SymbolicExpressionError:
        raise
    except ValueError as error:
        raise SymbolicExpressionError(str(error), whole.at) from None


def _parameters(whole: Expression, act: str) -> dict[str, Expression]:
    """Return a message's parameters by name. Raises `SymbolicExpressionError` for an unknown parameter."""
    found = parameters(items_of(whole, (act,), "a message"), "the message")
    for key, value in found.items():
        if key not in _KNOWN and not key.startswith("x-"):
            raise SymbolicExpressionError(
                f"the parameter :{key[:40]} is unknown; user-defined parameters must begin with :X-", value.at
            )
    return found


def _agents(expression: Expression | None, what: str) -> tuple[AgentIdentifier, ...]:
    return () if expression is None else tuple(map(identifier_of, items_of(expression, ("set",), what)))
