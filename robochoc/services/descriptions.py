"""Descriptions of agents in the Directory Facilitator, and comparison with templates (FIPA00023)."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from enum import StrEnum
from itertools import chain
from typing import assert_never

import msgspec

from robochoc.system.errors import RobochocError

MAX_SERVICES = 64
MAX_NAMES = 256
"""The maximum number of protocols, ontologies, languages or addresses in one description."""
MAX_PROPERTIES = 1024
MAX_CHARACTERS = 1024
"""The maximum length of a name or value, in characters."""
MAX_SIZE = 1 << 16
"""The maximum total length of one description, in characters."""
MAX_LEASE_S = 99 * 86_400.0
"""The longest lease, in seconds. More days must be given in months in FIPA's relative times, without a fixed length."""


class Reason(StrEnum):
    """The reason for the failure of a request: the name of a proposition in FIPA00023."""

    UNAUTHORISED = "unauthorised"
    UNSUPPORTED_FUNCTION = "unsupported-function"
    MISSING_ARGUMENT = "missing-argument"
    UNEXPECTED_ARGUMENT = "unexpected-argument"
    MISSING_PARAMETER = "missing-parameter"
    UNEXPECTED_PARAMETER = "unexpected-parameter"
    UNRECOGNISED_PARAMETER_VALUE = "unrecognised-parameter-value"
    ALREADY_REGISTERED = "already-registered"
    NOT_REGISTERED = "not-registered"
    INTERNAL_ERROR = "internal-error"


FAILURES = frozenset({Reason.ALREADY_REGISTERED, Reason.NOT_REGISTERED, Reason.INTERNAL_ERROR})
"""Reasons that are found during a request, and answered by FAILURE. For other reasons, requests are refused."""


class RequestRefusedError(RobochocError):
    """The Directory refuses a request for `reason`, a proposition with the arguments `about`."""

    def __init__(self, reason: Reason, *about: str) -> None:
        super().__init__(" ".join((reason, *about)))
        self.reason = reason
        self.about = about


class ServiceDescription(msgspec.Struct, frozen=True):
    """One service of an agent. Empty fields in a template match everything."""

    name: str = ""
    type: str = ""
    ownership: str = ""
    protocols: tuple[str, ...] = ()
    ontologies: tuple[str, ...] = ()
    languages: tuple[str, ...] = ()
    properties: tuple[tuple[str, str], ...] = ()
    """Pairs of a name and a value."""


class AgentDescription(msgspec.Struct, frozen=True):
    """An agent, by the name in its AID, and its services. Empty fields in a template match everything.

    `lease_s` is the duration of the registration in seconds; None: until the agent leaves.
    """

    name: str = ""
    services: tuple[ServiceDescription, ...] = ()
    protocols: tuple[str, ...] = ()
    ontologies: tuple[str, ...] = ()
    languages: tuple[str, ...] = ()
    lease_s: float | None = None
    addresses: tuple[str, ...] = ()


def matches(template: AgentDescription, description: AgentDescription) -> bool:
    """Return whether `description` matches `template` (FIPA00023, the search function).

    Names must be equal, or equal before `@` if the template's name has no `@`. Sets must contain those in the template,
    and each service in the template must match a service of the agent. The lease is ignored.
    """
    return (
        template.name in {"", description.name, description.name.partition("@")[0]}
        and _has_all(template, description, ("protocols", "ontologies", "languages", "addresses"))
        and all(
            any(_service_matches(asked, offered) for offered in description.services) for asked in template.services
        )
    )


def check_description(description: AgentDescription) -> None:
    """Raise `RequestRefusedError` if a registration lacks a name, or exceeds a limit of the Directory."""
    what = "df-agent-description"
    if not description.name:
        raise RequestRefusedError(Reason.MISSING_PARAMETER, what, "name")
    for service in description.services:
        for parameter in ("name", "type"):
            if not getattr(service, parameter):
                raise RequestRefusedError(Reason.MISSING_PARAMETER, "service-description", parameter)
    lease_s = description.lease_s
    if lease_s is not None and not (math.isfinite(lease_s) and 0 < lease_s <= MAX_LEASE_S):
        raise RequestRefusedError(Reason.UNRECOGNISED_PARAMETER_VALUE, what, "lease-time")
    check_bounds(description)


def check_bounds(description: AgentDescription) -> None:
    """Raise `RequestRefusedError` if a description or a template exceeds a limit of the Directory."""
    _bound("df-agent-description", "services", description.services, MAX_SERVICES)
    _bound_strings("df-agent-description", description, ("protocols", "ontologies", "languages", "addresses"))
    _bound_text("df-agent-description", "name", (description.name,))
    size = sum(map(len, _texts(description)))
    if size > MAX_SIZE:
        raise RequestRefusedError(
            Reason.INTERNAL_ERROR, f"a description of {size} characters is too large: at most {MAX_SIZE}"
        )
    for service in description.services:
        _bound_strings("service-description", service, ("protocols", "ontologies", "languages"))
        _bound("service-description", "properties", service.properties, MAX_PROPERTIES)
        _bound_text("service-description", "properties", (text for pair in service.properties for text in pair))
        for parameter in ("name", "type", "ownership"):
            _bound_text("service-description", parameter, (getattr(service, parameter),))


def _service_matches(asked: ServiceDescription, offered: ServiceDescription) -> bool:
    return (
        asked.name in {"", offered.name}
        and asked.type in {"", offered.type}
        and asked.ownership in {"", offered.ownership}
        and _has_all(asked, offered, ("protocols", "ontologies", "languages", "properties"))
    )


def _has_all(template: msgspec.Struct, description: msgspec.Struct, parameters: Iterable[str]) -> bool:
    asked = ((getattr(template, parameter), parameter) for parameter in parameters)
    return all(set(wanted) <= set(getattr(description, parameter)) for wanted, parameter in asked if wanted)


def _texts(description: AgentDescription | ServiceDescription) -> Iterator[str]:
    yield description.name
    for several in (description.protocols, description.ontologies, description.languages):
        yield from several
    match description:
        case AgentDescription(services=services, addresses=addresses):
            yield from addresses
            for service in services:
                yield from _texts(service)
        case ServiceDescription(type=kind, ownership=ownership, properties=properties):
            yield from (kind, ownership, *chain.from_iterable(properties))
        case never:
            assert_never(never)


def _bound_strings(what: str, description: msgspec.Struct, parameters: Iterable[str]) -> None:
    for parameter in parameters:
        texts: tuple[str, ...] = getattr(description, parameter)
        _bound(what, parameter, texts, MAX_NAMES)
        _bound_text(what, parameter, texts)


def _bound(what: str, parameter: str, items: tuple[object, ...], most: int) -> None:
    if len(items) > most:
        raise RequestRefusedError(Reason.UNRECOGNISED_PARAMETER_VALUE, what, parameter)


def _bound_text(what: str, parameter: str, texts: Iterable[str]) -> None:
    if any(len(text) > MAX_CHARACTERS for text in texts):
        raise RequestRefusedError(Reason.UNRECOGNISED_PARAMETER_VALUE, what, parameter)
