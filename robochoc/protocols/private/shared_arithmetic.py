"""Computation on shared secrets by all robots of a team, private against every minority.

With n robots, t = (n - 1) // 2: t robots together learn nothing but opened values, as long as all robots follow the
protocol (Ben-Or, Goldwasser, Wigderson, STOC 1988). Sums are computed on shares. A product of two shares is a share of
a polynomial of degree 2t; to reduce the degree, the robots subtract a shared random number, the first robot combines
all shares of the difference and publishes it (Damgard, Nielsen, CRYPTO 2007). The random numbers are sums of those of
t + 1 robots, so no minority knows them; random bits are their exclusive or.

All robots execute the same steps in the same order. A robot names the method that continues, and the messages that it
needs for this; messages that arrive early wait.
"""

from __future__ import annotations

import math
from abc import abstractmethod
from collections import deque
from collections.abc import Callable, Collection, Sequence
from typing import ClassVar, NamedTuple

from robochoc.protocols.acts import Act, Performative
from robochoc.protocols.disclosure import NOTHING, Proof, Reception
from robochoc.protocols.message import Message
from robochoc.protocols.order import PriorityOrder
from robochoc.protocols.private.shamir import Field
from robochoc.protocols.private.shared_comparison import Comparison, products_per_comparison
from robochoc.protocols.protocol import Protocol
from robochoc.protocols.wording import Wording
from robochoc.solver.local_problem import LocalProblem

_MOST_WAITING = 4
"""Robots send at most three messages before they need an answer."""
_TWO_ROBOTS = 2
_DRAWN_AT_ONCE = 512
_MOST_PREPARED = 8
"""The largest number of batches of comparisons for which random numbers are prepared at once."""
_MOST_COMPARED = 64
"""The largest number of comparisons in a batch, and prepared at once: it bounds messages and memory."""


class SharesMessage(Message, frozen=True):
    """The base class of messages with shares, masked or opened values, as bytes. `content` names them."""

    shares: bytes

    masked = frozenset({"shares"})
    content: ClassVar[str]

    def in_words(self, _: Wording) -> str:
        return f"{self.content}: {len(self.shares):,} bytes"

    def proves(self, reception: Reception) -> Sequence[Proof] | None:
        """Prove nothing about single robots, unless there are only two: then one robot's shares are the secrets."""
        return NOTHING if len(reception.order) > _TWO_ROBOTS else None


class Randomness(SharesMessage, frozen=True):
    """The receiver's shares of random bits and numbers of the sender."""

    act = Act(Performative.INFORM, "the receiver has shares of random numbers")
    content = "your shares of random numbers"


class Inputs(SharesMessage, frozen=True):
    """The receiver's shares of the sender's secrets."""

    act = Act(Performative.INFORM, "the receiver has shares of the sender's value and costs")
    content = "your shares of my value and its costs"


class Masked(SharesMessage, frozen=True):
    """The sender's shares of masked values, for the first robot."""

    act = Act(Performative.REQUEST, "the receiver combines the shares, and publishes the masked values")
    content = "my shares of masked values"


class Opened(SharesMessage, frozen=True):
    """Masked values, combined from all shares."""

    act = Act(Performative.INFORM, "the receiver knows the masked values")
    content = "the masked values"


class PublicResult(SharesMessage, frozen=True):
    """Results of the computation that all robots may know."""

    masked = frozenset()
    act = Act(Performative.INFORM, "the receiver knows results of the computation")

    def in_words(self, _: Wording) -> str:
        return f"the result is {self.shares.hex()}"


class Output(SharesMessage, frozen=True):
    """The sender's share of a result that only the receiver may know."""

    act = Act(Performative.INFORM, "the receiver can combine its result")
    content = "my share of your result"


SharedArithmeticMessage = Randomness | Inputs | Masked | Opened | PublicResult | Output


class Awaited(NamedTuple):
    """The next messages that a robot needs: one of type `kind` from each of `senders`, for the method `then`."""

    kind: str
    senders: tuple[str, ...]
    then: str


class DoubleShare(NamedTuple):
    """This robot's two shares of one random number: by a polynomial of degree t, and by one of degree 2t."""

    low: int
    high: int


class Reduction(NamedTuple):
    """Local products whose degree is to be reduced, for the method `then`. Those for random bits precede others."""

    products: list[int]
    then: str


