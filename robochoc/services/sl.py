"""The content of messages to and from the Directory Facilitator, in FIPA-SL0 (FIPA00008) with the terms of FIPA00023.

>>> from robochoc.services.descriptions import AgentDescription
>>> template = AgentDescription(protocols=("abt",))
>>> print(request(df_on("host:7447/robochoc"), DirectoryFunction.SEARCH, template, max_results=2))
((action (agent-identifier :name df@host:7447/robochoc) (search (df-agent-description :protocols (set abt)) \
(search-constraints :max-results 2))))
"""

from __future__ import annotations

import re
from collections.abc import Iterable
from enum import StrEnum
from typing import NamedTuple

from robochoc.services.descriptions import AgentDescription, Reason, RequestRefusedError, ServiceDescription
from robochoc.services.identifier import AgentIdentifier, expression_of, identifier_of, identifier_on
from robochoc.services.symbolic import (
    Caps,
    Expression,
    List,
    SymbolicExpressionError,
    Word,
    head_of,
    items_of,
    list_of,
    name,
    parameters,
    read,
    text_form,
    text_of,
)

REQUEST_CAPS = Caps(characters=1 << 18, expressions=20_000, depth=16)
ANSWER_CAPS = Caps(characters=1 << 24, expressions=2_000_000, depth=16)
DIRECTORY = "df"
"""The local name of the Directory Facilitator on every platform (FIPA00023)."""

_AGENT, _SERVICE, _PROPERTY = "df-agent-description", "service-description", "property"
_NAMES = ("protocols", "ontologies", "languages")
_LEASE = re.compile(r"\+000000([0-9]{2})T([0-9]{2})([0-9]{2})([0-9]{2})([0-9]{3})")
_COUNT = re.compile(r"[+-]?[0-9]{1,9}")


class DirectoryFunction(StrEnum):
    """A function of the Directory that agents can request."""

    REGISTER = "register"
    DEREGISTER = "deregister"
    MODIFY = "modify"
    SEARCH = "search"


class DirectoryAction(NamedTuple):
    """A requested action: the `(action ...)` expression, the actor, the name of the function, and the arguments."""

    expression: Expression
    actor: AgentIdentifier
    function: str
    arguments: tuple[Expression, ...]


def df_on(platform: str) -> AgentIdentifier:
    """Return the Directory Facilitator of `platform`."""
    return identifier_on(platform, DIRECTORY)


def request(
    df: AgentIdentifier, function: DirectoryFunction, description: AgentDescription, max_results: int | None = None
) -> str:
    """Return the content of a REQUEST to `df` for `function`; in a search, `description` is a template."""
    arguments: list[Expression] = [described(description)]
    if function == DirectoryFunction.SEARCH:
        constraints = () if max_results is None else (Word(":max-results"), Word(str(max_results)))
        arguments.append(list_of("search-constraints", *constraints))
    return content_of(list_of("action", expression_of(df), list_of(function, *arguments)))


def action_in(content: str) -> DirectoryAction:
    """Return the action in the content of a REQUEST. Raises `SymbolicExpressionError`."""
    (whole,) = _content(content, REQUEST_CAPS)
    what = "an action"
    actor_and_act = items_of(whole, ("action",), what)
    if len(actor_and_act) != 2:  # noqa: PLR2004 - the actor, and the act
        raise SymbolicExpressionError("an action is (action <agent-identifier> (<function> ...))", whole.at)
    actor, act = actor_and_act
    function = head_of(act, "the act of an action")
    return DirectoryAction(whole, identifier_of(actor), function, items_of(act, (function,), what))


def descriptions_in(content: str) -> tuple[AgentDescription, ...]:
    """Return the descriptions in the answer to a search, an INFORM `((result <action> (set ...)))`.

    Raises `SymbolicExpressionError`, and `RequestRefusedError` for unknown parameters in a description.
    """
    (whole,) = _content(content, ANSWER_CAPS)
    parts = items_of(whole, ("result",), "the answer to a search")
    if len(parts) != 2:  # noqa: PLR2004 - the action, and its result
        raise SymbolicExpressionError("a result is (result <action> <set>)", whole.at)
    return tuple(map(description_of, _members(parts[1], "the result of a search")))


def searched_in(content: str) -> AgentDescription:
    """Return the search expression of the result `content`.

    Raises `SymbolicExpressionError`, and `RequestRefusedError`.
    """
    (whole,) = _content(content, ANSWER_CAPS)
    action = items_of(whole, ("result",), "the answer to a search")[0]
    _, act = items_of(action, ("action",), "an action")
    return description_of(items_of(act, (DirectoryFunction.SEARCH,), "a search")[0])


def content_of(*expressions: Expression) -> str:
    """Return the content of a message, which is its expressions in parentheses."""
    return text_form(List(expressions))


def described(description: AgentDescription) -> List:
    """Return `(df-agent-description ...)` without empty parts."""
    items: list[Expression] = []
    if description.name:
        items += [Word(":name"), expression_of(AgentIdentifier(description.name, description.addresses))]
    items += _set("services", map(_service_text, description.services))
    items += _names_text(description)
    if description.lease_s is not None:
        items += [Word(":lease-time"), Word(_lease_text(description.lease_s))]
    return list_of(_AGENT, *items)


