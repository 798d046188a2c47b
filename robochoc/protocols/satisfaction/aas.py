"""Asynchronous Aggregation Search (AAS).

ABT in which robots propose aggregates (sets of values) instead of single values. A robot sends lower-priority
neighbours values that are all consistent with every combination of the sets received from above. So the proposals of
all robots remain a Cartesian product of solutions, a robot has values in reserve, and one nogood rules out whole sets.

- **When to use**: no costs, hard problems over numbers, with constraints such as x + 2 <= y, or times that must not
  overlap. On constraints without such a structure, and on easy problems, ABT does as well or better; it nearly always
  makes fewer constraint checks, because AAS checks whole sets (figures: documentation, page
  Replications: constraint satisfaction).
- **Guarantees**: complete; it terminates with a solution or with a proof that there is none. At the end every
  combination of values from the robots' aggregates is a solution; each robot takes the first value of its aggregate.
  Space is polynomial: one nogood for each value.
- **Parameters (`--set`)**: `largest` (the maximum number of values in an aggregate; default 4). With 1 it sends the
  same messages as ABT.
- **Reference**: Silaghi, Sam-Haroud, Faltings: "Asynchronous search with aggregations", AAAI 2000. Only an abstract and
  a digest of the paper were available. Methods not listed here have the names of ABT's (`abt.py`).

Where the rules are implemented:

    aggregates consistent with all of the view      `_choose_aggregate`, `_gaps`
    the largest Cartesian product                   `_best_part`, `_wanted`
    nogoods over aggregates                         `AggregateStore`, `_backtrack`, `_resolve_conflict`
    add-link                                        `_check_add_link`, `_set_link`

Differences from the paper: there, robots own constraints and share variables, and a robot narrows other robots'
variables by itself, with a history of the robots that did so. Here each robot owns one variable, and others ask the
owner to narrow it:

- If a constraint excludes a value with every combination of the sets in its scope, a nogood over these sets rules the
  value out. A robot all of whose values are ruled out sends the resolvent: no solution has one of the receiver's values
  while the others keep to their sets. This is true for any proposals, so the conclusion that there is no solution is
  sound. The nogood applies as long as the sets cover the proposals.
- If no value is consistent with the whole view, but some values are consistent with a part of it, the robot takes the
  value with the largest part, asks the robots that propose too much to propose no more than that part (`Narrow`), and
  assumes that they do. They keep the rest for later; nothing is ruled out. In an n-ary constraint the lowest robot with
  a choice is asked.
- A robot keeps the values of its aggregate that are still consistent with the view; it chooses a new aggregate only
  when none is left.

Termination: the highest robot's view never changes. Each change of its aggregate makes the aggregate smaller, or
follows a value that is ruled out for good; both happen finitely often. Then the view of the next robot stops changing,
and so on. A robot that sends a request, or forgets an aggregate after a nogood, always receives the next aggregate: the
receiver either does as asked and sends its aggregate, or had sent a different one before the request arrived.

Choices that ABT's paper leaves open are made as in `abt.py`: n-ary constraints, packets, the choice among nogoods,
interchangeable values. Partially known constraints are refused: a higher robot would need the sets of lower robots.

>>> from robochoc.generators.meetings import meetings
>>> from robochoc.run import Options, Runtime, solve
>>> team = meetings(6, 10, 2, 10, seed=6, max_length=4, max_value=None, model="eav")
>>> for largest in ("1", "4"):
...     options = Options(protocol="aas", runtime=Runtime.SIMULATOR, settings={"largest": largest})
...     outcome = solve(team, options)
...     print(outcome.verdict.value, sum(outcome.metrics.messages.values()))
no-solution 2198
no-solution 1114
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from fractions import Fraction
from itertools import product
from typing import Any, ClassVar, assert_never, cast

from robochoc.model.outcome import Verdict
from robochoc.protocols import acts
from robochoc.protocols.acts import Act, Performative
from robochoc.protocols.disclosure import INFINITE, NOTHING, EveryValuePays, HasValue, Proof, Reception
from robochoc.protocols.message import Message, Value
from robochoc.protocols.order import PriorityOrder
from robochoc.protocols.protocol import Protocol
from robochoc.protocols.satisfaction.nogood import contradicts, joined
from robochoc.protocols.settings import Settings
from robochoc.protocols.traits import ENDS_WITH_PROOF, Traits
from robochoc.protocols.wording import Wording
from robochoc.solver.local_problem import LocalProblem
from robochoc.solver.shared_constraint import Gap
from robochoc.system.plain_text import listed

Aggregate = tuple[Value, ...]
"""Distinct values of one robot; in nogoods, None if a variable does not matter."""

LeftSide = Mapping[str, Aggregate]


def covers(aggregate: Iterable[Value], values: Iterable[Value]) -> bool:
    """Return whether each of `values` agrees with one in `aggregate`."""
    if aggregate == values:
        return True
    return all(any(not contradicts(one, value) for one in aggregate) for value in values)


def met(left: Aggregate, right: Aggregate) -> Aggregate:
    """Return the intersection of two aggregates of one robot, with all variables that matter in either."""
    if left == right:
        return left
    pairs = ((one, other) for one in left for other in right if not contradicts(one, other))
    return tuple(dict.fromkeys(joined(one, other) for one, other in pairs))


def matching(patterns: Iterable[Value], values: Iterable[Value]) -> Aggregate:
    """Return the `values` that agree with one of `patterns`."""
    return tuple([value for value in values if any(not contradicts(one, value) for one in patterns)])


def left_side(conflicts: Sequence[Mapping[str, Value]]) -> LeftSide:
    """Return the aggregates whose combinations are exactly `conflicts`."""
    return {agent: tuple(dict.fromkeys(one[agent] for one in conflicts)) for agent in conflicts[0]}


class AggregateStore:
    """The left sides of the nogoods that rule out this robot's values, at most one for each value."""

    def __init__(self, order: PriorityOrder, size: int) -> None:
        self._order = order
        self._by_value: list[LeftSide | None] = [None] * size

    def __getitem__(self, index: int) -> LeftSide | None:
        return self._by_value[index]

    def all_open(self) -> list[int]:
        """Return all values that no nogood rules out."""
        return [index for index, lhs in enumerate(self._by_value) if lhs is None]

    def add(self, index: int, lhs: LeftSide) -> None:
        """Store `lhs` against the value at `index`, unless a better nogood is stored there.

        A nogood is better if its lowest variable is higher (Hirayama and Yokoo 2000), or if it is shorter.
        """
        present = self._by_value[index]
        if present is None or self._weakness(lhs) < self._weakness(present):
            self._by_value[index] = lhs

    def forget(self, agent: str, aggregate: Aggregate | None = None) -> None:
        """Drop all nogoods about `agent` that do not cover `aggregate` (None: all about it)."""
        for index, lhs in enumerate(self._by_value):
            if lhs is not None and agent in lhs and (aggregate is None or not covers(lhs[agent], aggregate)):
                self._by_value[index] = None

    def resolve(self, view: Mapping[str, Aggregate]) -> dict[str, Aggregate]:
        """Return the conjunction of all left sides: the resolvent, if every value has a nogood.

        If an intersection of sets in different variables would be larger than both, values outside `view` are left out.
        """
        found: dict[str, Aggregate] = {}
        for lhs in {id(lhs): lhs for lhs in self._by_value if lhs is not None}.values():
            for agent, aggregate in lhs.items():
                before = found.get(agent, aggregate)
                both = met(before, aggregate)
                large = len(both) > max(len(before), len(aggregate))
                found[agent] = matching(view[agent], both) if large else both
        return found

    def _weakness(self, lhs: LeftSide) -> tuple[int, int]:
        return self._order.depth(lhs), len(lhs)