class SharedArithmeticProtocol(Protocol):
    """One robot of a team that computes on shares. Subclasses name methods by strings, so that robots can be copied.

    Attributes:
        field: The field of all shares.
        others: All other robots, the highest priority first.
        rank: This robot's position in the order, from 0.
        degree: The degree t of all polynomials: the largest number of robots that together learn nothing.
        results: The results of the last `reduce`, `compare` or `open`, for the method that continues.
        comparisons: The number of comparisons so far.
        steps: The methods that continue after a step, by the name of the step.
    """

    def __init__(self, problem: LocalProblem, order: PriorityOrder) -> None:
        super().__init__(problem, order)
        self.rank = order.rank[problem.agent]
        self.others = tuple(name for name in order.names if name != problem.agent)
        self.degree = (len(order.names) - 1) // 2
        self.results: list[int] = []
        self.comparisons = 0
        self._waiting: dict[str, deque[Message]] = {name: deque() for name in self.others}
        self._awaited: Awaited | None = None
        self._received: list[Message] = []
        self._random_bits: list[int] = []
        self._doubles: list[DoubleShare] = []
        self._prepared = 0
        self._wanted = (0, 0)
        self._dealt: list[list[int]] = []
        self._reductions: list[Reduction] = []
        self._numbers: list[int] = []
        self._answers: list[int] = []
        self._comparison: Comparison | None = None
        self._published: list[int] = []
        self._kind: type[SharesMessage] = PublicResult
        self.steps: dict[str, str] = {}

    @property
    @abstractmethod
    def field(self) -> Field:
        """The field of all shares."""

    # Messages

    def receive(self, sender: str, message: Message) -> None:
        waiting = self._waiting.get(sender)
        if waiting is None or len(waiting) >= _MOST_WAITING:
            raise ValueError(f"received too many messages from {sender}")
        waiting.append(message)
        self.proceed()

    def proceed(self) -> None:
        """Continue as long as all needed messages have been received."""
        while (awaited := self._awaited) is not None and all(self._waiting[name] for name in awaited.senders):
            self._received = [self._waiting[name].popleft() for name in awaited.senders]
            for sender, message in zip(awaited.senders, self._received, strict=True):
                if type(message).__name__ != awaited.kind:
                    raise ValueError(f"received {type(message).__name__} from {sender}, but needs {awaited.kind}")
            self._awaited = None
            getattr(self, awaited.then)()

    def wait_for(self, kind: type[Message], senders: Collection[str], then: str) -> None:
        """Continue with the method `then` after one message of type `kind` from each of `senders`."""
        self._awaited = Awaited(kind.__name__, tuple(senders), then)

    def received(self) -> list[Message]:
        """Return the awaited messages, in the order of their senders."""
        return self._received

    def received_shares(self, count: int) -> list[list[int]]:
        """Return the `count` elements in each of the awaited messages."""
        return [
            self.field.unpack(message.shares, count) for message in self._received if isinstance(message, SharesMessage)
        ]

    def deal(self, kind: type[SharesMessage], shares: Sequence[Sequence[int]]) -> list[int]:
        """Send each other robot its shares, and return those of this robot."""
        for name, own in zip(self.order.names, shares, strict=True):
            if name != self.problem.agent:
                self.send(name, kind(self.field.pack(own)))
        return [*shares[self.rank]]

    def share(self, secrets: Sequence[int]) -> list[int]:
        """Share `secrets` with all robots, and return this robot's shares."""
        return self.deal(Inputs, self.field.share(secrets, self.degree, len(self.order.names), self.secret))

    def go_to(self, step: str) -> None:
        """Continue with the method after `step`."""
        getattr(self, self.steps[step])()

    # Opening

    def open(self, shares: Sequence[int], then: str) -> None:
        """Open shared results to all robots. Continue with `then`."""
        self._open(PublicResult, shares, then)

    def _open(self, kind: type[SharesMessage], shares: Sequence[int], then: str) -> None:
        """Send the shares to the first robot, which combines them and sends the values to all in a message `kind`."""
        self.steps["open"] = then
        self._published = [*shares]
        if self.rank == 0:
            self._kind = kind
            self.wait_for(Masked, self.others, "_combine")
        else:
            self.send(self.order.names[0], Masked(self.field.pack(shares)))
            self.wait_for(kind, self.order.names[:1], "_use_opened")

    def _combine(self) -> None:
        shares = [self._published, *self.received_shares(len(self._published))]
        self.results = self.field.combine(shares[: 2 * self.degree + 1])
        content = self._kind(self.field.pack(self.results))
        for name in self.others:
            self.send(name, content)
        self.go_to("open")

    def _use_opened(self) -> None:
        (self.results,) = self.received_shares(len(self._published))
        self.go_to("open")

    # Products

    def reduce(self, products: Sequence[int], then: str) -> None:
        """Replace sums of products of two shares by new shares of the same values. Continue with `then`."""
        self._reductions.append(Reduction([*products], then))
        self._prepare(0, len(products), "_mask")

    def _mask(self) -> None:
        products = self._reductions[-1].products
        masks, prime = self._doubles[-len(products) :], self.field.prime
        masked = [(one + mask.high) % prime for one, mask in zip(products, masks, strict=True)]
        self._open(Opened, masked, "_unmask")

    def _unmask(self) -> None:
        products, then = self._reductions.pop()
        prime = self.field.prime
        masks, self._doubles = self._doubles[-len(products) :], self._doubles[: -len(products)]
        self.results = [(one - mask.low) % prime for one, mask in zip(self.results, masks, strict=True)]
        getattr(self, then)()

    # Comparisons

    def compare(self, numbers: Sequence[int], then: str) -> None:
        """For each shared x, compute shares of 1 if x < p/2 (not negative), otherwise of 0. Continue with `then`."""
        self.steps["compare"] = then
        self._numbers, self._answers = [*numbers], []
        self.comparisons += len(numbers)
        self._compare_next()

    def _compare_next(self) -> None:
        """Start the next batch of comparisons."""
        bits, count = self.field.bits, min(len(self._numbers), _MOST_COMPARED)
        self._prepare(count * bits, count * products_per_comparison(bits), "_compare")

    def _compare(self) -> None:
        bits, numbers = self.field.bits, self._numbers[:_MOST_COMPARED]
        self._numbers = self._numbers[_MOST_COMPARED:]
        count = bits * len(numbers)
        taken, self._random_bits = self._random_bits[-count:], self._random_bits[:-count]
        grouped = [taken[at : at + bits] for at in range(0, count, bits)]
        self._comparison = Comparison(self.field, numbers, grouped)
        self._open(Opened, self._comparison.masked, "_begin_comparison")

    def _begin_comparison(self) -> None:
        comparison = self._running_comparison()
        comparison.begin(self.results)
        self.reduce(comparison.products, "_advance_comparison")

    def _advance_comparison(self) -> None:
        comparison = self._running_comparison()
        comparison.advance(self.results)
        if comparison.products:
            self.reduce(comparison.products, "_advance_comparison")
            return
        self._answers += comparison.results
        self._comparison = None
        if self._numbers:
            self._compare_next()
            return
        self.results, self._answers = self._answers, []
        self.go_to("compare")

    def _running_comparison(self) -> Comparison:
        if self._comparison is None:
            raise ValueError("received values for a comparison that has not begun")
        return self._comparison

    # Random numbers

    def _prepare(self, bits: int, doubles: int, then: str) -> None:
        """Make sure that there are enough random bits and random numbers. Continue with `then`."""
        if len(self._random_bits) >= bits and len(self._doubles) >= doubles:
            getattr(self, then)()
            return
        self.steps["prepare"] = then
        limit = min(_MOST_PREPARED, _MOST_COMPARED * self.field.bits // max(bits, 1)) or 1
        self._prepared = min(2 * self._prepared or 1, limit)
        lacking = bits if len(self._random_bits) < bits else 0
        spare = max(doubles, products_per_comparison(self.field.bits) + 1)
        self._wanted = (self._prepared * lacking, self._prepared * spare)
        self._dealt = [self._deal_randomness()] if self.rank <= self.degree else []
        dealers = self.order.names[: self.degree + 1]
        self.wait_for(Randomness, [name for name in dealers if name != self.problem.agent], "_add_randomness")

    @property
    def _number_of_doubles(self) -> int:
        """The number of random numbers to be dealt, including those for the products that make random bits."""
        bits, doubles = self._wanted
        return doubles + bits * self.degree

    def _deal_randomness(self) -> list[int]:
        field, robots = self.field, len(self.order.names)
        bits, doubles = random_bits(self._wanted[0], self.secret), field.draw(self._number_of_doubles, self.secret)
        low = field.share([*bits, *doubles], self.degree, robots, self.secret)
        high = field.share(doubles, 2 * self.degree, robots, self.secret)
        return self.deal(Randomness, [[*one, *two] for one, two in zip(low, high, strict=True)])

    def _add_randomness(self) -> None:
        """Add the random numbers of all dealers; then combine their bits, one dealer after the other."""
        bits, doubles = self._wanted[0], self._number_of_doubles
        dealt = self.received_shares(bits + 2 * doubles)
        dealt[self.rank : self.rank] = self._dealt
        self._dealt = [one[:bits] for one in dealt]
        prime = self.field.prime
        sums = [sum(column) % prime for column in zip(*(one[bits:] for one in dealt), strict=True)]
        self._doubles += [DoubleShare(*pair) for pair in zip(sums[:doubles], sums[doubles:], strict=True)]
        self._combine_bits()

    def _combine_bits(self) -> None:
        """Start to compute the exclusive or of the first two dealers' bits; with one dealer left, use its bits."""
        if len(self._dealt) > 1 and self._wanted[0]:
            prime = self.field.prime
            products = [one * two % prime for one, two in zip(*self._dealt[:2], strict=True)]
            self._reductions.append(Reduction(products, "_use_combined_bits"))
            self._mask()
            return
        self._random_bits += self._dealt[0]
        self.go_to("prepare")

    def _use_combined_bits(self) -> None:
        columns = zip(*self._dealt[:2], self.results, strict=True)
        prime = self.field.prime
        combined = [(one + two - 2 * both) % prime for one, two, both in columns]
        self._dealt[:2] = [combined]
        self._combine_bits()


def random_bits(count: int, secret: Callable[[int], int]) -> list[int]:
    """Return `count` random bits."""
    drawn = [secret(_DRAWN_AT_ONCE) for _ in range(math.ceil(count / _DRAWN_AT_ONCE))]
    return [drawn[place // _DRAWN_AT_ONCE] >> place % _DRAWN_AT_ONCE & 1 for place in range(count)]
