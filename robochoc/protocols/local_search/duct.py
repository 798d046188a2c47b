"""Distributed Upper Confidence Tree (DUCT).

Sampling on a pseudo-tree. A sample starts at the root: each robot is told the values above it that matter to its
subtree (the context), takes a value, and passes the context on. The costs of the sample come back from the leaves. A
robot keeps for each context how often it has tried each value, and what that has cost. It tries the value with the
best confidence bound: what was cheap is tried often, and what is hardly known now and then.

- **When to use**: costs, and a pseudo-tree that is too wide for `dpop`: the more samples, the better.
- **Guarantees**: incomplete; the cost at the end is no more than the best that the root knows. Memory is bounded by
  `contexts` times the size of the domain. A robot with an empty domain proves that there is no solution, and so does a
  root none of whose values has one below.
- **Parameters (`--set`)**: `samples` (default 300), `by` (`mean`, default, or `best`), `bound` (default 1), `error`
  (default 0.1), `confidence` (default 0.9), `contexts` (default 10,000).
- **Reference**: Ottens, Dimitrakakis, Faltings: "DUCT: an upper confidence bound approach to distributed constraint
  optimization problems", AAAI 2012; ACM TIST 8(5), 2017.

Its parts:

    build the pseudo-tree           `dfs.TreeProtocol`    COST, from the leaves up       `_learn`
    CONTEXT, from the root down     `_sample`             the value to be sampled        `Samples.next`
    the end of a robot's samples    `Samples.enough`      the value at the end           `Samples.final`

After its samples, the root fixes the value with the best cost. Then its children go on sampling, each as the root of
its own subtree, until they fix theirs, and so on. A robot stops when with the given confidence no other value is better
by more than `error`, but after `samples` samples in this context at the latest. Those that it took before count.

Choices that the paper leaves open, and differences:

- Before the first sample, robots tell their parents their separators, and the most that their subtrees can cost. By
  that the costs are normalised.
- Values that were never tried come first, the cheapest of them by what is known above. Ties go to the first value.
- A value that breaks a hard constraint with robots above is never tried. A context with no other value is hopeless, and
  its parent never takes its value in that context again. A broken constraint in a sample counts as the most that the
  subtree can cost.
- Besides the cost of the sample, a robot tells the best that it knows for this context. Bests of several children add
  up even if they come from different samples, so the end may be better than every sample.
- When `contexts` are in memory, nothing is forgotten: in new ones a robot takes its cheapest value, which it can do
  again. So what a robot has told to be possible stays so. A leaf keeps nothing, as it knows its costs.
- Constraints may be n-ary, as all robots of a scope are on one branch. The lowest of them pays.

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
    Hearing,
    Proof,
    SomeValuePays,
    StandsAt,
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
    """`samples`: after how many samples a robot chooses its value at the latest.

    `by`: whether values are compared by the `mean` cost of their samples, or by the `best` one. `bound`: by what the
    confidence bound is multiplied; more tries dear values more often. `error` and `confidence`: a robot also chooses
    when, with this confidence, no other value is better by more than this part of what its subtree can cost at most.
    `contexts`: how many combinations of values above it a robot keeps samples of.
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
                raise ValueError(f"{name} is {measure:g}; it must be 0 or more")
        if not 0 < self.confidence < 1:
            raise ValueError(f"confidence is {self.confidence:g}; it must be between 0 and 1")


class Separator(wire.Message, frozen=True):
    """The robots above the sender that matter to its subtree, and the most that the subtree can cost.

    That is, without broken hard constraints.
    """

    robots: list[str]
    dearest: int

    act = Act(Performative.INFORM, "the receiver comes to know whose values the sender has to be told")
    proves_nothing = True

    def in_words(self, _: Wording) -> str:
        return f"my subtree depends on {listed(self.robots)}, and costs {cost_text(self.dearest)} at most"


class SampleContext(wire.Message, frozen=True):
    """The values of the receiver's separator in this sample (CONTEXT)."""

    values: dict[str, wire.Value]

    act = Act(Performative.REQUEST, "the receiver is to take a sample of its subtree for these values")

    def in_words(self, words: Wording) -> str:
        return f"sample your subtree with {words.assigned(self.values.items())}"

    def proves(self, _: Hearing) -> Sequence[Proof]:
        return [can_take(*chosen) for chosen in self.values.items()]


