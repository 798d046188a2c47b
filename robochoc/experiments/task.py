"""One run of a study and its row: plain data, sent to workers and back as JSON."""

from __future__ import annotations

import hashlib
import re
from dataclasses import fields
from enum import StrEnum
from typing import Any

import msgspec

from robochoc.communication.simulator.channel import ChannelModel
from robochoc.run.defaults import CENTRAL
from robochoc.run.options import Options, Runtime, ScheduleName

Parameter = str | int | float | bool
Content = bytes
"""An alias, as `bytes` is a count in a row."""
GIVEN = "given"
"""The priority order of the files."""
_KEY_BYTES = 16
KEY = re.compile(f"[0-9a-f]{{{2 * _KEY_BYTES}}}")
"""The pattern of a run's key."""


class ProblemSpec(msgspec.Struct, forbid_unknown_fields=True, frozen=True, kw_only=True, omit_defaults=True):
    """A problem: of a family, or from files.

    Attributes:
        group: The study's name for the group of problems.
        family: The family of generated problems. Empty: the problem is in files.
        parameters: The family's parameters, or options of reading the files.
        path: The team's folder or file, if it is in files.
        digest: The digest of the files' content. Two problems with the same content are the same problem.
        scenario: The parameters of a random scenario. Empty: there is none.
    """

    group: str = ""
    family: str = ""
    parameters: dict[str, Parameter] = {}
    path: str = ""
    digest: str = ""
    scenario: dict[str, Any] = {}

    @property
    def identity(self) -> str:
        """The identity of the problem, independent of its name and the place of its files."""
        identity = msgspec.structs.replace(self, group="", path="" if self.digest else self.path)
        return msgspec.json.encode(identity, order="deterministic").decode()


class Setup(msgspec.Struct, forbid_unknown_fields=True, frozen=True, kw_only=True, omit_defaults=True):
    """A protocol with its options. Attributes are as in `robochoc.run.options.Options`.

    `label` is its name in tables and figures.
    """

    label: str = ""
    protocol: str
    settings: dict[str, str] = {}
    order: str | None = None
    runtime: str = "simulator"
    channel: ChannelModel | None = None
    schedule: str = "concurrent"
    delay: int = 0
    withdraw: str | None = None
    preprocess: str | None = None
    verify: bool = False


class Limits(msgspec.Struct, forbid_unknown_fields=True, frozen=True, kw_only=True, omit_defaults=True):
    """The limits of one run.

    Attributes:
        timeout: Seconds for the run, its set-up included. None: no limit.
        messages: The number of messages. None: no limit.
        ncccs: Non-concurrent constraint checks, in the simulator. None: no limit.
        cycles: Cycles, with the schedule `cycles`. None: no limit.
        memory_mb: Megabytes of the process that solves. None: no limit.
    """

    timeout: float | None = None
    messages: int | None = None
    ncccs: int | None = None
    cycles: int | None = None
    memory_mb: int | None = None

    def applicable_to(self, setup: Setup) -> Limits:
        """Return the limits that apply to `setup`."""
        by_robots = setup.protocol != CENTRAL
        return msgspec.structs.replace(
            self,
            messages=self.messages if by_robots else None,
            ncccs=self.ncccs if by_robots and setup.runtime == Runtime.SIMULATOR else None,
            cycles=self.cycles if by_robots and setup.schedule == ScheduleName.CYCLES else None,
        )


NO_LIMITS = Limits()


def options_of(setup: Setup, limits: Limits = NO_LIMITS, seed: int = 0) -> Options:
    """Return the options of a run."""
    given = msgspec.structs.asdict(setup) | msgspec.structs.asdict(limits)
    return Options(**{name: value for name, value in given.items() if name in _OPTIONS}, seed=seed)


_OPTIONS = frozenset(one.name for one in fields(Options))


class Task(msgspec.Struct, forbid_unknown_fields=True, frozen=True, kw_only=True, omit_defaults=True):
    """One run of a study.

    Attributes:
        problem: The problem.
        setup: The protocol with its options.
        seed: The run's seed.
        limits: The run's limits.
        repetition: The number of the repetition, from 1.
        record: The recordings besides counts; see `Recording`.
    """

    problem: ProblemSpec
    setup: Setup
    seed: int = 0
    limits: Limits = NO_LIMITS
    repetition: int = 1
    record: tuple[str, ...] = ()

    @property
    def key(self) -> str:
        """The digest of everything that determines the run; labels and places of files do not."""
        plain = msgspec.structs.replace(self, setup=msgspec.structs.replace(self.setup, label=""))
        content = msgspec.json.encode(
            [self.problem.identity, msgspec.structs.replace(plain, problem=_NOWHERE)], order="deterministic"
        )
        return hashlib.blake2b(content, digest_size=_KEY_BYTES).hexdigest()

    @property
    def is_timed(self) -> bool:
        """Whether robots have processes: then nothing else should run on the machine."""
        return self.setup.runtime not in {Runtime.SIMULATOR, Runtime.ARRAYS}


