"""Agent identifiers (AID) of FIPA00023: the globally unique name of an agent, and its addresses."""

from __future__ import annotations

import msgspec

from robochoc.services.symbolic import (
    Expression,
    List,
    SymbolicExpressionError,
    Word,
    items_of,
    list_of,
    name,
    parameters,
    text_of,
)

WHAT = "an agent-identifier"


class AgentIdentifier(msgspec.Struct, frozen=True):
    """`name` is the agent's name, `@`, and its platform's name: `Robot3.1@192.168.1.14:7447/robochoc`.

    `addresses` are the agent's addresses, the preferred first; `resolvers` are agents that may know further addresses.
    """

    name: str
    addresses: tuple[str, ...] = ()
    resolvers: tuple[AgentIdentifier, ...] = ()

    @property
    def local(self) -> str:
        """The agent's name on its platform; the whole name if the name contains no platform."""
        return self.name.rpartition("@")[0] or self.name

    @property
    def platform(self) -> str:
        """The platform in the name; empty if the name contains no platform."""
        local, _, platform = self.name.rpartition("@")
        return platform if local else ""


def identifier_on(platform: str, local: str, addresses: tuple[str, ...] = ()) -> AgentIdentifier:
    """Return the identifier of the agent `local` on `platform`.

    Raises `ValueError` if the two names could not be separated again.
    """
    if not local or not platform or "@" in platform:
        raise ValueError(f"{local!r} on platform {platform!r}: both need a name, and the platform's has no '@'")
    return AgentIdentifier(f"{local}@{platform}", addresses)


def expression_of(identifier: AgentIdentifier) -> List:
    """Return `(agent-identifier :name ... :addresses (sequence ...) :resolvers (sequence ...))` without empty parts."""
    items: list[Expression] = [Word(":name"), name(identifier.name)]
    if identifier.addresses:
        items += [Word(":addresses"), list_of("sequence", *map(name, identifier.addresses))]
    if identifier.resolvers:
        items += [Word(":resolvers"), list_of("sequence", *map(expression_of, identifier.resolvers))]
    return list_of("agent-identifier", *items)


def identifier_of(expression: Expression) -> AgentIdentifier:
    """Return the identifier in `expression`, ignoring user-defined parameters (`:X-...`).

    Raises `SymbolicExpressionError`. Recurses into resolvers, up to the depth allowed by the reader of the expression.
    """
    found = parameters(items_of(expression, ("agent-identifier",), WHAT), WHAT)
    for key, value in found.items():
        if key not in {"name", "addresses", "resolvers"} and not key.startswith("x-"):
            raise SymbolicExpressionError(f"{WHAT} has no parameter :{key[:40]}", value.at)
    if "name" not in found or not (called := text_of(found["name"], "the name of an agent")):
        raise SymbolicExpressionError(f"{WHAT} needs a :name", expression.at)
    return AgentIdentifier(
        called,
        tuple(text_of(one, "an address") for one in _sequence(found.get("addresses"), ":addresses")),
        tuple(map(identifier_of, _sequence(found.get("resolvers"), ":resolvers"))),
    )


def _sequence(expression: Expression | None, what: str) -> tuple[Expression, ...]:
    return () if expression is None else items_of(expression, ("sequence",), what)
