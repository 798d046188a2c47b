"""Agent identifiers (AID) of FIPA00023: the name of an agent in the whole world, and where it can be reached."""

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
    """`name` is the agent's, `@`, and its platform's: `Robot3.1@192.168.1.14:7447/robochoc`.

    `addresses` say how to reach it, the best one first; `resolvers` are agents who may know where it is.
    """

    name: str
    addresses: tuple[str, ...] = ()
    resolvers: tuple[AgentIdentifier, ...] = ()

    @property
    def local(self) -> str:
        """The agent's name on its platform; the whole name where no platform is named."""
        return self.name.rpartition("@")[0] or self.name

    @property
    def platform(self) -> str:
        """The platform that has given the name; empty where none is named."""
        local, _, platform = self.name.rpartition("@")
        return platform if local else ""


def identifier_on(platform: str, local: str, addresses: tuple[str, ...] = ()) -> AgentIdentifier:
    """Return the agent called `local` on `platform`.

    Raises `ValueError` where the two could not be told apart again.
    """
    if not local or not platform or "@" in platform:
        raise ValueError(f"{local!r} on platform {platform!r}: both need a name, and the platform's has no '@'")
    return AgentIdentifier(f"{local}@{platform}", addresses)


def expression_of(identifier: AgentIdentifier) -> List:
    """`(agent-identifier :name ... :addresses (sequence ...) :resolvers (sequence ...))`, without what is empty."""
    items: list[Expression] = [Word(":name"), name(identifier.name)]
    if identifier.addresses:
        items += [Word(":addresses"), list_of("sequence", *map(name, identifier.addresses))]
    if identifier.resolvers:
        items += [Word(":resolvers"), list_of("sequence", *map(expression_of, identifier.resolvers))]
    return list_of("agent-identifier", *items)


def identifier_of(expression: Expression) -> AgentIdentifier:
    """Return the identifier that `expression` is; parameters of others' own (`:X-...`) are passed over.

    Raises `SymbolicExpressionError`. Recurses into resolvers, as deep as the reader of the expression allowed.
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
