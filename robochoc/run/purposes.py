"""Purposes of protocols, derived from the protocols' traits: the groups of `robochoc protocols --for`."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

from robochoc.protocols.traits import Traits


class Purpose(NamedTuple):
    """A group of protocols: its description, and the condition on the traits of its members."""

    description: str
    includes: Callable[[Traits], bool]


_HIDDEN = ("values", "who they are")
"""Words in `Traits.privacy` that mark a protocol as hiding more than constraints."""
_LARGE = ("large team", "hundreds of robots", "many robots")
"""Words in `Traits.use_when` that mark a protocol as suitable for large teams."""


def _is_for_large_teams(traits: Traits) -> bool:
    in_cycles = traits.bears_loss and not traits.complete
    return in_cycles or traits.arrays or any(words in traits.use_when for words in _LARGE)


PURPOSES = {
    "satisfaction": Purpose("any solution, no costs", lambda traits: not traits.costs),
    "costs": Purpose("minimum or low cost; without costs any solution", lambda traits: traits.costs),
    "optimum": Purpose("minimum cost, with a proof", lambda traits: traits.costs and traits.complete),
    "asymmetric": Purpose(
        "as costs, with a cost for each robot of a constraint", lambda traits: traits.costs and traits.asymmetric
    ),
    "large-teams": Purpose("hundreds of robots or more; most without a proof", _is_for_large_teams),
    "privacy": Purpose(
        "values, domains or identities stay hidden, not only constraints",
        lambda traits: any(words in traits.privacy for words in _HIDDEN),
    ),
    "change": Purpose("continue when the problem changes", lambda traits: traits.dynamic),
    "lost-messages": Purpose("continue when messages are lost", lambda traits: traits.bears_loss),
    "counting": Purpose(
        "count or list all solutions or optima",
        lambda traits: (
            traits.counts or any(word in traits.use_when for word in ("counting", "count solutions", "listing"))
        ),
    ),
    "objectives": Purpose("the Pareto front of several objectives", lambda traits: traits.fronts),
    "tasks": Purpose("auctions and coalitions, for task allocations only", lambda traits: traits.allocates),
    "comparison": Purpose(
        "baselines and predecessors, for studies",
        lambda traits: any(words in traits.use_when for words in ("to compare", "baseline")),
    ),
}
"""The purposes by their names on the command line. A protocol can have several purposes."""


def purposes_of(traits: Traits) -> tuple[str, ...]:
    """Return the names of all purposes of a protocol with these traits."""
    return tuple(name for name, purpose in PURPOSES.items() if purpose.includes(traits))
