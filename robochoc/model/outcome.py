"""The outcome of a run: the typed form of the JSON result (docs/reference/result.md)."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import KW_ONLY, dataclass, field, fields, replace
from enum import StrEnum
from typing import Any, NamedTuple

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
        number: The number of optima that robots can distinguish.
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
class Answer:
    """The answer to a problem, of a search, an epoch or a whole run. Costs are in the user's numbers.

    Attributes:
        verdict: The verdict.
        assignment: The values of all variables of the robots that are not withdrawn, as the integers that robots
            compute with: those of `symbolic` variables are places in `symbols`. `Solution.values` has the values of
            the user.
        cost: The cost of the assignment, exactly; the utility if that is maximised. None: there is no assignment.
        withdrawn: The names of the withdrawn robots; in an `Outcome` including the lost ones.
        metrics: The messages, checks and time spent.
        verified: Whether the checker has compared the assignment with every constraint of a team that was validated
            before; for `no-solution`, whether the central solver has found the same.
        witness: The robot that ended the search: for `no-solution`, the one that has `RULED_OUT`.
        reason: The reason for the verdict, if it is not obvious: a robot without a local solution, or a limit.
        count: The number of solutions, if it was requested.
        bound: A lower bound on the cost of any assignment (an upper one on the utility, if that is maximised); with
            withdrawal, on the weight of the withdrawn robots. None: not known.
        tree: The pseudo-tree that the robots have built, if their protocol builds one.
        confirmed: Whether the central solver was asked, and has found the same `no-solution` or the same minimum cost.
        confirmed_by: The names of the solvers that have found the same, on the machine of the run.
        checked: Across machines: the numbers of checked constraints, by the robots that checked them.
        preprocessing: The result of preprocessing, if that was requested.
        optima: The optima, or solutions, if the protocol lists them.
        deadline: The seconds after which an answer was due, if the search was ended by the time and the answer is the
            best one known at that moment.
        improvements: The answers that were published during the search, the first of them at the deadline.
        dropped_constraints: The constraints between robots that were dropped because robots are absent, if there is an
            assignment (`model/absence.py`). Across machines no robot knows all of them, and none is listed.
    """

    verdict: Verdict
    _: KW_ONLY
    assignment: dict[str, int] = field(default_factory=dict)
    cost: Cost | None = None
    withdrawn: tuple[str, ...] = ()
    metrics: Metrics = field(default_factory=Metrics)
    verified: bool = False
    witness: str | None = None
    reason: str | None = None
    count: int | None = None
    bound: Cost | None = None
    tree: dict[str, PseudoTreeNode] = field(default_factory=dict)
    confirmed: bool = False
    confirmed_by: tuple[str, ...] = ()
    checked: CheckCounts | None = None
    preprocessing: Preprocessing | None = None
    optima: Optima | None = None
    deadline: float | None = None
    improvements: tuple[Improvement, ...] = ()
    dropped_constraints: tuple[DroppedConstraint, ...] = ()

    def assignment_parts(self) -> dict[str, Any]:
        """Return the fields that describe the assignment by name; they belong together."""
        names = ("assignment", "cost", "withdrawn", "verified", "checked", "dropped_constraints")
        return {name: getattr(self, name) for name in names}

    def parts(self, kind: type[Answer] | None = None) -> dict[str, Any]:
        """Return the fields of `kind`, a base class, by name; by default those of `Answer`."""
        return {one.name: getattr(self, one.name) for one in fields(kind or Answer)}


@dataclass(frozen=True, kw_only=True)
class EpochOutcome(Answer):
    """The outcome of one epoch of a problem that changes over time, or whose robots were lost.

    Attributes:
        robots: The robots of the team in this epoch, in the files' order.
        opened_by: The event that opened the epoch, in a few words.
        lost: The robots whose loss ended the epoch.
    """

    robots: tuple[str, ...]
    opened_by: str = "the start"
    lost: tuple[str, ...] = ()


@dataclass(frozen=True, kw_only=True)
class Outcome(Answer):
    """The result of a run: how it was run, and its answer. With several epochs the answer is that of the last one.

    Metrics are summed up over the epochs.

    Attributes:
        team: The name of the team.
        protocol: The protocol that was given or chosen.
        runtime: The runtime.
        seed: The seed of the run.
        lost: The names of the withdrawn robots whose processes died, and that did not come back.
        order: The name of the priority order that was given or chosen; `listed` for a list of names.
        epochs: The epochs, if there were several.
        channel: The name of the channel model, if time was simulated by one.
        placed_by: The protocol of the withdrawal, if it differs from `protocol`.
        claimed_by: Across machines: the robot on whose claim the verdict rests, as it cannot be checked; or
            `ALL_ROBOTS`.
        symbols: The names of the team's symbols, if it has any: the value 2 means the symbol at place 2.
        symbolic: The variables whose values are symbols.
        chosen: The reasons for the choice of `protocol` and `order`, where they were not given.
    """

    team: str
    protocol: str
    runtime: str
    seed: int
    lost: tuple[str, ...] = ()
    order: str | None = None
    epochs: tuple[EpochOutcome, ...] = ()
    channel: str | None = None
    placed_by: str | None = None
    claimed_by: str | None = None
    symbols: tuple[str, ...] = ()
    symbolic: tuple[str, ...] = ()
    chosen: dict[str, str] = field(default_factory=dict)

    def __hash__(self) -> int:
        return hash((self.team, self.protocol, self.seed, self.verdict, frozenset(self.assignment.items())))

    def same_answer(self, other: Outcome) -> bool:
        """Return whether `other` is equal except for measurements: times, and memory of processes.

        Runs of the same problem with the same options and seed have the same answer in the simulator.
        """
        return _without_measurements(self, Outcome) == _without_measurements(other, Outcome)

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
        return f"{self.witness} claims it; this could not be checked"

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


def _without_measurements(answer: Answer, kind: type[Answer]) -> dict[str, object]:
    """Return the fields of `kind` by name, with 0 for measured times and memory."""
    parts = answer.parts(kind)
    parts["metrics"] = _counts(answer.metrics)
    parts["improvements"] = [one._replace(at_s=0.0) for one in answer.improvements]
    if answer.preprocessing is not None:
        parts["preprocessing"] = replace(answer.preprocessing, metrics=_counts(answer.preprocessing.metrics))
    if isinstance(answer, Outcome):
        parts["epochs"] = [_without_measurements(epoch, EpochOutcome) for epoch in answer.epochs]
    return parts


def _counts(metrics: Metrics) -> Metrics:
    return replace(metrics, wall_s=0.0, compile_s=0.0, memory=0)
