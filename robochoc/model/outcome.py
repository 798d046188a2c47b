"""The outcome of a run: the typed form of the JSON result (docs/reference/result.md)."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import KW_ONLY, field, fields, replace
from enum import StrEnum
from typing import Any, NamedTuple

from robochoc.model.absence import DroppedConstraint
from robochoc.model.cost_units import Cost
from robochoc.model.policies import PolicyReport
from robochoc.system.lazy_dataclass import dataclass
from robochoc.system.plain_text import counted

RULED_OUT = "has ruled everything out"
"""The reason why a single robot can conclude `no-solution`. It covers every protocol: the robot has derived the empty
nogood, tried all values, or used bounds.
"""
BEST_FOR_SAMPLES = "it is the best for the samples, and not proven to be the best in expectation"
"""The reason why the verdict is `SOLUTION` although the search has found an optimum of a problem with samples."""


class Approximation(StrEnum):
    """The part of a problem that was searched: grids of its real variables, or samples of its random variables."""

    GRIDS = "grids"
    SAMPLES = "samples"


class Verdict(StrEnum):
    """The answer to a problem. `UNKNOWN` means that a limit was reached first."""

    SOLUTION = "solution"
    OPTIMAL = "optimal"
    NO_SOLUTION = "no-solution"
    UNKNOWN = "unknown"


@dataclass(frozen=True)
class Metrics:
    """The metrics of a run. Their definitions: documentation, page Metrics.

    Attributes:
        messages: The number of protocol messages sent, by type.
        bytes: The total size of their encoded contents, in bytes.
        ncccs: Non-concurrent constraint checks.
        checks: The constraint checks of all robots together.
        wall_s: The wall-clock time, in seconds.
        compile_s: The time spent on compiling local domains before the search, in seconds. `wall_s` does not include
            it.
        memory: The private memory of the largest robot process at its end, in bytes. 0: robots did not run as
            processes.
        simulated_s: The time simulated with a channel model, in seconds. 0: time was not simulated.
        largest: The size of the largest message's content, in bytes.
        cycles: The number of cycles in the simulator's schedule `cycles`. 0: cycles were not counted.
        lost_messages: The number of messages that were permanently lost.
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
        """Return the sum of the costs of two consecutive runs."""
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
    """A robot's position in a pseudo-tree.

    Attributes:
        parent: The robot directly above this robot. None: the robot is a root.
        pseudo_parents: The robot's other neighbours on the path to the root.
    """

    parent: str | None
    pseudo_parents: tuple[str, ...] = ()


class Improvement(NamedTuple):
    """An answer published during the search, better than all earlier answers.

    Attributes:
        at_s: The seconds since the start of the run or the epoch.
        verdict: The verdict at that time: `SOLUTION` or `OPTIMAL`.
        cost: The cost in the user's units.
        withdrawn: The robots that do not fly.
    """

    at_s: float
    verdict: Verdict
    cost: Cost | None
    withdrawn: tuple[str, ...] = ()


class SearchStage(NamedTuple):
    """A stage of a run in which several protocols search in turn.

    Attributes:
        protocol: The name of the protocol.
        seconds: The duration of the stage.
        searches: The number of searches: 1, and one for each restart.
        cost: The cost of the best assignment known at the end of the stage (None: none is known).
    """

    protocol: str
    seconds: float
    searches: int
    cost: Cost | None


class GridSearch(NamedTuple):
    """A search on grids of real variables (`run/refinement.py`).

    Attributes:
        step: The largest distance between neighbouring points of a grid.
        verdict: The verdict on these grids.
        cost: The cost of the best assignment on these grids (None: none is known).
    """

    step: float
    verdict: Verdict
    cost: Cost | None


CENTRAL_SOLVER = "the central solver"
"""The name in `confirmed_by` for ACE, including the checks made before ACE is called."""
ALL_ROBOTS = "all robots"
"""The value of `claimed_by` for a verdict that any single robot could have falsified. No robot has this name."""


class CheckCounts(NamedTuple):
    """The number of checked constraints in a run across machines, by the robots that checked them.

    Attributes:
        by_both: The constraints checked by the robot that holds the constraint and by another robot.
        by_owner: The constraints checked only by the robot that holds the constraint.
    """

    by_both: int
    by_owner: int


class Optima(NamedTuple):
    """The optima, or the solutions, listed by a protocol.

    Attributes:
        number: The number of optima that robots can distinguish.
        assignments: The first optima, each checked: the values of all variables of the robots that are not withdrawn.
    """

    number: int
    assignments: tuple[dict[str, int], ...]


class FrontPoint(NamedTuple):
    """A point of the Pareto front of several objectives.

    Attributes:
        objectives: The cost in each objective, in the user's units.
        assignment: The values of all variables, as in `Answer`.
    """

    objectives: dict[str, Cost]
    assignment: dict[str, int]


