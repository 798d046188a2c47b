"""Problems whose values are easy to find in messages, and finding them."""

from __future__ import annotations

from robochoc.model.problem import Constraint, Relation, Semantics
from robochoc.protocols.message import Envelope
from tests.support.cost_problems import with_costs
from tests.support.problems import team_of


def priced(first: str, second: str, rows: dict[tuple[int, int], float]) -> Constraint:
    relation = Relation(f"{first}{second}", 2, Semantics.SOFT, tuple(rows), tuple(rows.values()))
    return Constraint("c", relation, (first, second), (first, second))


FAR: dict[tuple[int, int], float] = {(711, 811): 97, (711, 812): 1, (712, 811): 1, (712, 812): 98}
RING = with_costs(
    team_of(
        {"AAA": (711, 712), "BBB": (811, 812), "CCC": (711, 712), "DDD": (811, 812)},
        [priced("AAA", "BBB", FAR), priced("CCC", "BBB", FAR), priced("CCC", "DDD", FAR), priced("AAA", "DDD", FAR)],
    )
)
"""Four robots in a ring; two of them share no constraint."""


def told_values(envelope: Envelope) -> set[int]:
    """The values of the team that stand in a message as msgpack writes them."""
    return {value for value in (711, 712, 811, 812) if b"\xcd" + value.to_bytes(2, "big") in envelope.content}


def own_values(robot: str) -> set[int]:
    return {value for name in RING[robot].interface for value in RING.variables[name].domain}
