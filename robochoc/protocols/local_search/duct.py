"""Distributed Upper Confidence Tree (DUCT).

Sampling on a pseudo-tree. A sample starts at the root: each robot receives the values above it that matter to its
subtree (the context), chooses a value, and sends the context on. The costs of the sample come back from the leaves. For
each context, a robot counts how often it has tried each value, and stores the costs. It tries the value with the best
confidence bound: cheap values often, and rarely tried values now and then.

- **When to use**: costs, and a pseudo-tree that is too wide for `dpop`: the more samples, the better the result.
- **Guarantees**: incomplete; the cost at the end is at most the best cost that the root knows. Memory is bounded by
  `contexts` times the size of the domain. A robot with an empty domain proves that there is no solution, and so does a
  root if none of its values has a solution below.
- **Parameters (`--set`)**: `samples` (default 300), `by` (`mean`, default, or `best`), `bound` (default 1), `error`
  (default 0.1), `confidence` (default 0.9), `contexts` (default 10,000).
- **Reference**: Ottens, Dimitrakakis, Faltings: "DUCT: an upper confidence bound approach to distributed constraint
  optimization problems", AAAI 2012; ACM TIST 8(5), 2017.

The parts of the algorithm:

    build the pseudo-tree           `dfs.TreeProtocol`    COST, from the leaves up       `_record_cost`
    CONTEXT, from the root down     `_sample`             the value to be sampled        `Samples.next`
    the end of a robot's samples    `Samples.enough`      the value at the end           `Samples.final`

After its samples, the root fixes the value with the best cost. Then its children continue to sample, each as the root
of its own subtree, until they fix their values, and so on. A robot stops when, with the given confidence, no other
value is better by more than `error`, or at the latest after `samples` samples in this context. Its earlier samples
count.

Choices that the paper leaves open, and differences:

- Before the first sample, robots send their parents their separators, and the highest possible costs of their subtrees,
  which are used to normalise the costs.
- Values that were never tried come first, the cheapest of them by the known costs above. Ties go to the first value.
- A value that breaks a hard constraint with robots above is never tried. A context with no other value is hopeless, and
  its parent never chooses its value in that context again. A broken constraint in a sample counts as the highest
  possible cost of the subtree.
- Besides the cost of the sample, a robot sends the best cost that it knows for this context. The best costs of several
  children add up even if they come from different samples, so the result may be better than every sample.
- When `contexts` are in memory, none is removed: in new contexts a robot chooses its cheapest value, which it can
  repeat. So the costs that a robot has reported as possible remain possible. A leaf stores nothing, because it knows
  its costs.
- Constraints may be n-ary, because all robots in a scope are on one branch. The lowest of them pays.

>>> from robochoc.communication.simulator.schedule import Concurrent
>>> from robochoc.communication.simulator.simulator import Simulation
>>> from robochoc.generators.queens3d import queens3d
>>> result = Simulation(queens3d(3), DUCT, Concurrent(seed=0)).search()
>>> result.verdict.value
'no-solution'
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import ClassVar, Literal, assert_never, cast

from robochoc.model.outcome import Verdict
from robochoc.protocols import message as wire
from robochoc.protocols.acts import Act, Performative
from robochoc.protocols.disclosure import (
    INFINITE,
    NOTHING,
    EveryValuePays,
    HasValue,
    Proof,
    Reception,
    SomeValuePays,
    can_take,
)
from robochoc.protocols.order import PriorityOrder
from robochoc.protocols.settings import Settings
from robochoc.protocols.shared.dfs import TreeProtocol
from robochoc.protocols.shared.messages.dfs import TreeMessage
from robochoc.protocols.traits import ENDS_WITH_PROOF, Traits
from robochoc.protocols.wording import Wording, cost_text
from robochoc.solver.local_problem import LexicographicCost, LocalProblem
from robochoc.system.plain_text import counted, listed


class DUCTSettings(Settings, frozen=True):
    """`samples`: the number of samples after which a robot chooses its value at the latest.

    `by`: whether values are compared by the `mean` cost of their samples, or by the `best` one. `bound`: the factor of
    the confidence bound; a larger one tries dear values more often. `error` and `confidence`: a robot also chooses
    when, with this confidence, no other value is better by more than this part of the highest possible cost of its
    subtree. `contexts`: the number of combinations of values above a robot for which it stores samples.
    """

    samples: int = 300
    by: Literal["mean", "best"] = "mean"
    bound: float = 1.0
    error: float = 0.1
    confidence: float = 0.9
    contexts: int = 10_000

    def __post_init__(self) -> None:
        for name, number in (("samples", self.samples), ("contexts", self.contexts)):
            if number < 1:
                raise ValueError(f"{name} is {number}; it must be 1 or more")
        for name, measure in (("bound", self.bound), ("error", self.error)):
            if not 0 <= measure < math.inf:
                raise ValueError(f"{name} is {measure:g}; it must be 0 or more, and finite")
        if not 0 < self.confidence < 1:
            raise ValueError(f"confidence is {self.confidence:g}; it must be between 0 and 1")


class Separator(wire.Message, frozen=True):
    """The robots above the sender that matter to its subtree, and the highest possible cost of the subtree.

    This cost does not include broken hard constraints.
    """

    robots: list[str]
    dearest: int

    act = Act(Performative.INFORM, "the receiver learns which values the sender needs")
    proves_nothing = True

    def in_words(self, _: Wording) -> str:
        return f"my subtree depends on {listed(self.robots)}, and costs {cost_text(self.dearest)} at most"


class SampleContext(wire.Message, frozen=True):
    """The values in the receiver's separator in this sample (CONTEXT)."""

    values: dict[str, wire.Value]

    act = Act(Performative.REQUEST, "the receiver samples its subtree for these values")

    def in_words(self, words: Wording) -> str:
        return f"sample your subtree with {words.assigned(self.values.items())}"

    def proves(self, _: Reception) -> Sequence[Proof]:
        return [can_take(*chosen) for chosen in self.values.items()]