_NOWHERE = ProblemSpec()


class Recording(StrEnum):
    """The recordings besides the counts of the whole run."""

    COST_OVER_TIME = "cost-over-time"
    ROBOTS = "robots"
    JOURNAL = "journal"


class Status(StrEnum):
    """The status of a finished run.

    `DONE`: it has a verdict. `LIMIT`: a limit was reached before. `ENDED`: an incomplete protocol has ended without a
    valid answer. `REFUSED`: problem, protocol and options cannot be combined. `INVALID`: the problem is invalid.
    `LOST`: robots were lost. `REFUTED`: the checker refutes the answer. `MEMORY`: there was not enough memory.
    `CRASHED`: the solving process has ended. `ERROR`: any other error.
    """

    DONE = "done"
    LIMIT = "limit"
    ENDED = "ended"
    REFUSED = "refused"
    INVALID = "invalid"
    LOST = "lost"
    REFUTED = "refuted"
    MEMORY = "memory"
    CRASHED = "crashed"
    ERROR = "error"


class CostPoint(msgspec.Struct, frozen=True, array_like=True):
    """A moment at which the team's assignment became cheaper than ever before.

    Attributes:
        messages: Messages sent until then.
        ncccs: The highest NCCC clock until then.
        time: Seconds since the start; in the simulator steps, with a channel model simulated seconds.
        cost: The cost, as text, in the user's numbers.
    """

    messages: int
    ncccs: int
    time: float
    cost: str


class RobotLoad(msgspec.Struct, frozen=True, array_like=True):
    """The load of one robot: messages and bytes sent."""

    robot: str
    messages: int
    bytes: int


class Row(msgspec.Struct, kw_only=True, omit_defaults=True):
    """What came of a run. Counts are as in `robochoc.model.outcome.Metrics`; None where there is no answer.

    Attributes:
        status: How the run has ended.
        reason: Why, where it has no verdict.
        team: The name of the team.
        digest: Of the problem as it was solved.
        robots: The number of robots.
        variables: The number of variables.
        constraints: The number of constraints.
        verdict: The verdict.
        cost: The cost in the user's numbers, exactly, as text.
        bound: A lower bound of it, where one is known.
        maximises: Whether the cost is a utility.
        withdrawn: The number of withdrawn robots.
        verified: Whether the checker has checked the answer.
        confirmed: Whether a central solver has found the same.
        messages: Messages sent.
        messages_by_type: The same, by type.
        total_s: Seconds of the whole run, checks and set-up included.
        cpu_s: Seconds of the processor, in the simulator.
        cost_over_time: With `COST_OVER_TIME`.
        loads: With `ROBOTS`.
        journal: With `JOURNAL`: the content of the run's journal.
        removed: With `preprocess`: how many values were removed before the protocol.
        removing_messages: The messages that it took, which `messages` does not count.
        removing_ncccs: The same for NCCCs.
        machine: Where it ran: host, processor, Python.
        version: The version of robochoc.
    """

    status: Status
    reason: str | None = None
    team: str = ""
    digest: str = ""
    robots: int = 0
    variables: int = 0
    constraints: int = 0
    verdict: str | None = None
    cost: str | None = None
    bound: str | None = None
    maximises: bool = False
    withdrawn: int = 0
    verified: bool = False
    confirmed: bool = False
    messages: int | None = None
    messages_by_type: dict[str, int] = {}
    bytes: int | None = None
    largest: int | None = None
    ncccs: int | None = None
    checks: int | None = None
    simulated_s: float | None = None
    cycles: int | None = None
    wall_s: float | None = None
    compile_s: float | None = None
    total_s: float = 0.0
    cpu_s: float | None = None
    memory: int | None = None
    cost_over_time: list[CostPoint] = []
    loads: list[RobotLoad] = []
    journal: Content = b""
    machine: str = ""
    version: str = ""
    removed: int | None = None
    removing_messages: int | None = None
    removing_ncccs: int | None = None
