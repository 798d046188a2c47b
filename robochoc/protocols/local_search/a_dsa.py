"""Asynchronous Distributed Stochastic Algorithm (A-DSA).

DSA without cycles: each robot acts in ticks of its own, and waits for nobody. In a tick it looks for its best value
against the last known values of its neighbours, decides as in DSA, and sends its value, changed or not.

- **When to use**: as DSA, where some robots or links are much slower than others: nobody has to wait for them.
- **Guarantees**: incomplete; each robot stops after `cycles` ticks, without a proof of optimality. It always ends. The
  result is the best of what the robots had after equally many ticks of their own. A robot with an empty domain proves
  that there is no solution.
- **Parameters (`--set`)**: `variant` (A to E; default B), `probability` (p; default 0.7), `cycles` (the number of ticks
  of a robot; default 100).
- **References**: Fitzpatrick, Meertens: "Distributed coordination through anarchic optimization", in: Distributed
  Sensor Networks, 2003; for ticks without cycles: Rust, Picard, Ramparany: "pyDCOP: a DCOP library for dynamic IoT
  systems", OptLearnMAS 2019 (its `adsa`).

What a tick is: elsewhere a clock of the robot gives it. A protocol has no clock here. A robot makes a tick whenever it
has taken in all messages that were waiting for it, once it knows a value of each neighbour. So a robot that is busy, or
hears seldom, makes few ticks in the same time; of several values of a neighbour that have piled up it uses the last.
Where messages arrive one by one (`--schedule random`) robots make a tick for each, and often use old values.

Differences, and why it ends:

- A robot stops after `cycles` ticks, and says so in its last message (`last`). No more is sent to it.
- A robot whose neighbours have all stopped makes its remaining ticks at once: nothing can change around it.
- Of two neighbours that go on, each answers the other's message by a tick. So at the end all have made all their ticks.
- What robots had after their n-th tick, for each n, they need not have had at the same time. It is an assignment all
  the same, and its cost is known: the cheapest one is the answer.
- Where messages are lost and nothing comes any more, each robot makes a tick with the values that it knows.
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
from robochoc.protocols.disclosure import Hearing, Proof, can_take
from robochoc.protocols.local_search.dsa import DSA, DSASettings
from robochoc.protocols.order import PriorityOrder
from robochoc.protocols.traits import ENDS_WITH_PROOF, Traits
from robochoc.protocols.wording import Wording
from robochoc.solver.local_problem import LocalProblem


class ADSASettings(DSASettings, frozen=True):
    """Those of `dsa`, but `cycles` are ticks of a robot; no `anytime`, as robots do not go in step."""

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.anytime == "yes":
            raise ValueError("anytime is for robots that go through cycles together; here each has ticks of its own")


class Tick(wire.Message, frozen=True):
    """The sender's value after a tick, changed or not; `last`: it makes no more ticks."""

    value: wire.Value
    last: bool

    act = acts.TELL_VALUE

    def in_words(self, words: Wording) -> str:
        return f"{words.own_value(self.value)} {'for good' if self.last else 'at present'}"

    def proves(self, hearing: Hearing) -> Sequence[Proof]:
        return [can_take(hearing.sender, self.value)]


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
        """Those that have not made their last tick, in priority order."""
        self._news = False

    def start_cycles(self) -> None:
        """Take a random value, and tell it."""
        self.choose(self.any_value())
        self._tell_all()

    def receive(self, sender: str, message: wire.Message) -> None:
        """Note a neighbour's value."""
        if sender not in self.active:
            raise ValueError(f"{sender} is no neighbour of {self.problem.agent}, or has made its last tick")
        told = cast("Tick", message)
        self.check_value(sender, told.value)
        self.view[sender] = told.value
        self._news = True
        if told.last:
            del self.active[sender]

    def settle(self) -> None:
        """Make a tick, with all waiting messages taken in; make all that are left if no neighbour goes on."""
        if not self._news or self.verdict is not None or len(self.view) < len(self.problem.neighbours):
            return
        self._news = False
        self._tick()
        while not self.active and not self.finished:
            self._tick()

    def go_on(self) -> bool:
        """Make a tick with what is known: messages were lost, and nothing else would come."""
        if self.finished or self.verdict is not None or self.value is None:
            return False
        self._tick()
        return True

    def _tick(self) -> None:
        """Move or stay, against the last known values; tell the value to all that go on."""
        if self.finished:
            return
        places, probability = self.proposal(self.problem.lexicographic_costs(self.view))
        index = self.present
        if places and probability and self.chance() < probability:
            index = self.any_of(places)
        self.choose(index)
        self._tell_all()

    def _tell_all(self) -> None:
        self.multicast(self.active, Tick(self.problem.values[self.present], self.finished))
