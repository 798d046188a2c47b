"""A team of three in which one may lie, and the master's state of a search as it has begun."""

from __future__ import annotations

from robochoc.communication.network.audited_state import AuditedSearchState
from robochoc.communication.network.plausibility import Declarations
from robochoc.model.problem import Constraint
from robochoc.protocols.satisfaction.afc import AFC
from robochoc.protocols.traits import Traits
from tests.support.problems import PREDICATES, team_of

DIFFERENT = [Constraint("C", PREDICATES[0], pair, pair) for pair in (("A", "B"), ("B", "C"))]
CHAIN = team_of(dict.fromkeys("ABC", (1, 2)), DIFFERENT)
"""RA, RB and RC, each other than the one before: it has two solutions."""
VALUES = {"A": 1, "B": 2, "C": 1}


def begun(traits: Traits = AFC.traits) -> AuditedSearchState:
    state = AuditedSearchState(1, ("RA", "RB", "RC"), None, Declarations(traits))
    state.ordered = True
    return state
