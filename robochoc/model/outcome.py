"""The outcome of a run: the typed form of the JSON result (docs/reference/result.md)."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import StrEnum
from typing import NamedTuple

from robochoc.model.absence import DroppedConstraint
from robochoc.model.cost_units import Cost

RULED_OUT = "has ruled everything out"
"""The reason for which one robot can conclude `no-solution`. It covers every protocol: the robot has derived the empty
nogood, tried all values, or used bounds."""


class Verdict(StrEnum):
    """The answer to a problem; `UNKNOWN` when a limit was reached first."""

    SOLUTION = "solution"
    OPTIMAL = "optimal"
    NO_SOLUTION = "no-solution"
    UNKNOWN = "unknown"


@dataclass(frozen=True)
class Metrics:
    """The metrics of a run. Definitions are in `docs/reference/metrics.md`.

    Attributes:
        messages: The number of protocol messages sent, by type.
        bytes: The bytes of their encoded contents.
        ncccs: Non-concurrent constraint checks.
        checks: Constraint checks of all robots.
        wall_s: Seconds of wall-clock time.
        compile_s: Seconds before that, in which local domains were compiled.
        memory: Bytes that the largest robot's process alone used in the end. 0: robots had no processes.
        simulated_s: Seconds of simulated time, by a channel model. 0: there was none.
        largest: Bytes of the largest message's content.
        cycles: Cycles of the simulator's schedule `cycles`. 0: they were not counted.
        lost_messages: How many messages were lost on their way, for good.
    """

    messages: dict[str, int] = field(default_factory=dict)
    bytes: int = 0
    ncccs: int = 0
    checks: int = 0
    wall_s: float = 0.0
    compile_s: float = 0.0
    memory: int = 0
    simulated_s: float = 0.0
    largest: int = 0
    cycles: int = 0
    lost_messages: int = 0

    def __add__(self, other: Metrics) -> Metrics:
        """Return the cost of two runs, one after the other."""
        types = sorted({*self.messages, *other.messages})
        return Metrics(
            messages={name: self.messages.get(name, 0) + other.messages.get(name, 0) for name in types},
            bytes=self.bytes + other.bytes,
            ncccs=self.ncccs + other.ncccs,
            checks=self.checks + other.checks,
            wall_s=self.wall_s + other.wall_s,
            compile_s=self.compile_s + other.compile_s,
            memory=max(self.memory, other.memory),
            simulated_s=self.simulated_s + other.simulated_s,
            largest=max(self.largest, other.largest),
            cycles=self.cycles + other.cycles,
            lost_messages=self.lost_messages + other.lost_messages,
        )


@dataclass(frozen=True)
class PseudoTreeNode:
    """A robot's place in a pseudo-tree.

    Attributes:
        parent: The robot right above it. None: it is a root.
        pseudo_parents: Its other neighbours on the way to the root.
    """

    parent: str | None
    pseudo_parents: tuple[str, ...] = ()


class Improvement(NamedTuple):
    """An answer that was published while the search went on: it is better than all before.

    Attributes:
        at_s: The seconds since the run, or the epoch, began.
        verdict: What was known of it then: `SOLUTION`, or `OPTIMAL`.
        cost: What it costs, in the user's numbers.
        withdrawn: The robots that do not fly.
    """

    at_s: float
    verdict: Verdict
    cost: Cost | None
    withdrawn: tuple[str, ...] = ()


@dataclass(frozen=True)
class EpochOutcome:
    """The outcome of one epoch of a problem that changes over time, or whose robots were lost.

    Attributes:
        verdict: The answer to the problem.
        robots: The robots of the team in this epoch, in the files' order.
        opened_by: What opened the epoch, in a few words.
        assignment: The values of all variables of the robots that are not withdrawn.
        cost: The cost of the assignment. None: there is no assignment.
        metrics: What the epoch took.
        verified: As in `Outcome`.
        witness: As in `Outcome`.
        lost: The robots whose loss ended the epoch.
        bound: As in `Outcome`.
        tree: As in `Outcome`.
        confirmed: As in `Outcome`.
        improvements: As in `Outcome`.
        dropped_constraints: As in `Outcome`.
    """

    verdict: Verdict
    robots: tuple[str, ...]
    opened_by: str = "the start"
    assignment: dict[str, int] = field(default_factory=dict)
    cost: Cost | None = None
    metrics: Metrics = field(default_factory=Metrics)
    verified: bool = False
    witness: str | None = None
    lost: tuple[str, ...] = ()
    bound: Cost | None = None
    tree: dict[str, PseudoTreeNode] = field(default_factory=dict)
    confirmed: bool = False
    improvements: tuple[Improvement, ...] = ()
    dropped_constraints: tuple[DroppedConstraint, ...] = ()


CENTRAL_SOLVER = "the central solver"
"""The name of ACE, and of what is done before it is asked, in `confirmed_by`."""
ALL_ROBOTS = "all robots"
"""The `claimed_by` of a verdict that any one of the robots could have made untrue. No robot has such a name."""


class CheckCounts(NamedTuple):
    """Across machines: the numbers of checked constraints, by the robots that checked them.

    Attributes:
        by_both: Checked by the robot that holds the constraint, and by another one.
        by_owner: Checked by the robot that holds the constraint alone.
    """

    by_both: int
    by_owner: int


class Optima(NamedTuple):
    """The list of optima, or of solutions, that a protocol has found.

    Attributes:
        number: How many there are that robots can tell apart.
        assignments: The first ones, each checked: the values of all variables of the robots that are not withdrawn.
    """

    number: int
    assignments: tuple[dict[str, int], ...]


@dataclass(frozen=True)
class Preprocessing:
    """The result of a preprocessing step, which robots took before the protocol began; of all epochs together.

    Attributes:
        name: What it is called: `ac`.
        metrics: What it took. It is not part of the run's other metrics.
        removed: How many values of robots it has removed.
        values: How many there were.
    """

    name: str
    metrics: Metrics
    removed: int
    values: int


@dataclass(frozen=True)
class Outcome:
    """The result of a run. With several epochs the verdict is that of the last one, and metrics are summed up.

    Attributes:
        team: The name of the team.
        protocol: The protocol that was asked for, or chosen.
        runtime: The runtime.
        seed: The seed of the run.
        verdict: The answer to the problem.
        assignment: The values of all variables of the robots that are not withdrawn, as the integers that robots
            compute with: those of `symbolic` variables are places in `symbols`. `Solution.values` has the values of
            the user.
        cost: The cost of the assignment in the user's numbers, exactly; the utility where that is maximised. None:
            there is no assignment.
        withdrawn: The names of the withdrawn robots, the lost ones included.
        metrics: What the run took.
        verified: Whether the checker has compared the assignment with every constraint of a team that was validated
            before; for `no-solution`, whether the central solver has found the same.
        witness: The robot that ended the search: for `no-solution`, the one that has `RULED_OUT`.
        reason: Why, where it is not obvious: a robot without a local solution, or the limit that was reached.
        count: The number of solutions, if it was asked for.
        lost: The names of the withdrawn robots whose processes died, and that did not come back.
        order: The name of the priority order that was asked for, or chosen; `listed` for a list of names.
        bound: A lower bound on the cost of any assignment (an upper one on the utility, where that is maximised); with
            withdrawal, on the weight of the withdrawn robots. None: not known.
        tree: The pseudo-tree that the robots have built, if their protocol builds one.
        confirmed: Whether the central solver was asked, and has found the same `no-solution` or the same minimum cost.
        confirmed_by: The names of the solvers that have found the same, on the machine of the run.
        epochs: The epochs, if there were several.
        channel: The name of the channel model, if time was simulated by one.
        placed_by: The protocol of the withdrawal, if it is not the one that was asked for.
        claimed_by: Across machines: the robot whose claim the verdict rests on, as it cannot be checked; or
            `ALL_ROBOTS`.
        checked: Across machines: how many constraints were checked, and by whom.
        symbols: The names of the team's symbols, if it has any: the value 2 stands for the one at place 2.
        symbolic: The variables whose values stand for symbols.
        chosen: Why the `protocol`, or the `order`, was chosen, where nobody asked for it.
        preprocessing: What the robots have done before, if that was asked for.
        optima: The optima, or solutions, if the protocol lists them.
        deadline: The seconds after which an answer was due, if the search was ended by the time and the answer is the
            best that was known by then.
        improvements: The answers that were published while the search went on, the first of them at the deadline.
        dropped_constraints: The constraints between robots that were dropped because robots are absent, if there is an
            assignment (`model/absence.py`). Across machines no robot knows all of them, and none is listed.
    """

    team: str
    protocol: str
    runtime: str
    seed: int
    verdict: Verdict
    assignment: dict[str, int] = field(default_factory=dict)
    cost: Cost | None = None
    withdrawn: tuple[str, ...] = ()
    metrics: Metrics = field(default_factory=Metrics)
    verified: bool = False
    witness: str | None = None
    reason: str | None = None
    count: int | None = None
    lost: tuple[str, ...] = ()
    order: str | None = None
    bound: Cost | None = None
    tree: dict[str, PseudoTreeNode] = field(default_factory=dict)
    confirmed: bool = False
    confirmed_by: tuple[str, ...] = ()
    epochs: tuple[EpochOutcome, ...] = ()
    channel: str | None = None
    placed_by: str | None = None
    claimed_by: str | None = None
    checked: CheckCounts | None = None
    symbols: tuple[str, ...] = ()
    symbolic: tuple[str, ...] = ()
    chosen: dict[str, str] = field(default_factory=dict)
    preprocessing: Preprocessing | None = None
    optima: Optima | None = None
    deadline: float | None = None
    improvements: tuple[Improvement, ...] = ()
    dropped_constraints: tuple[DroppedConstraint, ...] = ()

    def labelled(self, assignment: Mapping[str, int]) -> dict[str, int | str]:
        """Return `assignment`, of this outcome or of one of its epochs, with symbols by their names."""
        named = set(self.symbolic)
        return {
            name: self.symbols[value] if name in named and 0 <= value < len(self.symbols) else value
            for name, value in assignment.items()
        }

    @property
    def ruled_out(self) -> str | None:
        """Return a text on the robot that claims `no-solution`. Across machines the claim cannot be checked."""
        if self.witness is None or self.claimed_by is None:
            return self.witness and f"{self.witness} {RULED_OUT}"
        return f"{self.witness} claims it; nobody could check"

    @property
    def is_complete(self) -> bool:
        """Return whether all constraints of all robots are in force, as far as this is known."""
        return not self.dropped_constraints and not (self.checked is not None and self.withdrawn)

    @property
    def events(self) -> int:
        """Return how many events of the scenario have happened: they, and losses, open epochs."""
        return sum(not epoch.lost for epoch in self.epochs[:-1])

    @property
    def protocols(self) -> str:
        """The protocol that was asked for, and the one that said who withdraws, if that is another."""
        return f"{self.protocol}, then {self.placed_by}" if self.placed_by else self.protocol

    @property
    def withdrawn_alive(self) -> tuple[str, ...]:
        """The withdrawn robots that are not lost: there was no place for them."""
        return tuple(name for name in self.withdrawn if name not in self.lost)
