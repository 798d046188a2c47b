"""Asynchronous Distributed Stochastic Algorithm (A-DSA).

DSA without cycles: each robot acts in its own ticks, and waits for no other robot. In a tick it finds its best value
given the last known values of its neighbours, decides as in DSA, and sends its value, changed or not.

- **When to use**: like DSA, if some robots or links are much slower than others: no robot has to wait for them.
- **Guarantees**: incomplete; each robot stops after `cycles` ticks, without a proof of optimality. It always ends. The
  result is the cheapest of the assignments that the robots had after the same number of their ticks. A robot with an
  empty domain proves that there is no solution.
- **Parameters (`--set`)**: `variant` (A to E; default B), `probability` (p; default 0.7), `cycles` (the number of ticks
  of a robot; default 100).
- **References**: Fitzpatrick, Meertens: "Distributed coordination through anarchic optimization", in: Distributed
  Sensor Networks, 2003; for ticks without cycles: Rust, Picard, Ramparany: "pyDCOP: a DCOP library for dynamic IoT
  systems", OptLearnMAS 2019 (its `adsa`).

In the paper, a tick comes from the robot's clock. Here a protocol has no clock: a robot makes a tick whenever it has
processed all messages that were waiting for it, once it knows a value of each neighbour. So a robot that is busy, or
receives messages seldom, makes few ticks in the same time; if several values from a neighbour are waiting, it uses the
last one. If messages arrive one by one (`--schedule random`), robots make a tick for each message, and often use old
values.

Differences, and why the search ends:

- A robot stops after `cycles` ticks, and its last message reports this (`last`). No more messages are sent to it.
- A robot whose neighbours have all stopped makes its remaining ticks at once, because nothing can change around it.
- Of two active neighbours, each answers the other's message with a tick. So in the end all have made all their ticks.
- The robots' values after their n-th ticks may belong to different times. They still form an assignment, and its cost
  is known: the cheapest assignment is the result.
- If messages are lost and no more arrive, each robot makes a tick with the values that it knows.
- The first value is chosen at random and sent at once. Constraints may be n-ary; hard constraints are as in `dsa`.

>>> from robochoc.communication.simulator.schedule import Concurrent
>>> from robochoc.communication.simulator.simulator import Simulation
>>> from robochoc.generators.queens3d import queens3d
>>> result = Simulation(queens3d(4), ADSA, Concurrent(seed=0)).search()
>>> {found.trail.cycle for found in result.findings.values()}
{100}
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, ClassVar, cast

from robochoc.protocols import acts
from robochoc.protocols import message as wire
from robochoc.protocols.disclosure import Proof, Reception, can_take
from robochoc.protocols.local_search.dsa import DSA, DSASettings
from robochoc.protocols.order import PriorityOrder
from robochoc.protocols.traits import ENDS_WITH_PROOF, Traits
from robochoc.protocols.wording import Wording
from robochoc.solver.local_problem import LocalProblem


class ADSASettings(DSASettings, frozen=True):
    """The settings of `dsa`, but `cycles` are ticks of a robot; no `anytime`, because robots are not synchronized."""

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.anytime == "yes":
            raise ValueError("anytime=yes requires robots that go through cycles together; a-dsa has none: use dsa")


class Tick(wire.Message, frozen=True):
    """The sender's value after a tick, changed or not; `last`: it makes no more ticks."""

    value: wire.Value
    last: bool

    act = acts.TELL_VALUE

    def in_words(self, words: Wording) -> str:
        return f"{words.own_value(self.value)} {'for good' if self.last else 'at present'}"

    def proves(self, reception: Reception) -> Sequence[Proof]:
        return [can_take(reception.sender, self.value)]


class ADSA(DSA):
    """One agent of A-DSA. State: `cycle` (the number of ticks), the `view`, and the neighbours that are `active`."""

    messages: ClassVar[Any] = Tick
    settings: ClassVar[ADSASettings] = ADSASettings()
    traits = Traits(
        concludes=ENDS_WITH_PROOF,
        paper="Fitzpatrick & Meertens 2003",
        complete=False,
        costs=True,
        shared_scopes=True,
        writes_to_non_neighbours=False,
        bears_loss=True,
        privacy="constraints among others",
        use_when="as DSA, where some robots or links are much slower",
    )

    def __init__(self, problem: LocalProblem, order: PriorityOrder) -> None:
        super().__init__(problem, order)
        self.view: dict[str, wire.Value] = {}
        self.active = dict.fromkeys(problem.neighbours)
        """The neighbours that have not made their last tick, in priority order."""
        self._news = False

    def start_cycles(self) -> None:
        """Choose a random value, and send it."""
        self.choose(self.any_value())
        self._send_value()

    def receive(self, sender: str, message: wire.Message) -> None:
        """Store a neighbour's value."""
        if sender not in self.active:
            raise ValueError(f"{sender} is not a neighbour of {self.problem.agent}, or has ended already")
        tick = cast("Tick", message)
        self.check_value(sender, tick.value)
        self.view[sender] = tick.value
        self._news = True
        if tick.last:
            del self.active[sender]

    def settle(self) -> None:
        """Make a tick, once all waiting messages are processed; make all remaining ticks if no neighbour is active."""
        if not self._news or self.verdict is not None or len(self.view) < len(self.problem.neighbours):
            return
        self._news = False
        self._tick()
        while not self.active and not self.finished:
            self._tick()

    def go_on(self) -> bool:
        """Make a tick with the known values, because messages were lost and no more will arrive."""
        if self.finished or self.verdict is not None or self.value is None:
            return False
        self._tick()
        return True

    def _tick(self) -> None:
        """Move or stay, given the last known values; send the value to all active neighbours."""
        if self.finished:
            return
        places, probability = self.proposal(self.problem.lexicographic_costs(self.view))
        index = self.present
        if places and probability and self.chance() < probability:
            index = self.any_of(places)
        self.choose(index)
        self._send_value()

    def _send_value(self) -> None:
        self.multicast(self.active, Tick(self.problem.values[self.present], self.finished))
