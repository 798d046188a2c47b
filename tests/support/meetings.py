"""Meeting scheduling as FRODO's users have it: agents with two to four variables, a copy of each meeting a guest.

PEAV (Maheswaran, Tambe, Bowring, Pearce and Varakantham, AAMAS 2004): each agent has a variable for each of its
meetings; copies of a meeting are equal, and an agent's meetings are at different times.
"""

from __future__ import annotations

import itertools
from random import Random

from robochoc.formats import PREDEFINED
from robochoc.model.problem import Constraint, Relation, Semantics, Team
from tests.support.complex_problems import complex_team


def meetings(chance: Random, *, agents: int = 8, slots: int = 8) -> Team:
    """`agents` with two to four meetings each, two or three guests a meeting, and hours that some cannot."""
    left = {f"Agent{number}": chance.randint(2, 4) for number in range(1, agents + 1)}
    owned: dict[str, list[str]] = {name: [] for name in left}
    copies: list[list[str]] = []
    while len(open_still := [name for name in left if left[name]]) > 1:
        guests = chance.sample(open_still, min(len(open_still), chance.choice((2, 2, 3))))
        copies.append([f"m{len(copies) + 1}.{guest}" for guest in guests])
        for guest, copy in zip(guests, copies[-1], strict=True):
            left[guest] -= 1
            owned[guest].append(copy)
    while alone := [name for name in left if not owned[name] or len(owned[name]) < 2]:
        owned[alone[0]].append(f"own{len(owned[alone[0]]) + 1}.{alone[0]}")
    domains = {name: range(1, slots + 1) for names in owned.values() for name in names}
    pairs = [(pair, "eq") for meeting in copies for pair in itertools.combinations(meeting, 2)]
    pairs += [(pair, "ne") for names in owned.values() for pair in itertools.combinations(names, 2)]
    constraints = [Constraint(name, PREDEFINED[name], pair, pair) for pair, name in pairs]
    for name in domains:
        busy = tuple((slot,) for slot in chance.sample(range(1, slots + 1), chance.randint(0, slots // 2)))
        constraints.append(Constraint("busy", Relation(f"busy_{name}", 1, Semantics.CONFLICTS, busy), (name,), (name,)))
    return complex_team(owned, domains, constraints)
