"""The dispatcher's records: its settings, tasks, commands, and the present round."""

from __future__ import annotations

from dataclasses import dataclass, field

import msgspec

from robochoc.ros.rmf.messages import (
    Assignment,
    BidProposal,
    CommandType,
    DispatchCommand,
    DispatchState,
    TaskStatus,
)
from robochoc.ros.rmf.task_request import TaskRequest

ERRORS_MAX = 20
ERROR_CHARACTERS_MAX = 2000
"""The maximum length of a stored error; the rest is cut off. States of all tasks must fit into a message."""


class Settings(msgspec.Struct, frozen=True):
    """The settings of a dispatcher. Times are in seconds.

    Attributes:
        gather_s: The wait for further requests before a new task is asked for.
        time_window_s: The longest wait for bids for a task. After each failure it is twice as long, up to eight times.
        repeat_s: The time after which a command is repeated.
        expire_s: The time after which an award that is not acknowledged is withdrawn.
        retry_s: The time after which a task without bids is asked for again.
        tries: The number of times for which a task may have no bid, or an award that failed. If fleets have answered,
            but without a bid, it counts as four times.
        batch: The maximum number of tasks in a round.
        states_s: The time between two messages with the states of tasks.
        by_finish: True to compare bids by finish times, as RMF does by default; False: by added costs.
    """

    gather_s: float = 0.3
    time_window_s: float = 2.0
    repeat_s: float = 1.0
    expire_s: float = 10.0
    retry_s: float = 2.0
    tries: int = 20
    batch: int = 10
    states_s: float = 2.0
    by_finish: bool = False


DEFAULTS = Settings()


@dataclass
class Task:
    """A task and its state.

    Attributes:
        task_id: Its id.
        text: Its description, as received.
        request: Its description.
        status: Its status.
        ask_s: The time from which fleets may be asked for bids.
        version: The number of ids under which fleets know it.
        failures: The number of tries without success.
        passed_over: The number of consecutive rounds in which it had bids, but was not allocated.
        errors: The last errors.
        proposal: The bid that was chosen.
    """

    task_id: str
    text: str
    request: TaskRequest
    status: TaskStatus = TaskStatus.QUEUED
    ask_s: float = 0.0
    version: int = 1
    failures: int = 0
    passed_over: int = 0
    errors: list[str] = field(default_factory=list)
    proposal: BidProposal | None = None

    @property
    def bid_id(self) -> str:
        """The id under which fleets may get it."""
        return self.task_id if self.version == 1 else f"{self.task_id}.{self.version}"

    def add_errors(self, *errors: str) -> None:
        """Store errors."""
        self.errors = [*self.errors, *(one[:ERROR_CHARACTERS_MAX] for one in errors)][-ERRORS_MAX:]

    @property
    def state(self) -> DispatchState:
        """Its state for others. The id is the one under which the fleet knows the task."""
        one = self.proposal
        assigned = Assignment(True, one.fleet_name, one.expected_robot_name) if one else Assignment()
        return DispatchState(self.bid_id if one else self.task_id, int(self.status), assigned, tuple(self.errors))


@dataclass
class PendingCommand:
    """A command that is not acknowledged yet, and when it was sent first, and is repeated."""

    command: DispatchCommand
    task: Task
    began_s: float
    next_s: float
    pause_s: float

    @property
    def is_award(self) -> bool:
        """True if it awards a task."""
        return self.command.type == CommandType.AWARD


@dataclass
class Notice:
    """A request for bids, and the answers.

    Attributes:
        notice_id: The id in the message.
        task: The task.
        fleet: The only fleet whose bid is awaited; None: those of all fleets.
        asked_s: The time of the request.
        window_s: The longest wait for bids, in seconds.
        attempt: The number of this request for the task in its round.
        proposals: The bids by fleet.
        refusals: The number of answers without a bid, which do not name their fleets.
    """

    notice_id: str
    task: Task
    fleet: str | None
    asked_s: float
    window_s: float
    attempt: int = 1
    proposals: dict[str, BidProposal] = field(default_factory=dict)
    refusals: int = 0

    def is_answered(self, fleets: int) -> bool:
        """Return whether all awaited bids have arrived, if so many fleets are known."""
        wanted = self.fleet or self.task.request.fleet_name
        if wanted is not None:
            return wanted in self.proposals
        return 0 < fleets <= len(self.proposals) + self.refusals


@dataclass
class Round:
    """A round of bids.

    Attributes:
        number: Its number.
        waiting: The tasks to be priced, in order. Empty once prices are known.
        notices: The notices for prices, by their ids.
        selected: The tasks to be awarded, each with its fleet (None: the best one), and the number of the attempt.
        present: The notice that is being answered.
        is_priced: True if the tasks have been allocated.
    """

    number: int
    waiting: list[Task]
    notices: dict[str, Notice] = field(default_factory=dict)
    selected: list[tuple[Task, str | None, int]] = field(default_factory=list)
    present: Notice | None = None
    is_priced: bool = False
