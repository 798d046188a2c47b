"""What a run comes to: the typed form of the JSON result (docs/reference/result.md)."""

from __future__ import annotations

from dataclasses import dataclass, field
from enum import StrEnum
from typing import NamedTuple

RULED_OUT = "has ruled everything out"
"""What a robot has done that alone can tell that there is no solution, in words that are true in every protocol: by
deriving the empty nogood, by trying all there is, or by bounds."""


class Verdict(StrEnum):
    """The answer to a problem; `UNKNOWN` when a limit was reached first."""

    SOLUTION = "solution"
    OPTIMAL = "optimal"
    NO_SOLUTION = "no-solution"
    UNKNOWN = "unknown"


@dataclass(frozen=True)
class Metrics:
    """What a run cost. Definitions: `docs/reference/metrics.md`.

    `messages`: protocol messages sent, by type; `bytes`: of their encoded contents; `ncccs`: non-concurrent
    constraint checks; `checks`: constraint checks of all robots; `wall_s`: seconds of wall-clock time;
    `compile_s`: seconds before that, in which local domains were compiled; `memory`: bytes that the largest robot's
    process had to itself at the end (0 where robots have no processes); `simulated_s`: seconds of simulated time, by a
    channel model (0 where there was none); `largest`: bytes of the largest message's content.
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
        )


@dataclass(frozen=True)
class PseudoTreeNode:
    """A robot's place in a pseudo-tree: who stands right above it (None: a root), and who else of its neighbours does.

    `pseudo_parents` are neighbours further up, on the way to the root.
    """

    parent: str | None
    pseudo_parents: tuple[str, ...] = ()


@dataclass(frozen=True)
class EpochOutcome:
    """One epoch of a problem that changes over time, or whose robots were lost.

    `robots` are those of the team then, in the files' order; `opened_by` says in a few words what opened the epoch;
    `lost` names those whose loss ended it.
    """

    verdict: Verdict
    robots: tuple[str, ...]
    opened_by: str = "the start"
    assignment: dict[str, int] = field(default_factory=dict)
    cost: float | None = None
    metrics: Metrics = field(default_factory=Metrics)
    verified: bool = False
    witness: str | None = None
    lost: tuple[str, ...] = ()
    bound: float | None = None
    tree: dict[str, PseudoTreeNode] = field(default_factory=dict)
    confirmed: bool = False


ALL_ROBOTS = "all robots"
"""Who claims what any one of them could have made untrue. No robot has such a name."""


class CheckCounts(NamedTuple):
    """How many constraints were checked by who holds them and by another robot too, and how many by their owner alone.

    Of robots that no one else sees into: across machines.
    """

    by_both: int
    by_owner: int


@dataclass(frozen=True)
class Outcome:
    """One team, one run. `assignment` maps every variable of the robots that fly to its value.

    Where there were several epochs, the verdict is the last one's, and the metrics are their sums.
    """

    team: str
    protocol: str
    runtime: str
    seed: int
    verdict: Verdict
    assignment: dict[str, int] = field(default_factory=dict)
    cost: float | None = None
    withdrawn: tuple[str, ...] = ()
    metrics: Metrics = field(default_factory=Metrics)
    verified: bool = False
    """Whether the checker has held the assignment against every constraint of a team that was found valid before; for
    `no-solution`, whether the central judge has come to the same."""
    witness: str | None = None
    """Who ended the search: for `no-solution`, the robot that has `RULED_OUT`."""
    reason: str | None = None
    """Why, where that is not plain: a robot whose local problem has no solution, or the limit that was reached."""
    count: int | None = None
    """The number of solutions, where it was asked for."""
    lost: tuple[str, ...] = ()
    """Those of the withdrawn whose processes died, and that did not come back; the others stepped aside."""
    order: str | None = None
    """The priority order that was asked for, by name; `listed` for one of the user's own."""
    bound: float | None = None
    """No assignment costs less (with withdrawal: no fewer robots, by weight, step aside); None: nobody can tell."""
    tree: dict[str, PseudoTreeNode] = field(default_factory=dict)
    """The pseudo-tree that the robots have built, if their protocol builds one."""
    confirmed: bool = False
    """Whether the central judge, who was asked, comes to the same `no-solution` or the same least cost."""
    epochs: tuple[EpochOutcome, ...] = ()
    """What happened in each epoch; empty where there was but one, as nothing changed."""
    channel: str | None = None
    """The name of the channel model by which time was simulated, if it was."""

    placed_by: str | None = None
    """The protocol that said who steps aside, where that is another than the one that was asked for."""

    claimed_by: str | None = None
    """Across machines: whose word the verdict rests on, as nobody could check it; a robot, or `ALL_ROBOTS`."""
    checked: CheckCounts | None = None
    """Across machines: who has checked the constraints of an answer."""

    @property
    def ruled_out(self) -> str | None:
        """Return who claims that there is no solution, in words. Across machines nobody can check the claim."""
        if self.witness is None or self.claimed_by is None:
            return self.witness and f"{self.witness} {RULED_OUT}"
        return f"{self.witness} claims it; nobody could check"

    @property
    def events(self) -> int:
        """Return how many events of the scenario have happened: they, and losses, open epochs."""
        return sum(not epoch.lost for epoch in self.epochs[:-1])

    @property
    def protocols(self) -> str:
        """The protocol that was asked for, and the one that said who steps aside, if that is another."""
        return f"{self.protocol}, then {self.placed_by}" if self.placed_by else self.protocol

    @property
    def aside(self) -> tuple[str, ...]:
        """Those of the withdrawn that stepped aside, as they found no place."""
        return tuple(name for name in self.withdrawn if name not in self.lost)