@dataclass(frozen=True)
class Preprocessing:
    """The result of preprocessing by the robots, before the protocol started, summed over all epochs.

    Attributes:
        name: The name of the preprocessing: `ac`.
        metrics: The metrics of the preprocessing. They are not included in the other metrics of the run.
        removed: The number of values that were removed from the robots' domains.
        values: The number of values before the preprocessing.
    """

    name: str
    metrics: Metrics
    removed: int
    values: int


@dataclass(frozen=True)
class ViolatedConstraint:
    """A hard constraint that an assignment violates.

    Attributes:
        name: The name of the constraint; empty in runs across machines, where robots report scopes only.
        robot: The robot that holds the constraint.
        variables: The variables in its scope; empty if no other robot may know them.
    """

    name: str
    robot: str
    variables: tuple[str, ...]

    def __str__(self) -> str:
        if self.name:
            return f"{self.name} of {self.robot}"
        return f"one of {self.robot}" + (f" over {' '.join(self.variables)}" if self.variables else "")


@dataclass(frozen=True)
class Violations:
    """The hard constraints that an assignment violates.

    Attributes:
        number: The number of violated hard constraints.
        hard: The number of all hard constraints in force.
        first: The first violated constraints, at most `MOST_VIOLATIONS`.
    """

    number: int
    hard: int
    first: tuple[ViolatedConstraint, ...]

    def __str__(self) -> str:
        """Return the numbers and the first constraints in words."""
        named = ", ".join(map(str, self.first))
        more = self.number - len(self.first)
        rest = f" and {more:,} more" if more > 0 else ""
        total = counted(self.hard, "hard constraint")
        return f"{self.number:,} of {total}{': ' * bool(named)}{named}{rest * bool(named)}"


MOST_VIOLATIONS = 5
"""The maximum number of violated constraints that are named."""