def description_of(expression: Expression) -> AgentDescription:
    """Return the description in `(df-agent-description ...)`.

    Raises `SymbolicExpressionError` for other expressions, and `RequestRefusedError` for invalid parameters and values.
    """
    slots = _slots(expression, _AGENT, {"name", "services", *_NAMES, "lease-time"})
    identifier = identifier_of(slots["name"]) if "name" in slots else AgentIdentifier("")
    return AgentDescription(
        identifier.name,
        tuple(map(_service_of, _members(slots.get("services"), ":services"))),
        _names(slots, "protocols"),
        _names(slots, "ontologies"),
        _names(slots, "languages"),
        _lease_of(slots["lease-time"]) if "lease-time" in slots else None,
        identifier.addresses,
    )


def max_results_of(expression: Expression) -> int | None:
    """Return the maximum number of results in `(search-constraints ...)`; None for all.

    Other parameters are for federations, and are ignored. Raises the same exceptions as `description_of`.
    """
    slots = _slots(expression, "search-constraints", {"max-results", "max-depth", "search-id"})
    if "max-results" not in slots:
        return None
    count = text_of(slots["max-results"], ":max-results")
    if not _COUNT.fullmatch(count):
        raise RequestRefusedError(Reason.UNRECOGNISED_PARAMETER_VALUE, "search-constraints", "max-results")
    return int(count)


def _content(content: str, caps: Caps) -> tuple[Expression]:
    """Return the only expression in the outer parentheses."""
    outer = read(content, caps)
    if not isinstance(outer, List) or len(outer.items) != 1:
        raise SymbolicExpressionError("the content must be one expression in parentheses: ((action ...))", outer.at)
    return (outer.items[0],)


def _service_text(service: ServiceDescription) -> List:
    items: list[Expression] = []
    for key in ("name", "type", "ownership"):
        if text := getattr(service, key):
            items += [Word(f":{key}"), name(text)]
    items += _names_text(service)
    items += _set(
        "properties",
        (
            list_of(_PROPERTY, Word(":name"), name(key), Word(":value"), name(value))
            for key, value in service.properties
        ),
    )
    return list_of(_SERVICE, *items)


def _service_of(expression: Expression) -> ServiceDescription:
    slots = _slots(expression, _SERVICE, {"name", "type", "ownership", *_NAMES, "properties"})
    return ServiceDescription(
        _text(slots, "name"),
        _text(slots, "type"),
        _text(slots, "ownership"),
        _names(slots, "protocols"),
        _names(slots, "ontologies"),
        _names(slots, "languages"),
        tuple(map(_property_of, _members(slots.get("properties"), ":properties"))),
    )


def _property_of(expression: Expression) -> tuple[str, str]:
    slots = _slots(expression, _PROPERTY, {"name", "value"})
    for key in ("name", "value"):
        if key not in slots:
            raise RequestRefusedError(Reason.MISSING_PARAMETER, _PROPERTY, key)
    return text_of(slots["name"], "a property's name"), text_of(slots["value"], "a property's value")


def _slots(expression: Expression, what: str, known: set[str]) -> dict[str, Expression]:
    """Return the parameters in `(what ...)`, including user-defined parameters (`:X-...`).

    Raises `RequestRefusedError` for other unknown parameters.
    """
    slots = parameters(items_of(expression, (what,), f"a {what}"), f"a {what}")
    for key in slots:
        if key not in known and not key.startswith("x-"):
            raise RequestRefusedError(Reason.UNEXPECTED_PARAMETER, what, key[:40])
    return slots


def _members(expression: Expression | None, what: str) -> tuple[Expression, ...]:
    """Return the elements of a set, or of a sequence, which JADE writes instead of the sets in FIPA00023."""
    return () if expression is None else items_of(expression, ("set", "sequence"), what)


def _text(slots: dict[str, Expression], key: str) -> str:
    return text_of(slots[key], f":{key}") if key in slots else ""


def _names(slots: dict[str, Expression], key: str) -> tuple[str, ...]:
    return tuple(text_of(one, f"each of :{key}") for one in _members(slots.get(key), f":{key}"))


def _names_text(description: AgentDescription | ServiceDescription) -> list[Expression]:
    return [item for key in _NAMES for item in _set(key, map(name, getattr(description, key)))]


def _set(key: str, members: Iterable[Expression]) -> list[Expression]:
    """Return `:key (set ...)`; empty for an empty set."""
    items = tuple(members)
    return [Word(f":{key}"), list_of("set", *items)] if items else []


def _lease_text(lease_s: float) -> str:
    """Return a relative DateTime (FIPA00008) in whole milliseconds, at least one."""
    seconds, milliseconds = divmod(max(1, round(lease_s * 1000)), 1000)
    minutes, second = divmod(seconds, 60)
    hours, minute = divmod(minutes, 60)
    days, hour = divmod(hours, 24)
    return f"+000000{days:02}T{hour:02}{minute:02}{second:02}{milliseconds:03}"


def _lease_of(expression: Expression) -> float:
    """Return a lease in seconds. Absolute times are refused, since the Directory has no wall clock."""
    found = _LEASE.fullmatch(text_of(expression, ":lease-time"))
    if not found:
        raise RequestRefusedError(Reason.UNRECOGNISED_PARAMETER_VALUE, _AGENT, "lease-time")
    days, hours, minutes, seconds, milliseconds = map(int, found.groups())
    whole = ((days * 24 + hours) * 60 + minutes) * 60 + seconds
    return (whole * 1000 + milliseconds) / 1000