class SampleCost(wire.Message, frozen=True):
    """The cost of the sample in the sender's subtree: broken hard constraints, and costs (COST).

    `best`: the least known cost for these values without a broken constraint; None if there is none yet. `hopeless`:
    there is no such cost, whatever values the subtree has.
    """

    broken: int
    cost: int
    best: int | None
    hopeless: bool

    act = Act(Performative.INFORM, "the receiver learns the cost of its sample below")

    def in_words(self, _: Wording) -> str:
        broken = f", and breaks {counted(self.broken, 'constraint')}" if self.broken else ""
        if self.hopeless:
            best = "with these values there is no solution"
        else:
            best = "no solution yet" if self.best is None else f"the best so far costs {cost_text(self.best)}"
        return f"this sample costs my subtree {cost_text(self.cost)}{broken}; {best}"

    def proves(self, reception: Reception) -> Sequence[Proof]:
        """Return the proofs that the sender pays no more than its subtree does.

        If all its neighbours are in the context, no robot is below it, and a hopeless context breaks its own
        constraints.
        """
        asked = reception.last(SampleContext, reception.receiver, reception.sender)
        if asked is None:
            return NOTHING
        found: list[Proof] = []
        if not self.broken:
            found.append(SomeValuePays(reception.sender, asked.values, self.cost))
        if self.best is not None:
            found.append(SomeValuePays(reception.sender, asked.values, self.best))
        if self.hopeless and asked.values.keys() >= set(reception.neighbours(reception.sender)):
            found.append(EveryValuePays(reception.sender, asked.values, INFINITE))
        return found


class Fixed(wire.Message, frozen=True):
    """The final values in the receiver's separator: from now on the receiver samples only for these."""

    values: dict[str, wire.Value]

    act = Act(Performative.REQUEST, "the receiver chooses its final value for these values")

    def in_words(self, words: Wording) -> str:
        return f"{words.assigned(self.values.items())} for good; choose your own value"

    def proves(self, _: Reception) -> Sequence[Proof]:
        return [HasValue(*chosen) for chosen in self.values.items()]