@dataclass(frozen=True)
class Answer:
    """The answer to a problem, given by a search, an epoch or a whole run. Costs are in the user's units.

    Attributes:
        verdict: The verdict.
        assignment: The values of all variables of the robots that are not withdrawn, as the integers used by the
            robots. The values of `symbolic` variables are indices in `symbols`. `Solution.values` has the user's
            values.
        cost: The exact cost of the assignment, or the utility if it is maximised. None: there is no assignment.
        withdrawn: The names of the withdrawn robots; in an `Outcome` including lost robots.
        metrics: The messages, checks and time spent.
        verified: True if the checker has compared the assignment with every constraint of a team that was validated
            before. For `no-solution`: true if the central solver has also found `no-solution`.
        witness: The robot that ended the search. For `no-solution`: the robot that has `RULED_OUT`.
        reason: The reason for the verdict, if it is not obvious: a robot without a local solution, or a limit.
        count: The number of solutions, if it was requested.
        bound: A lower bound on the cost of any assignment (an upper bound on the utility if it is maximised); with
            withdrawal, a bound on the weight of the withdrawn robots. None: unknown.
        tree: The pseudo-tree that the robots have built, if their protocol builds one.
        confirmed: True if the central solver was called, and has found the same `no-solution` or the same minimum cost.
        confirmed_by: The names of the solvers that have found the same result, on the machine of the run.
        solved_by: The names of the solvers that found the answer, with the protocol `central`; several, if independent
            parts of the problem had different solvers.
        checked: The number of checked constraints in a run across machines, by the robots that checked them.
        preprocessing: The result of preprocessing, if it was requested.
        optima: The optima, or the solutions, if the protocol lists them.
        objectives: The cost of the assignment in each objective, if there are several.
        front: The points of the Pareto front, if it was requested; the first one is the assignment.
        deadline: The deadline in seconds, if it ended the search. The answer is then the best assignment known at that
            time.
        improvements: The answers published during the search; the first was published at the deadline.
        dropped_constraints: The constraints between robots that were dropped because robots are absent, if there is an
            assignment (`model/absence.py`). In runs across machines the list is empty, since no robot knows all these
            constraints.
        violations: The hard constraints that the best complete assignment violates, if the verdict is `UNKNOWN` because
            no known assignment satisfies all of them.
        repair: The protocol that continued after the chosen protocol had ended, because all its assignments violated
            hard constraints. None: there was no repair.
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
    solved_by: tuple[str, ...] = ()
    checked: CheckCounts | None = None
    preprocessing: Preprocessing | None = None
    optima: Optima | None = None
    objectives: dict[str, Cost] = field(default_factory=dict)
    front: tuple[FrontPoint, ...] = ()
    deadline: float | None = None
    improvements: tuple[Improvement, ...] = ()
    dropped_constraints: tuple[DroppedConstraint, ...] = ()
    violations: Violations | None = None
    repair: str | None = None

    def assignment_parts(self) -> dict[str, Any]:
        """Return the fields that describe the assignment, by name. These fields belong together."""
        names = ("assignment", "cost", "withdrawn", "verified", "checked", "dropped_constraints")
        return {name: getattr(self, name) for name in names}

    def parts(self, kind: type[Answer] | None = None) -> dict[str, Any]:
        """Return the fields of the base class `kind`, by name. The default is `Answer`."""
        return {one.name: getattr(self, one.name) for one in fields(kind or Answer)}


@dataclass(frozen=True, kw_only=True)
class EpochOutcome(Answer):
    """The outcome of one epoch, for a problem that changes over time or whose robots were lost.

    Attributes:
        robots: The robots in the team during this epoch, in the order of the files.
        opened_by: The event that opened the epoch, in a few words.
        lost: The robots whose loss ended the epoch.
    """

    robots: tuple[str, ...]
    opened_by: str = "the start"
    lost: tuple[str, ...] = ()


@dataclass(frozen=True, kw_only=True)
class Outcome(Answer):
    """The result of a run: its settings and its answer. With several epochs, the answer is that of the last epoch.

    Metrics are summed up over the epochs.

    Attributes:
        team: The name of the team.
        protocol: The protocol that was specified or chosen.
        runtime: The runtime.
        seed: The seed of the run.
        lost: The names of the withdrawn robots whose processes died and did not return.
        order: The name of the priority order that was specified or chosen; `listed` for a list of names.
        epochs: The epochs, if there were several.
        channel: The name of the channel model, if time was simulated by a channel model.
        placed_by: The protocol that decided the withdrawal, if it differs from `protocol`.
        claimed_by: In runs across machines: the robot on whose claim the verdict relies, or `ALL_ROBOTS`. Such claims
            cannot be checked.
        led_by: The name of the master that led the run, if the robots know several masters.
        term: The term in which it led. A takeover by another master begins a later term.
        symbols: The names of the team's symbols, if any: the value 2 means the symbol at index 2.
        symbolic: The variables whose values are symbols.
        real_places: The decimal places of variables whose values are real numbers: an integer 1500 with 3 is 1.5.
        chosen: The reasons for the choice of `protocol` and `order`, if they were not specified.
        stages: The stages of the run, if several protocols have searched in turn.
        grids: The searches on finer and finer grids, if the team has real variables.
        uncertainty: The policy and its costs, if the problem has random variables.
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
    led_by: str | None = None
    term: int | None = None
    symbols: tuple[str, ...] = ()
    symbolic: tuple[str, ...] = ()
    real_places: dict[str, int] = field(default_factory=dict)
    chosen: dict[str, str] = field(default_factory=dict)
    stages: tuple[SearchStage, ...] = ()
    grids: tuple[GridSearch, ...] = ()
    uncertainty: PolicyReport | None = None

    def __hash__(self) -> int:
        return hash((self.team, self.protocol, self.seed, self.verdict, frozenset(self.assignment.items())))

    def same_answer(self, other: Outcome) -> bool:
        """Return whether `other` is equal except for measurements (times, memory) and `solved_by`, which may vary.

        Runs of the same problem with the same options and seed have the same answer in the simulator.
        """
        return _without_measurements(self, Outcome) == _without_measurements(other, Outcome)

    def labelled(self, assignment: Mapping[str, int]) -> dict[str, float | str]:
        """Return `assignment`, from this outcome or one of its epochs, with real numbers, and names of symbols."""
        named = set(self.symbolic)
        return {
            name: self.symbols[value]
            if name in named and 0 <= value < len(self.symbols)
            else value / 10 ** self.real_places[name]
            if name in self.real_places
            else value
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
        """Return the number of events in the scenario that have happened. Epochs are opened by events and losses."""
        return sum(not epoch.lost for epoch in self.epochs[:-1])

    @property
    def protocols(self) -> str:
        """The protocol of the run, and the protocol that decided the withdrawal if it is another one."""
        return ", then ".join(filter(None, [self.protocol, self.repair, self.placed_by]))

    @property
    def withdrawn_alive(self) -> tuple[str, ...]:
        """The withdrawn robots that were not lost."""
        return tuple(name for name in self.withdrawn if name not in self.lost)


def _without_measurements(answer: Answer, kind: type[Answer]) -> dict[str, object]:
    """Return the fields of `kind` by name, with 0 for measured times and memory."""
    parts = answer.parts(kind)
    parts["metrics"] = _counts(answer.metrics)
    parts["solved_by"] = ()  # solvers that run in parallel
    parts["improvements"] = [one._replace(at_s=0.0) for one in answer.improvements]
    if answer.preprocessing is not None:
        parts["preprocessing"] = replace(answer.preprocessing, metrics=_counts(answer.preprocessing.metrics))
    if isinstance(answer, Outcome):
        parts["stages"] = [(one.protocol, one.cost) for one in answer.stages]
        parts["epochs"] = [_without_measurements(epoch, EpochOutcome) for epoch in answer.epochs]
    return parts


def _counts(metrics: Metrics) -> Metrics:
    return replace(metrics, wall_s=0.0, compile_s=0.0, memory=0)
