"""PC-SyncBB: SyncBB on shared secrets, private against every coalition of a minority of the robots.

Branch and bound as in SyncBB, but no robot knows the path: each robot keeps its own value, and all robots have shares
of its code, and of the path's cost. The next robot chooses a value and shares its costs with each possible value of
every robot before it. From these the robots compute shares of the new path's cost, and compare it with the best cost,
which no robot knows either. Only the answer is opened: whether the path costs less than the best one. Then the next
robot, or the next value, has its turn. At the end each robot takes its value in the best path.

- **When to use**: costs, and three robots or more that may combine their knowledge.
- **Guarantees**: complete; it terminates with an optimum, or with a proof that there is no solution. Robots are assumed
  to follow the protocol (honest but curious), and to have channels that nobody else reads. A coalition of fewer than
  half of the robots learns nothing but the answers of comparisons and its own values in the best path.
- **Parameters (`--set`)**: `search`: `open`, as in the paper; with `hidden`, all combinations of values are visited,
  and no answer is opened: a minority learns nothing but its own values in the best path. `comparisons`, the maximum
  number of comparisons in a run (default 20,000). `bits`, the size of the field 2^bits - 1 (default 61).
- **Reference**: Tassa, Grinshpoun, Yanai: "A privacy preserving collusion secure DCOP algorithm", IJCAI 2019. Only the
  abstract, the introduction and the authors' program without its comparison were available: the search follows these,
  the computation on shares follows the principle (honest majority).

Disclosed and hidden information:

- In an open search, the answers show how the search proceeds. A coalition can exclude the costs with which it would
  proceed differently (`robochoc privacy --coalition`). Robots try their values in a random, secret order.
- Each robot discloses the number of its declared values, which the files declare. Impossible values are tried like
  others, at the cost of broken constraints. Robots share costs with all robots before them, also if these are 0: so
  who shares a constraint with whom is not disclosed.
- A refusal depends on private costs: they are too large for the field, or an open search needs too many comparisons.
- A team of two robots has no minority: nothing is hidden in it.
- A comparison is private up to 2^-bits: the random number that masks its inputs is 0 twice as often as any other.

Sizes: a comparison takes about 8 rounds, in which each robot sends one message to the first robot and receives one.
With `hidden`, the number of comparisons is the number of combinations of values, known before the search.

The methods:

    shares          `shamir`                  products, random numbers   `shared_arithmetic`
    comparison      `shared_comparison`       costs                      `shared_costs`
    search          `_visit_next`, `_add_costs`, `_use_answer`

Choices that the paper leaves open, and differences:

- The paper's pairs of robots compute their costs with Paillier ciphers and additive shares. Here the robot that
  assigns its value shares a row of costs with all robots, so that one product gives the cost.
- Broken hard constraints cost 2^w each, more than all finite costs. The search begins with this bound.
- The comparison is that of Nishide and Ohta, PKC 2007 (`shared_comparison`).
- A robot without other robots takes its best value.

>>> from robochoc.communication.simulator.schedule import Concurrent
>>> from robochoc.communication.simulator.simulator import Simulation
>>> from robochoc.generators.queens3d import queens3d
>>> result = Simulation(queens3d(2), PCSyncBB, Concurrent(seed=0)).run()
>>> result.verdict.value
'no-solution'
"""

from __future__ import annotations

import math
from enum import StrEnum
from itertools import islice
from typing import Any, ClassVar

from robochoc.model.outcome import Verdict
from robochoc.protocols.key_stream import shuffled
from robochoc.protocols.order import PriorityOrder
from robochoc.protocols.private.shared_arithmetic import Inputs, Output, SharedArithmeticMessage
from robochoc.protocols.private.shared_costs import SharedCostsProtocol, Sizes, check_settings
from robochoc.protocols.settings import Settings
from robochoc.protocols.traits import ENDS_WITH_PROOF, Traits
from robochoc.solver.local_problem import LocalProblem


class Search(StrEnum):
    """The forms of the search: `open` publishes the answers of comparisons, `hidden` does not."""

    OPEN = "open"
    HIDDEN = "hidden"