class Samples:
    """The samples in one context.

    `local` are the costs of this robot's values with those above, and `options` the values that are still tried: they
    break nothing above, and no context below them was hopeless. `scale` is the highest possible cost of the subtree; a
    broken constraint counts as much.
    """

    def __init__(self, local: Sequence[LexicographicCost], scale: int) -> None:
        self.options = [place for place, (broken, _) in enumerate(local) if not broken]
        self.taken = 0
        """The number of samples, for all values together."""
        self._local = local
        self._scale = max(1, scale)
        self._tries = [0] * len(local)
        self._sums = [0] * len(local)
        self._least: list[int | None] = [None] * len(local)

    @property
    def best(self) -> int | None:
        """The least known cost of the subtree without a broken constraint; None if there is none yet."""
        return min((least for place in self.options if (least := self._least[place]) is not None), default=None)

    def total(self, place: int, below: Sequence[LexicographicCost]) -> LexicographicCost:
        """Return the cost of a sample of the subtree."""
        costs = [self._local[place], *below]
        return int(sum(broken for broken, _ in costs)), int(sum(cost for _, cost in costs))

    def rule_out(self, place: int) -> None:
        """Record that a value has no solution below."""
        self.taken += 1
        self.options = [option for option in self.options if option != place]

    def add(self, place: int, sample: LexicographicCost, below: Sequence[int | None]) -> None:
        """Record the cost of a sample of a value, and the best known cost of each child for it."""
        broken, cost = sample
        self.taken += 1
        self._tries[place] += 1
        self._sums[place] += int(broken * self._scale + cost)
        if None not in below:
            self._least[place] = int(self._local[place][1]) + sum(best for best in below if best is not None)

    def next(self, settings: DUCTSettings) -> int:
        """Return the value for the next sample: the cheapest value never tried, or the value with the least bound."""
        new = [place for place in self.options if not self._tries[place]]
        if new or not self.options:
            return self._cheapest(new or range(len(self._local)))
        return min(self.options, key=lambda place: self._measure(place, settings) - self._margin(place, settings))

    def final(self) -> int:
        """Return the value in the best solution; if there is none, the value with the least mean cost."""
        if self.best is not None:
            return next(place for place in self.options if self._least[place] == self.best)
        tried = [place for place in self.options if self._tries[place]]
        return min(tried, key=self._mean) if tried else self._cheapest(self.options or range(len(self._local)))

    def enough(self, settings: DUCTSettings) -> bool:
        """Return whether no other value is likely to be better by more than the error, or all samples are used."""
        if self.taken >= settings.samples or not self.options:
            return True
        if self.best is None or not all(self._tries[place] for place in self.options):
            return False
        best = self.final()
        threshold = self._measure(best, settings) - settings.error
        spread = math.log(2 / (1 - settings.confidence))
        others = [place for place in self.options if place != best]
        return all(
            self._measure(place, settings) - math.sqrt(spread / self._tries[place]) >= threshold for place in others
        )

    def _cheapest(self, places: Sequence[int]) -> int:
        return min(places, key=self._local.__getitem__)

    def _mean(self, place: int) -> float:
        """Return the mean cost of a value's samples, as a fraction of the highest possible cost of the subtree."""
        return self._sums[place] / (self._tries[place] * self._scale)

    def _measure(self, place: int, settings: DUCTSettings) -> float:
        """Return the cost by which a value is compared; the mean if none of its samples was a solution."""
        least = self._least[place]
        return self._mean(place) if settings.by == "mean" or least is None else least / self._scale

    def _margin(self, place: int, settings: DUCTSettings) -> float:
        """Return by how much a value may be better than its samples; this margin falls with the number of tries."""
        return settings.bound * math.sqrt(2 * math.log(2 * self.taken) / self._tries[place])


MOST_ROBOTS = 100_000
"""The maximum number of robots in a separator."""
Key = tuple[wire.Value, ...]
"""The values in a separator, in its order."""


