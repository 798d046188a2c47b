"""Robots of DPOP that have their places, and what they say."""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Sequence
from typing import TypeVar

from robochoc.model.problem import Constraint, Relation, Semantics, Team
from robochoc.protocols.inference.dpop import DPOP, Dimensions, Domain, Need
from robochoc.protocols.inference.mb_dpop import MBDPOP, DomainAtDepth
from robochoc.protocols.message import Message
from robochoc.protocols.protocol import Protocol
from robochoc.protocols.settings import equip
from tests.support.agents import replies
from tests.support.cost_problems import with_costs
from tests.support.problems import team_of
from tests.support.pseudo_trees import placed

PRODUCT = Relation("R", 2, Semantics.SOFT, tuple(itertools.product((1, 2, 3), repeat=2)), (1, 2, 3, 2, 4, 6, 3, 6, 9))
"""Two values cost their product."""
FEW = Need(1, "RX")
P = TypeVar("P", bound=MBDPOP)


def products(names: str, pairs: str, values: Sequence[int] = (1, 2, 3)) -> Team:
    """A robot for each letter; each of `pairs` pays the product of its values."""
    constraints = [Constraint("C", PRODUCT, (pair[0], pair[1]), (pair[0], pair[1])) for pair in pairs.split()]
    return with_costs(team_of(dict.fromkeys(names, values), constraints))


def begun(team: Team, name: str, above: str = "", below: str = "", further: str = "") -> DPOP:
    """One robot, with nothing left to say: below the first of `above`, with children `below` and pseudo-children."""
    over, under, pseudo = ([f"R{letter}" for letter in letters] for letters in (above, below, further))
    parent = over[0] if over else None
    robot = placed(DPOP, team, name, parent, pseudo_parents=over[1:], children=under, pseudo_children=pseudo)
    robot.outbox.clear()
    return robot


def domain(values: Iterable[int] = (1, 2, 3)) -> Domain:
    return Domain([(value,) for value in values])


def dimensions(sizes: dict[str, int], dearest: int = 9, width: int = 1, most: Need = FEW) -> Dimensions:
    return Dimensions(sizes, dearest, width, most)


def bounded(protocol: type[P], team: Team, name: str, above: str = "", below: str = "", k: int = 1) -> P:
    """One robot of MB-DPOP or RMB-DPOP below the robots of `above`, nearest first, of which the last is the root."""
    over, under = ([f"R{letter}" for letter in letters] for letters in (above, below))
    robot = placed(protocol, team, name, over[0] if over else None, pseudo_parents=over[1:], children=under)
    equip(robot, {"k": str(k)})
    for depth, one in enumerate(reversed(over)):
        robot.receive(one, DomainAtDepth(depth, [(1,), (2,), (3,)]))
    robot.settle()
    return robot


def told(robot: Protocol, *packet: tuple[str, Message]) -> list[tuple[str, Message]]:
    """Return what `robot` sends after a packet, without what it has sent before."""
    robot.outbox.clear()
    return replies(robot, *packet)


def leaf(team: Team, name: str = "RC") -> DPOP:
    """The lowest of three, which has told its separator."""
    robot = begun(team, name, "BA")
    replies(robot, ("RB", domain()), ("RA", domain()))
    return robot
