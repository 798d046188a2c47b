"""The traffic of part `network`: balls of about 200 bytes that two players hit to each other, by whatever joins them.

One ball shows the round trip; many at once, how many messages a second get through. Fewer bytes are under way than a
pipe holds. Robots that play so are in it too: there the protocol, the host and the counters are part of the way.
"""

from __future__ import annotations

import time
from typing import ClassVar, cast
from typing import Protocol as Interface

from robochoc.model.problem import Child, Domain, Parent, Robot, Team, Variable
from robochoc.protocols.message import Message
from robochoc.protocols.order import PriorityOrder
from robochoc.protocols.protocol import Protocol
from robochoc.solver.local_problem import LocalProblem

SIZE = 200
CARGO = bytes(SIZE - 15)
"""Makes a message of about 200 bytes of robots, with what goes round it."""


class End(Interface):
    """One end of what joins two players."""

    def send(self, content: bytes) -> None:
        """Hit a ball."""

    def receive(self) -> bytes:
        """Wait for the next one."""


def play(end: End, balls: int, hits: int) -> float:
    """Serve `balls`, and hit each of them `hits` times, the partner as often; seconds until the last is back."""
    content = bytes(SIZE)
    end.send(content)  # whatever is opened with the first message is no part of it
    end.receive()
    began = time.perf_counter()
    for _ in range(balls):
        end.send(content)
    for left in range(balls * hits, 0, -1):
        content = end.receive()
        if left > balls:
            end.send(content)
    return time.perf_counter() - began


def return_all(end: End, balls: int, hits: int) -> None:
    """The partner's part."""
    for _ in range(balls * hits + 1):
        end.send(end.receive())


class Ball(Message, frozen=True):
    """What is hit to and fro."""

    hits: int
    cargo: bytes


class Rally(Protocol):
    """One of two robots; the first serves `balls`, and each ball is hit `hits` times by both together."""

    messages = Ball
    balls: ClassVar[int]
    hits: ClassVar[int]

    def __init__(self, problem: LocalProblem, order: PriorityOrder) -> None:
        super().__init__(problem, order)
        self.serves = problem.agent == "Robot0"

    def start(self) -> None:
        """Serve."""
        if self.serves:
            for _ in range(self.balls):
                self.send("Robot1", Ball(self.hits - 1, CARGO))

    def receive(self, sender: str, message: Message) -> None:
        """Hit the ball back, unless it was hit often enough."""
        ball = cast("Ball", message)
        if ball.hits:
            self.send(sender, Ball(ball.hits - 1, CARGO))


class LongRally(Rally):
    """One ball, hit often."""

    balls = 1
    hits = 2_000


class ShortRally(Rally):
    """One ball, hit so seldom that it is all start and end."""

    balls = 1
    hits = 2


class ManyBalls(Rally):
    """Many at once."""

    balls = 200
    hits = 50


def pair() -> Team:
    """Two robots that know each other, and have no constraints."""
    domain = Domain("D", (range(1),))
    return Team(
        "pair",
        (
            Robot(name="Robot0", variables=(Variable("V0", domain),), children=(Child("Robot1"),)),
            Robot(name="Robot1", variables=(Variable("V1", domain),), parents=(Parent("Robot0"),)),
        ),
    )
