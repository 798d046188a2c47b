"""One run of a study, and its result row: plain data that is sent to workers and back as JSON."""

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
"""An alias for `bytes`, which is also the name of a count in a row."""
GIVEN = "given"
"""The priority order given by the files."""
_KEY_BYTES = 16
KEY = re.compile(f"[0-9a-f]{{{2 * _KEY_BYTES}}}")
"""The pattern of a run's key."""


class ProblemSpec(msgspec.Struct, forbid_unknown_fields=True, frozen=True, kw_only=True, omit_defaults=True):
    """A problem, generated from a family or read from files.

    Attributes:
        group: The study's name for the group of problems.
        family: The family of generated problems. Empty: the problem is read from files.
        parameters: The family's parameters, or options for reading the files.
        path: The team's folder or file, if the problem is read from files.
        digest: The digest of the files' content. Problems with the same content are the same problem.
        scenario: The parameters of a random scenario. Empty: there is no scenario.
    """

    group: str = ""
    family: str = ""
    parameters: dict[str, Parameter] = {}
    path: str = ""
    digest: str = ""
    scenario: dict[str, Any] = {}

    @property
    def identity(self) -> str:
        """The identity of the problem, which does not depend on its name or on the path of its files."""
        identity = msgspec.structs.replace(self, group="", path="" if self.digest else self.path)
        return msgspec.json.encode(identity, order="deterministic").decode()


class Setup(msgspec.Struct, forbid_unknown_fields=True, frozen=True, kw_only=True, omit_defaults=True):
    """A protocol with its options. The attributes have the meaning of those in `robochoc.run.options.Options`.

    By default there is no repair: a study compares the protocols themselves.

    `label` is the setup's name in tables and figures. `source` is the digest of the protocol's files, so that the runs
    of a changed protocol are repeated; it is empty for protocols of robochoc.
    """

    label: str = ""
    protocol: str
    source: str = ""
    settings: dict[str, str] = {}
    order: str | None = None
    runtime: str = "simulator"
    channel: ChannelModel | None = None
    schedule: str = "concurrent"
    delay: int = 0
    withdraw: str | None = None
    preprocess: str | None = None
    answer: str = "best"
    cold: bool = False
    repair: bool = False
    verify: bool = False
    objectives: str | None = None


class Limits(msgspec.Struct, forbid_unknown_fields=True, frozen=True, kw_only=True, omit_defaults=True):
    """The limits of one run.

    Attributes:
        timeout: The maximum number of seconds for the run, including its set-up. None: no limit.
        messages: The maximum number of messages. None: no limit.
        ncccs: The maximum number of non-concurrent constraint checks, in the simulator. None: no limit.
        cycles: The maximum number of cycles, with the schedule `cycles`. None: no limit.
        memory_mb: The maximum memory of the solving process, in megabytes. None: no limit.
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
        repetition: The number of this repetition, from 1.
        record: The data recorded in addition to counts; see `Recording`.
    """

    problem: ProblemSpec
    setup: Setup
    seed: int = 0
    limits: Limits = NO_LIMITS
    repetition: int = 1
    record: tuple[str, ...] = ()

    @property
    def key(self) -> str:
        """The digest of everything that determines the run. Labels and the paths of files are not included."""
        plain = msgspec.structs.replace(self, setup=msgspec.structs.replace(self.setup, label=""))
        content = msgspec.json.encode(
            [self.problem.identity, msgspec.structs.replace(plain, problem=_NOWHERE)], order="deterministic"
        )
        return hashlib.blake2b(content, digest_size=_KEY_BYTES).hexdigest()

    @property
    def is_timed(self) -> bool:
        """True if robots run as processes, so that nothing else should run on the machine."""
        return self.setup.runtime not in {Runtime.SIMULATOR, Runtime.ARRAYS}


_NOWHERE = ProblemSpec()


class Recording(StrEnum):
    """The data recorded in addition to the counts for the whole run."""

    COST_OVER_TIME = "cost-over-time"
    ROBOTS = "robots"
    JOURNAL = "journal"


class Status(StrEnum):
    """The status of a finished run.

    `DONE`: the run has a verdict. `LIMIT`: a limit was reached before a verdict. `ENDED`: an incomplete protocol ended
    without a valid answer. `REFUSED`: problem, protocol and options cannot be combined. `INVALID`: the problem is
    invalid. `LOST`: robots were lost. `REFUTED`: the checker found the answer wrong. `MEMORY`: there was not enough
    memory. `CRASHED`: the solving process ended unexpectedly. `ERROR`: any other error.
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


ASSIGNMENT = "assignment"
"""A word in `Task.record`: the row contains the assignment. The tables of studies have no column for it."""


class CostPoint(msgspec.Struct, frozen=True, array_like=True):
    """A point at which the team's assignment became cheaper than ever before.

    Attributes:
        messages: The number of messages sent until then.
        ncccs: The highest NCCC clock until then.
        time: The time since the start: seconds, or steps in the simulator, or simulated seconds with a channel model.
        cost: The cost as text, in the user's numbers.
    """

    messages: int
    ncccs: int
    time: float
    cost: str


class RobotLoad(msgspec.Struct, frozen=True, array_like=True):
    """The load of one robot: the messages and bytes that it sent."""

    robot: str
    messages: int
    bytes: int


class Row(msgspec.Struct, kw_only=True, omit_defaults=True):
    """The result of a run. Counts are as in `robochoc.model.outcome.Metrics`, and None if there is no answer.

    Attributes:
        status: The status of the finished run.
        reason: The reason for a missing verdict.
        team: The name of the team.
        digest: The digest of the problem as it was solved.
        robots: The number of robots.
        variables: The number of variables.
        constraints: The number of constraints.
        verdict: The verdict.
        cost: The exact cost as text, in the user's numbers.
        bound: A lower bound on the cost, if known.
        maximises: True if the cost is a utility.
        withdrawn: The number of withdrawn robots.
        verified: True if the checker has checked the answer.
        confirmed: True if a central solver has found the same answer.
        messages: The number of messages sent.
        messages_by_type: The number of messages of each type.
        total_s: The seconds for the whole run, including checks and set-up.
        cpu_s: The seconds of processor time, in the simulator.
        cost_over_time: The improvements of the cost, if `COST_OVER_TIME` is recorded.
        loads: The load of each robot, if `ROBOTS` is recorded.
        assignment: The values of all variables in the answer, if `ASSIGNMENT` is recorded.
        journal: The content of the run's journal, if `JOURNAL` is recorded.
        removed: With `preprocess`: the number of values removed before the protocol started.
        removing_messages: With `preprocess`: the messages for removing values, which `messages` does not include.
        removing_ncccs: With `preprocess`: the NCCCs for removing values.
        machine: The machine on which the run took place: its name, processors and Python version.
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
    assignment: dict[str, int] = {}
    journal: Content = b""
    machine: str = ""
    version: str = ""
    removed: int | None = None
    removing_messages: int | None = None
    removing_ncccs: int | None = None