class AASSettings(Settings, frozen=True):
    """`largest`: the maximum number of values in an aggregate. With 1 the protocol is ABT."""

    largest: int = 4

    def __post_init__(self) -> None:
        if self.largest < 1:
            raise ValueError(f"largest is {self.largest}; it must be 1 or more")


MOST_PROVEN = 256
"""A nogood with more combinations than this gives no proofs."""


class Ok(Message, frozen=True):
    """The sender's aggregate: its possible values, all consistent with the aggregates from above (`ok?`)."""

    values: tuple[Value, ...]

    act = acts.TELL_VALUE
    shareable = True

    def in_words(self, words: Wording) -> str:
        return f"{_one_of(words, words.sender, self.values)} from now on"

    def proves(self, reception: Reception) -> Sequence[Proof]:
        # The sender's value is the first one of its aggregate.
        return [HasValue(reception.sender, self.values[0])] if self.values else NOTHING


class Nogood(Message, frozen=True):
    """No solution has a value in `values` while all robots in `lhs` have values in their sets (`nogood`)."""

    lhs: dict[str, tuple[Value, ...]]
    values: tuple[Value, ...]

    act = acts.RULE_OUT
    backtracks = True

    def in_words(self, words: Wording) -> str:
        while_they = listed([_one_of(words, robot, values) for robot, values in self.lhs.items()])
        condition = f"as long as {while_they}, " if while_they else ""
        rest = "" if while_they else ", whatever the others do"
        return f"{condition}it cannot be that {_one_of(words, words.receiver, self.values)}{rest}"

    def proves(self, reception: Reception) -> Sequence[Proof]:
        # A nogood of any robot but the lowest may follow from constraints of the robots below it.
        if not reception.fixed_holders or not reception.is_lowest(reception.sender):
            return NOTHING
        broken: Mapping[str, tuple[Value, ...]] = {**self.lhs, reception.receiver: self.values}
        if math.prod(map(len, broken.values())) > MOST_PROVEN:
            return NOTHING
        chosen = product(*broken.values())
        return [EveryValuePays(reception.sender, dict(zip(broken, one, strict=True)), INFINITE) for one in chosen]