class DUCT(TreeProtocol):
    """One agent of DUCT.

    State: `separators` of the children, this robot's `separator`, `dearest` (the highest possible cost of the subtree),
    `known` (the samples in each context), and, for the present sample, the `view` (the context) and its `samples`.
    """

    messages = TreeMessage | Separator | SampleContext | SampleCost | Fixed
    settings: ClassVar[DUCTSettings] = DUCTSettings()
    traits = Traits(
        concludes=ENDS_WITH_PROOF,
        paper="Ottens, Dimitrakakis, Faltings 2012",
        complete=False,
        costs=True,
        shared_scopes=True,
        writes_to_non_neighbours=False,
        privacy="constraints of others, but for sums",
        use_when="costs, tree too wide for dpop: better with more samples",
    )

    def __init__(self, problem: LocalProblem, order: PriorityOrder) -> None:
        super().__init__(problem, order)
        self.separators: dict[str, tuple[str, ...]] = {}
        self.separator: tuple[str, ...] = ()
        self.dearest = 0
        self.known: dict[Key, Samples] = {}
        self.view: dict[str, wire.Value] = {}
        self.samples = Samples([], 0)
        self.fixed = self.chosen = False
        self._costs: dict[str, SampleCost] = {}
        """The children's costs in the present sample."""
        self._sampling = False

    def start_in_tree(self) -> None:
        """Send the parent the separator, if there are no children to wait for."""
        own = [charge for _, charge in self.problem.scopes(self.ancestors)]
        own.append(max((charge for charge in self.problem.charges if charge != float("inf")), default=0))
        self.dearest = int(sum(own))
        self._send_separator()

    def handle(self, sender: str, message: wire.Message) -> None:
        match cast("Separator | SampleContext | SampleCost | Fixed", message):
            case Separator(robots, dearest):
                self._receive_separator(sender, robots, dearest)
            case SampleContext(values):
                self._enter_context(sender, values)
                self._sample()
            case SampleCost() as cost:
                self._receive_cost(sender, cost)
            case Fixed(values):
                self._enter_context(sender, values)
                self._start_fixed_samples()
            case never:
                assert_never(never)

    # The separators, from the leaves up

    def _receive_separator(self, child: str, robots: list[str], dearest: int) -> None:
        """Store a child's separator."""
        if child not in self.children or child in self.separators:
            raise ValueError(f"{child} sent an unexpected or repeated Separator")
        if self.problem.agent not in robots or dearest < 0 or len({*robots}) < len(robots) or len(robots) > MOST_ROBOTS:
            raise ValueError(f"{child} sent an invalid separator: {', '.join(robots[:10])}, cost {dearest}")
        self.separators[child] = tuple(robots)
        self.dearest += dearest
        self._send_separator()

    def _send_separator(self) -> None:
        """Send the parent the separator, when all children have sent theirs; the root starts to sample."""
        if len(self.separators) < len(self.children):
            return
        others = (name for child in self.children for name in self.separators[child] if name != self.problem.agent)
        self.separator = tuple(dict.fromkeys((*self.ancestors, *others)))
        if self.parent is None:
            if self.separator:
                raise ValueError(f"{self.problem.agent} is a root, and {', '.join(self.separator)} cannot be above it")
            self._enter_context(None, {})
            self._start_fixed_samples()
        else:
            self.send(self.parent, Separator(list(self.separator), self.dearest))

    # Contexts, from the root down

    def _enter_context(self, sender: str | None, values: Mapping[str, wire.Value]) -> None:
        """Make a context the present one, with its stored samples or without samples if it is new."""
        if sender != self.parent or self._sampling or self.fixed:
            raise ValueError(f"{sender} requested an unexpected sample from {self.problem.agent}")
        if values.keys() != {*self.separator}:
            expected = ", ".join(self.separator)
            raise ValueError(f"{self.problem.agent} depends on {expected}, but received values of other robots")
        self.view = dict(values)
        key = tuple(values[name] for name in self.separator)
        known = self.known.get(key)
        if known is None:
            known = Samples(self.problem.lexicographic_costs(self.view), self.dearest)
            if self.children and len(self.known) < self.settings.contexts:
                self.known[key] = known
        self.samples = known

    def _start_fixed_samples(self) -> None:
        """Start to sample as the root of this robot's subtree, once the robots above have chosen."""
        self.fixed = True
        self._sample_or_choose()

    def _sample_or_choose(self) -> None:
        """Make another sample as the root of the subtree, or choose the final value."""
        if self.children and not self.samples.enough(self.settings):
            self._sample()
            return
        if self.parent is None and not self.samples.options:
            self.conclude(Verdict.NO_SOLUTION)
            return
        self.chosen = True
        self.value = self.samples.final()
        for child in self.children:
            self.send(child, Fixed(self._context_of(child)))

    def _sample(self) -> None:
        """Choose the next value, and let the children sample for it; a leaf knows its cost at once."""
        self.value = self.samples.next(self.settings)
        self._sampling = True
        self._costs.clear()
        if self.children and self.samples.options:
            for child in self.children:
                self.send(child, SampleContext(self._context_of(child)))
        else:
            self._record_cost()

    def _context_of(self, child: str) -> dict[str, wire.Value]:
        """Return the values in a child's separator."""
        values = {**self.view, self.problem.agent: self.problem.values[self._present]}
        return {name: values[name] for name in self.separators[child]}

    # Costs, from the leaves up

    def _receive_cost(self, child: str, cost: SampleCost) -> None:
        """Store the cost of a child's sample; record the total once all children have sent theirs."""
        if not self._sampling or child not in self.children or child in self._costs:
            raise ValueError(f"{child} sent an unexpected or repeated SampleCost")
        if min(cost.broken, cost.cost, cost.best or 0) < 0 or (cost.hopeless and cost.best is not None):
            raise ValueError(f"{child} sent invalid costs of a sample: {cost}")
        self._costs[child] = cost
        if len(self._costs) == len(self.children):
            self._record_cost()

    def _record_cost(self) -> None:
        """Record the cost of the sample; send it to the parent, or continue if the robots above have chosen."""
        self._sampling = False
        below = [self._costs[child] for child in self.children if child in self._costs]
        broken, cost = self.samples.total(self._present, [(child.broken, child.cost) for child in below])
        if any(child.hopeless for child in below):
            self.samples.rule_out(self._present)
        elif self.samples.options:
            self.samples.add(self._present, (broken, cost), [child.best for child in below])
        if self.fixed:
            self._sample_or_choose()
        else:
            best = self.samples.best
            self.send(self.parent or "", SampleCost(int(broken), int(cost), best, not self.samples.options))

    @property
    def _present(self) -> int:
        assert self.value is not None  # noqa: S101 - for mypy: `_sample` chooses one
        return self.value