class PCSyncBBSettings(Settings, frozen=True):
    """`search`: `open` or `hidden`. `comparisons`: their maximum number. `bits`: the field has 2^bits - 1 elements."""

    search: Search = Search.OPEN
    comparisons: int = 20_000
    bits: int = 61

    def __post_init__(self) -> None:
        check_settings(self.comparisons, self.bits)


class PCSyncBB(SharedCostsProtocol):
    """One agent of PC-SyncBB.

    Public state, the same for all robots: `sizes`, the number of values of each robot; `attempts`, the number of values
    that each robot on the path has tried; `found`, whether an open search has found a path.

    Secret state: `current`, the index of this robot's declared value on the path, and `best`, in the best path; shares
    of the codes of all values on the path (`codes`), of the cost of each part of the path (`paid`), and of the best
    cost (`bound`).
    """

    messages: ClassVar[Any] = SharedArithmeticMessage | Sizes
    traits: ClassVar[Traits] = Traits(
        concludes=ENDS_WITH_PROOF,
        paper="Tassa, Grinshpoun & Yanai 2019",
        costs=True,
        encrypted_tables=True,
        secret_keys=True,
        privacy="constraints, domains and values, also from coalitions of a minority",
        use_when="costs, and some robots may combine what they know",
    )
    settings: ClassVar[PCSyncBBSettings] = PCSyncBBSettings()

    def __init__(self, problem: LocalProblem, order: PriorityOrder) -> None:
        super().__init__(problem, order)
        self.attempts: list[int] = []
        self.found = False
        self.current = 0
        self.best: int | None = None
        self.codes: list[list[int]] = []
        self.paid: list[int] = []
        self.bound = 0
        self._order: list[int] = []
        self._joint: list[list[list[int]]] = []
        """For each robot on the path and each of its announced scopes: shares of the joint code of the robots in it."""
        self._joined = 1
        """The number of robots in each joint code so far."""
        self._path_costs: list[int] = []
        self._hidden_best: list[int] = []
        self._hidden_current: list[int] = []
        self._hidden_found = 0

    @property
    def limits(self) -> tuple[int, int]:
        return self.settings.comparisons, self.settings.bits

    @property
    def is_hidden(self) -> bool:
        """True if the answers of comparisons are not opened."""
        return self.settings.search == Search.HIDDEN

    def begin(self) -> None:
        if self.is_hidden:
            self.check_comparisons(math.prod(self.sizes))
        self.bound = self.broken
        self._hidden_best = [0] * len(self.sizes)
        self.attempts = [0]
        self._visit_next()

    # The search: the same steps for all robots

    def _visit_next(self) -> None:
        """Let the last robot on the path that has a value left try it; without such a robot, finish."""
        while self.attempts and self.attempts[-1] == self.sizes[len(self.attempts) - 1]:
            self.attempts.pop()
        if not self.attempts:
            self._finish()
            return
        place = len(self.attempts) - 1
        del self.codes[place:], self.paid[place:], self._hidden_current[place:], self._joint[place + 1 :]
        self.attempts[-1] += 1
        if self.attempts[-1] == 1:
            self._joint[place:] = [[self.codes[ranks[0]] for ranks in self.scopes[place]]]
            self._joined = 1
            self._join_codes()
        else:
            self._try_value()

    def _join_codes(self) -> None:
        """Compute the joint codes of the robots in each announced scope of the robot whose turn it is."""
        products = [
            one * two % self.field.prime
            for joint, further in self._to_be_joined()
            for one in self._joint[-1][joint]
            for two in self.codes[further]
        ]
        if products:
            self.reduce(products, "_use_joined")
        else:
            self._try_value()

    def _to_be_joined(self) -> list[tuple[int, int]]:
        """Return the numbers of scopes with further robots, each with the rank of its next robot."""
        scopes = enumerate(self.scopes[len(self.attempts) - 1])
        return [(number, ranks[self._joined]) for number, ranks in scopes if len(ranks) > self._joined]

    def _use_joined(self) -> None:
        codes = iter(self.results)
        for joint, further in self._to_be_joined():
            self._joint[-1][joint] = [*islice(codes, len(self._joint[-1][joint]) * self.sizes[further])]
        self._joined += 1
        self._join_codes()

    def _try_value(self) -> None:
        place = len(self.attempts) - 1
        if place == self.rank:
            self._choose_value()
            self.wait_for(Inputs, (), "_add_costs")
        else:
            self.wait_for(Inputs, (self.order.names[place],), "_add_costs")

    def _choose_value(self) -> None:
        """Take this robot's next value, in a random order if the search is open, and share it and its costs."""
        if self.attempts[-1] == 1:
            places = range(self.sizes[self.rank])
            self._order = [*places] if self.is_hidden else shuffled(places, self.secret)
        self.current = one = self._order[self.attempts[-1] - 1]
        inputs = [self.alone[one], one]
        for name, size in zip(self.order.names[: self.rank], self.sizes, strict=False):
            rows = self.rows.get((name,))
            inputs += rows[one] if rows else [0] * size
        for wide in self.wide_rows.values():
            inputs += wide[one]
        inputs += [int(place == one) for place in range(self.sizes[self.rank])]
        self._path_costs = self.share(inputs)

    def _add_costs(self) -> None:
        """Add the costs of the last robot's value to the path; compare a path if its answer matters."""
        place = len(self.attempts) - 1
        if place == self.rank:
            shares = self._path_costs
        else:
            (shares,) = self.received_shares(2 + sum(self.sizes[: place + 1]) + sum(map(len, self._joint[-1])))
        alone, index, *rest = shares
        total = alone + (self.paid[-1] if self.paid else 0)
        for codes in (*self.codes, *self._joint[-1]):
            row, rest = rest[: len(codes)], rest[len(codes) :]
            total += sum(one * two for one, two in zip(codes, row, strict=True))
        self.codes.append(rest)
        self._hidden_current.append(index)
        self.reduce([total % self.field.prime], "_compare_path")

    def _compare_path(self) -> None:
        self.paid += self.results
        if self.is_hidden and len(self.attempts) < len(self.sizes):
            self._extend()
            return
        self.check_comparisons(self.comparisons + 1)
        self.compare([self.paid[-1] - self.bound], "_use_answer")

    def _extend(self) -> None:
        """Pass the turn to the next robot."""
        self.attempts.append(0)
        self._visit_next()

    def _use_answer(self) -> None:
        """Open the answer; in a hidden search replace the best path by the present one if it costs less."""
        less = (1 - self.results[0]) % self.field.prime
        if not self.is_hidden:
            self.open([less], "_use_opened_answer")
            return
        changes = [self.paid[-1] - self.bound, 1 - self._hidden_found]
        changes += [one - best for one, best in zip(self._hidden_current, self._hidden_best, strict=True)]
        self.reduce([less * change % self.field.prime for change in changes], "_replace_best")

    def _replace_best(self) -> None:
        cost, found, *changes = self.results
        prime = self.field.prime
        self.bound = (self.bound + cost) % prime
        self._hidden_found = (self._hidden_found + found) % prime
        self._hidden_best = [(best + change) % prime for best, change in zip(self._hidden_best, changes, strict=True)]
        self._visit_next()

    def _use_opened_answer(self) -> None:
        if self.results == [1] and len(self.attempts) < len(self.sizes):
            self._extend()
            return
        if self.results == [1]:
            self.bound, self.best, self.found = self.paid[-1], self.current, True
        self._visit_next()

    # The end

    def _finish(self) -> None:
        """Take the value in the best path; in a hidden search, open first whether there is one."""
        if self.is_hidden:
            self.open([self._hidden_found], "_send_outputs")
        else:
            self._decide()

    def _send_outputs(self) -> None:
        """Open each robot's value in the best path to this robot only."""
        self.found = self.results == [1]
        if not self.found:
            self._decide()
            return
        for name, share in zip(self.order.names, self._hidden_best, strict=True):
            if name != self.problem.agent:
                self.send(name, Output(self.field.pack([share])))
        self.wait_for(Output, self.others, "_use_outputs")

    def _use_outputs(self) -> None:
        shares = self.received_shares(1)
        shares.insert(self.rank, [self._hidden_best[self.rank]])
        (self.best,) = self.field.combine(shares)
        self._decide()

    def _decide(self) -> None:
        if not self.found or self.best is None:
            self.conclude(Verdict.NO_SOLUTION)
        elif self.best not in self.places:
            raise ValueError(f"the best path has an impossible value of {self.problem.agent}")
        else:
            self.value = self.places[self.best]