class Narrow(Message, frozen=True):
    """A request to keep only these values in the receiver's aggregate: the others conflict with the sender."""

    values: tuple[Value, ...]

    act = Act(
        Performative.REQUEST, "the sender has a value for a part of the receiver's aggregate, but none for all of it"
    )
    proves_nothing = True

    def in_words(self, words: Wording) -> str:
        return f"please keep to this: {_one_of(words, words.receiver, self.values)}"


class AddLink(Message, frozen=True):
    """A lower-priority robot's request to be sent the receiver's aggregates from now on (`add-link`)."""

    act = acts.ADD_LINK
    proves_nothing = True

    def in_words(self, words: Wording) -> str:
        return f"tell me {words.variables(words.receiver)} from now on"


def _one_of(words: Wording, robot: str, values: Sequence[Value]) -> str:
    """Return an aggregate in words: `V1.1 is 1, 2 or 3`, `(A, B) is (1, 2) or (1, 3)`; without irrelevant variables."""
    parts = [words.parts(robot, value) for value in values]
    names = [name for name, _ in parts[0]] if parts else []
    if len(names) == 1:
        return f"{names[0]} is {listed([part for value in parts for _, part in value], 'or')}"
    shown = listed([f"({', '.join(part for _, part in value)})" for value in parts], "or")
    return f"({', '.join(names)}) is {shown}" if names else f"{robot} has any value"