class SampleCost(wire.Message, frozen=True):
    """The cost of the sample in the sender's subtree: broken hard constraints, and costs (COST).

    `best`: the least that is known for these values without a broken one, and None before there is any. `hopeless`:
    there is none, whatever the subtree does.
    """

    broken: int
    cost: int
    best: int | None
    hopeless: bool

    act = Act(Performative.INFORM, "the receiver comes to know what its sample costs below")

    def in_words(self, _: Wording) -> str:
        broken = f", and breaks {counted(self.broken, 'constraint')}" if self.broken else ""
        if self.hopeless:
            best = "with these values there is no solution"
        else:
            best = "no solution yet" if self.best is None else f"the best so far costs {cost_text(self.best)}"
        return f"this sample costs my subtree {cost_text(self.cost)}{broken}; {best}"

    def proves(self, hearing: Hearing) -> Sequence[Proof]:
        """Return what the message proves to its receiver: the sender pays no more than its subtree does.

        If all its neighbours are in the context, nobody is below, and what is hopeless is so by its own constraints.
        """
        asked = hearing.last(SampleContext, hearing.receiver, hearing.sender)
        if asked is None:
            return NOTHING
        found: list[Proof] = []
        if not self.broken:
            found.append(SomeValuePays(hearing.sender, asked.values, self.cost))
        if self.best is not None:
            found.append(SomeValuePays(hearing.sender, asked.values, self.best))
        if self.hopeless and asked.values.keys() >= set(hearing.neighbours(hearing.sender)):
            found.append(EveryValuePays(hearing.sender, asked.values, INFINITE))
        return found


class Fixed(wire.Message, frozen=True):
    """The values of the receiver's separator in the end: it goes on sampling for these only."""

    values: dict[str, wire.Value]

    act = Act(Performative.REQUEST, "the receiver is to choose its value for good, for these values")

    def in_words(self, words: Wording) -> str:
        return f"{words.assigned(self.values.items())} for good; choose your own value"

    def proves(self, _: Hearing) -> Sequence[Proof]:
        return [StandsAt(*chosen) for chosen in self.values.items()]


class Samples:
    """The samples of one context.

    `local` are the costs of the own values with those above, and `options` the values that are still tried: those that
    break nothing above, and below which no context was hopeless. `scale` is the most that the subtree can cost; a
    broken constraint counts as much.
    """

    def __init__(self, local: Sequence[LexicographicCost], scale: int) -> None:
        self.options = [place for place, (broken, _) in enumerate(local) if not broken]
        self.taken = 0
        """The number of samples, of all values."""
        self._local = local
        self._scale = max(1, scale)
        self._tries = [0] * len(local)
        self._sums = [0] * len(local)
        self._least: list[int | None] = [None] * len(local)

    @property
    def best(self) -> int | None:
        """The least cost of the subtree that is known here, without a broken constraint; None if there is none yet."""
        return min((least for place in self.options if (least := self._least[place]) is not None), default=None)

    def total(self, place: int, below: Sequence[LexicographicCost]) -> LexicographicCost:
        """Return what a sample costs the subtree."""
        costs = [self._local[place], *below]
        return int(sum(broken for broken, _ in costs)), int(sum(cost for _, cost in costs))

    def rule_out(self, place: int) -> None:
        """Note that a value has no solution below."""
        self.taken += 1
        self.options = [option for option in self.options if option != place]

    def add(self, place: int, sample: LexicographicCost, below: Sequence[int | None]) -> None:
        """Note what a sample of a value has cost, and the best that each child knows for it."""
        broken, cost = sample
        self.taken += 1
        self._tries[place] += 1
        self._sums[place] += int(broken * self._scale + cost)
        if None not in below:
            self._least[place] = int(self._local[place][1]) + sum(best for best in below if best is not None)

    def next(self, settings: DUCTSettings) -> int:
        """Return the value for the next sample: one never tried, the cheapest first; then the least bound."""
        new = [place for place in self.options if not self._tries[place]]
        if new or not self.options:
            return self._cheapest(new or range(len(self._local)))
        return min(self.options, key=lambda place: self._measure(place, settings) - self._margin(place, settings))

    def final(self) -> int:
        """Return the value of the best solution; while there is none, the one that breaks least in the mean."""
        if self.best is not None:
            return next(place for place in self.options if self._least[place] == self.best)
        tried = [place for place in self.options if self._tries[place]]
        return min(tried, key=self._mean) if tried else self._cheapest(self.options or range(len(self._local)))

    def enough(self, settings: DUCTSettings) -> bool:
        """Return whether no other value is likely to be better by more than the error, or samples are used up."""
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
        """Return the mean cost of a value's samples, as a part of what the subtree can cost."""
        return self._sums[place] / (self._tries[place] * self._scale)

    def _measure(self, place: int, settings: DUCTSettings) -> float:
        """Return the cost by which a value is compared; the mean where no sample of it was a solution."""
        least = self._least[place]
        return self._mean(place) if settings.by == "mean" or least is None else least / self._scale

    def _margin(self, place: int, settings: DUCTSettings) -> float:
        """Return how much better than its samples a value may be: the less, the more often it was tried."""
        return settings.bound * math.sqrt(2 * math.log(2 * self.taken) / self._tries[place])


MOST_ROBOTS = 100_000
"""No separator has more."""
Key = tuple[wire.Value, ...]
"""The values of a separator, in its order."""


