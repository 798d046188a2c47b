"""The traffic whose transport is measured: tokens that run round a ring, and robots of robochoc that pass them on.

Every agent has eight neighbours, four on each side, and sends each a token. Whoever gets a token passes it on in
the same direction, as far again, until it has made its hops. So every edge carries `hops` messages, whatever the
order in which things happen, and no pipe ever holds more than fits.
"""

from __future__ import annotations

from typing import ClassVar, cast

from robochoc.model.problem import Child, Domain, Parent, Robot, Team, Variable
from robochoc.protocols.message import Message
from robochoc.protocols.order import PriorityOrder
from robochoc.protocols.protocol import Protocol
from robochoc.solver.local_problem import LocalProblem

OFFSETS = (-4, -3, -2, -1, 1, 2, 3, 4)
CARGO = bytes(30)
"""Makes a message of about 50 bytes, the clock that travels with it included."""


class Token(Message, frozen=True):
    """What runs round."""

    hops: int
    cargo: bytes


class Ring(Protocol):
    """One robot of a ring of `agents`; every token makes `hops` hops."""

    messages = Token
    agents: ClassVar[int]
    hops: ClassVar[int]

    def __init__(self, problem: LocalProblem, order: PriorityOrder) -> None:
        super().__init__(problem, order)
        place = int(problem.agent.removeprefix("Robot"))
        self.onward = {_name(place - offset, self.agents): _name(place + offset, self.agents) for offset in OFFSETS}

    def start(self) -> None:
        """One token for each neighbour, unless nothing is to be sent at all."""
        if self.hops:
            for receiver in self.onward.values():
                self.send(receiver, Token(self.hops - 1, CARGO))

    def receive(self, sender: str, message: Message) -> None:
        """Pass the token on, unless it has made its hops."""
        token = cast("Token", message)
        if token.hops:
            self.send(self.onward[sender], Token(token.hops - 1, token.cargo))


def ring_protocol(agents: int, hops: int) -> type[Ring]:
    """`Ring` for so many agents and hops: how many they are is no matter of a robot's own problem."""
    return cast("type[Ring]", type("Ring", (Ring,), {"agents": agents, "hops": hops}))


def ring_team(agents: int) -> Team:
    """A robot an agent; they know their neighbours, and have no constraints."""
    return Team(f"ring-{agents}", tuple(_robot(place, agents) for place in range(agents)))


def messages(agents: int, hops: int) -> int:
    """How many messages a run comes to."""
    return agents * len(OFFSETS) * hops


def _robot(place: int, agents: int) -> Robot:
    near = sorted({(place + offset) % agents for offset in OFFSETS})
    return Robot(
        name=_name(place, agents),
        variables=(Variable(f"V{place}", Domain("D", (range(1),))),),
        parents=tuple(Parent(_name(other, agents)) for other in near if other < place),
        children=tuple(Child(_name(other, agents)) for other in near if other > place),
    )


def _name(place: int, agents: int) -> str:
    return f"Robot{place % agents}"