class AAS(Protocol):
    """One agent of AAS.

    `aggregate` contains the indices of the proposed values; `sent` the indices that were last sent. `sets` are the
    aggregates of higher robots (the view), `store` the nogoods. `asked` are requests not yet sent.
    """

    messages: ClassVar[Any] = Ok | Nogood | Narrow | AddLink
    settings: ClassVar[AASSettings] = AASSettings()
    traits: ClassVar[Traits] = Traits(
        concludes=ENDS_WITH_PROOF,
        paper="Silaghi, Sam-Haroud & Faltings 2000",
        privacy="constraints of lower robots",
        use_when="no costs, and orders (<=) or intervals of numbers",
    )

    def __init__(self, problem: LocalProblem, order: PriorityOrder) -> None:
        super().__init__(problem, order)
        self.sets: dict[str, Aggregate] = {}
        self.store = AggregateStore(order, len(problem.values))
        self.higher = set(problem.parents)
        self.lower = list(problem.children)
        self.aggregate: list[int] = []
        self.sent: list[int] = []
        self.asked: dict[str, Aggregate] = {}

    def start(self) -> None:
        """Choose a first aggregate and send it."""
        self._check_agent_view()

    def receive(self, sender: str, message: Message) -> None:
        if self.verdict is not None:
            return
        match cast("Ok | Nogood | Narrow | AddLink", message):
            case Ok(values):
                self._process_info(sender, values)
            case Nogood() as nogood:
                self._resolve_conflict(sender, nogood)
            case Narrow(values):
                self._narrow_down(values)
            case AddLink():
                self._set_link(sender)
            case never:
                assert_never(never)

    def settle(self) -> None:
        """Check the view once the inbox is empty."""
        self._check_agent_view()

    # Messages

    def _process_info(self, sender: str, values: Aggregate) -> None:
        if not 0 < len(values) <= self.settings.largest:
            raise ValueError(f"{sender} proposes {len(values)} values; it must be 1 to {self.settings.largest}")
        self._update(sender, values)

    def _resolve_conflict(self, sender: str, nogood: Nogood) -> None:
        """Accept a nogood about values in the aggregate that agrees with the view; all other nogoods are obsolete."""
        self._validate(sender, nogood)
        left = [index for index in self.aggregate if not self._is_in(nogood.values, index)]
        if len(left) == len(self.aggregate):
            return
        if self._coherent(nogood):
            self._check_add_link(nogood)
            for value in nogood.values:
                for index in self.problem.interchangeable(value):
                    self.store.add(index, nogood.lhs)
            self._propose(left)
            if not left:
                self.sent = []
        else:
            # The sender's view was outdated, and the sender has forgotten this robot's aggregate: send it again.
            self.send(sender, self._ok())

    def _validate(self, sender: str, nogood: Nogood) -> None:
        rank = self.order.rank
        if not nogood.values or not all(nogood.lhs.values()):
            raise ValueError(f"a nogood of {sender} has an empty set")
        if any(rank.get(agent, len(rank)) >= rank[self.problem.agent] for agent in nogood.lhs):
            raise ValueError(f"a nogood of {sender} names a robot that is not above {self.problem.agent}")

    def _narrow_down(self, values: Aggregate) -> None:
        """Keep no more than `values`; if the aggregate contains none of them, the request is obsolete."""
        remaining = [index for index in self.aggregate if self._is_in(values, index)]
        if remaining:
            self._propose(remaining)

    def _set_link(self, sender: str) -> None:
        if sender not in self.lower:
            self.lower.append(sender)
        if self.aggregate:
            self.send(sender, self._ok())

    # The search

    def _check_agent_view(self) -> None:
        """Keep the part of the aggregate that the view allows; otherwise choose another, ask, or backtrack."""
        while self.verdict is None:
            remaining = [index for index in self.aggregate if self._is_consistent(index)]
            if not remaining:
                remaining, partly = self._choose_aggregate()
                if not remaining:
                    self._propose([])
                    self.sent = []
                    if partly:
                        self._assume_less(self._best_part(partly))
                    else:
                        self._backtrack()
                    continue
            self._propose(remaining)
            if remaining != self.sent:
                self._send_aggregate()
            break
        self._ask()

    def _is_consistent(self, index: int) -> bool:
        """Return whether the value at `index` is consistent with every combination in the view."""
        return self.store[index] is None and self._gaps(index) == []

    def _choose_aggregate(self) -> tuple[list[int], dict[int, list[Gap]]]:
        """Return the first values consistent with every combination in the view, and values consistent with some."""
        whole: list[int] = []
        partly: dict[int, list[Gap]] = {}
        for index in self.store.all_open():
            gaps = self._gaps(index)
            if gaps:
                partly[index] = gaps
            elif gaps is not None:
                whole.append(index)
                if len(whole) == self.settings.largest:
                    break
        return whole, partly

    def _gaps(self, index: int) -> list[Gap] | None:
        """Return the constraints that the value at `index` violates for a part of the view.

        None: it violates a constraint for all of the view; this nogood is stored.
        """
        gaps: list[Gap] = []
        for gap in self.problem.gaps(index, self.sets):
            if not gap.allowed:
                self.store.add(index, left_side(gap.broken))
                return None
            gaps.append(gap)
        return gaps

    def _best_part(self, partly: Mapping[int, Sequence[Gap]]) -> Sequence[Gap]:
        """Return the violated constraints of the value that is consistent with the largest part of the view."""
        return max(partly.values(), key=_share)

    def _assume_less(self, gaps: Iterable[Gap]) -> None:
        """Assume that robots in violated constraints propose only consistent values; note the requests to send."""
        for gap in gaps:
            agent, wanted = self._wanted(gap)
            less = matching(wanted, self.sets[agent])
            if less:
                self._update(agent, less)
                self.asked[agent] = less

    def _wanted(self, gap: Gap) -> tuple[str, Sequence[Value]]:
        """Return the lowest robot in a violated constraint that has a choice, and the values that it should keep.

        These are all values that are consistent with every combination of the others; if there are none, the value that
        is consistent with most combinations.
        """
        combinations = [*gap.allowed, *gap.broken]
        choices = left_side(combinations)
        agent = self.order.lowest([one for one, values in choices.items() if len(values) > 1])
        bad = [one[agent] for one in gap.broken]
        wanted = [value for value in choices[agent] if value not in bad]
        good = [one[agent] for one in gap.allowed]
        return agent, wanted or [max(choices[agent], key=good.count)]

    def _ask(self) -> None:
        """Send the requests to robots that are assumed to propose less."""
        for agent, values in self.asked.items():
            self.send(agent, Narrow(values))
        self.asked.clear()

    def _send_aggregate(self) -> None:
        """Send the aggregate to all robots that depend on it."""
        self.sent = list(self.aggregate)
        ok = self._ok()
        for neighbour in self.lower:
            self.send(neighbour, ok)

    def _backtrack(self) -> None:
        """Resolve the stored nogoods, one for each value, and send the result to the lowest-priority robot in it."""
        lhs = self.store.resolve(self.sets)
        if not lhs:
            self.conclude(Verdict.NO_SOLUTION)
            return
        culprit = self.order.lowest(lhs)
        values = lhs.pop(culprit)
        self.send(culprit, Nogood(lhs, values))
        self.asked.pop(culprit, None)
        self._update(culprit, None)

    def _propose(self, aggregate: list[int]) -> None:
        """Propose `aggregate`; its first value becomes this robot's value."""
        self.aggregate = aggregate
        self.value = aggregate[0] if aggregate else None

    def _ok(self) -> Ok:
        return Ok(tuple([self.problem.values[index] for index in self.aggregate]))

    def _is_in(self, values: Aggregate, index: int) -> bool:
        return covers(values, (self.problem.values[index],))

    # The view

    def _update(self, agent: str, values: Aggregate | None) -> None:
        """Store a new aggregate of `agent` (None: unknown); drop nogoods that do not cover it."""
        if values is None:
            self.sets.pop(agent, None)
        else:
            self.sets[agent] = values
        self.store.forget(agent, values)

    def _coherent(self, nogood: Nogood) -> bool:
        return all(
            agent in self.sets and covers(values, self.sets[agent])
            for agent, values in nogood.lhs.items()
            if agent in self.higher
        )

    def _check_add_link(self, nogood: Nogood) -> None:
        """Request links to robots in the nogood that send nothing yet; assume the nogood's values for now."""
        for agent, values in nogood.lhs.items():
            known = self.sets.get(agent)
            more = values if known is None else met(known, values)
            if more != known:
                self._update(agent, more)
            if agent not in self.higher:
                self.higher.add(agent)
                self.send(agent, AddLink())


def _share(gaps: Sequence[Gap]) -> Fraction:
    """Return the share of combinations that a value is consistent with, as if no robot were in two constraints."""
    share = Fraction(1)
    for gap in gaps:
        share *= Fraction(len(gap.allowed), len(gap.allowed) + len(gap.broken))
    return share