class DUCT(TreeProtocol):
    """One agent of DUCT.

    State: `separators` of the children, the own `separator`, `dearest` (the most that the subtree can cost), `known`
    (the samples of each context), and of the present sample the `view` (the context) and its `samples`. `fixed`: the
    robots above have chosen. `chosen`: this one has, too.
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
        """The costs of the present sample that children have told."""
        self._sampling = False

    def start_in_tree(self) -> None:
        """Tell the parent the separator, if no child has one to tell."""
        own = [charge for _, charge in self.problem.scopes(self.ancestors)]
        own.append(max((charge for charge in self.problem.charges if charge != float("inf")), default=0))
        self.dearest = int(sum(own))
        self._tell_separator()

    def handle(self, sender: str, message: wire.Message) -> None:
        match cast("Separator | SampleContext | SampleCost | Fixed", message):
            case Separator(robots, dearest):
                self._keep_separator(sender, robots, dearest)
            case SampleContext(values):
                self._enter(sender, values)
                self._sample()
            case SampleCost() as cost:
                self._keep_cost(sender, cost)
            case Fixed(values):
                self._enter(sender, values)
                self._fix()
            case never:
                assert_never(never)

    # The separators, from the leaves up

    def _keep_separator(self, child: str, robots: list[str], dearest: int) -> None:
        """Store a child's separator."""
        if child not in self.children or child in self.separators:
            raise ValueError(f"{child} had no separator to tell, or has told it already")
        if self.problem.agent not in robots or dearest < 0 or len({*robots}) < len(robots) or len(robots) > MOST_ROBOTS:
            raise ValueError(f"{child} tells a separator that cannot be")
        self.separators[child] = tuple(robots)
        self.dearest += dearest
        self._tell_separator()

    def _tell_separator(self) -> None:
        """Tell the parent the own separator, when all children have told theirs; the root begins to sample."""
        if len(self.separators) < len(self.children):
            return
        others = (name for child in self.children for name in self.separators[child] if name != self.problem.agent)
        self.separator = tuple(dict.fromkeys((*self.ancestors, *others)))
        if self.parent is None:
            if self.separator:
                raise ValueError(f"{self.problem.agent} is a root, and {', '.join(self.separator)} cannot be above it")
            self._enter(None, {})
            self._fix()
        else:
            self.send(self.parent, Separator(list(self.separator), self.dearest))

    # Contexts, from the root down

    def _enter(self, sender: str | None, values: Mapping[str, wire.Value]) -> None:
        """Take up a context: what is known of it, or a first look at its costs."""
        if sender != self.parent or self._sampling or self.fixed:
            raise ValueError(f"{sender} had no sample to begin at {self.problem.agent}")
        if values.keys() != {*self.separator}:
            raise ValueError(f"{self.problem.agent} depends on {', '.join(self.separator)}, and is told of others")
        self.view = dict(values)
        key = tuple(values[name] for name in self.separator)
        known = self.known.get(key)
        if known is None:
            known = Samples(self.problem.lexicographic_costs(self.view), self.dearest)
            if self.children and len(self.known) < self.settings.contexts:
                self.known[key] = known
        self.samples = known

    def _fix(self) -> None:
        """Begin to sample as the root of the own subtree: the robots above have chosen."""
        self.fixed = True
        self._carry_on()

    def _carry_on(self) -> None:
        """Take another sample as the root of the subtree, or choose for good."""
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
        """Take the next value, and let the children sample for it; a leaf knows at once what it costs."""
        self.value = self.samples.next(self.settings)
        self._sampling = True
        self._costs.clear()
        if self.children and self.samples.options:
            for child in self.children:
                self.send(child, SampleContext(self._context_of(child)))
        else:
            self._learn()

    def _context_of(self, child: str) -> dict[str, wire.Value]:
        """Return the values of a child's separator."""
        values = {**self.view, self.problem.agent: self.problem.values[self._present]}
        return {name: values[name] for name in self.separators[child]}

    # Costs, from the leaves up

    def _keep_cost(self, child: str, told: SampleCost) -> None:
        """Store what a child's sample costs; learn from it when all have told."""
        if not self._sampling or child not in self.children or child in self._costs:
            raise ValueError(f"{child} had no sample to tell of, or has told it already")
        if min(told.broken, told.cost, told.best or 0) < 0 or (told.hopeless and told.best is not None):
            raise ValueError(f"{child} tells costs that cannot be")
        self._costs[child] = told
        if len(self._costs) == len(self.children):
            self._learn()

    def _learn(self) -> None:
        """Note what the sample has cost, and tell the parent, or go on where the robots above have chosen."""
        self._sampling = False
        below = [self._costs[child] for child in self.children if child in self._costs]
        broken, cost = self.samples.total(self._present, [(told.broken, told.cost) for told in below])
        if any(told.hopeless for told in below):
            self.samples.rule_out(self._present)
        elif self.samples.options:
            self.samples.add(self._present, (broken, cost), [told.best for told in below])
        if self.fixed:
            self._carry_on()
        else:
            best = self.samples.best
            self.send(self.parent or "", SampleCost(int(broken), int(cost), best, not self.samples.options))

    @property
    def _present(self) -> int:
        assert self.value is not None  # noqa: S101 - for mypy: `_sample` takes one
        return self.value
