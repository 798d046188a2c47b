"""A dispatcher for RMF's fleets: it collects bids for several tasks, and allocates them together. No input or output.

RMF's own dispatcher asks for bids for one task, waits for a fixed time, and gives the task up if no fleet has answered.
This dispatcher works in rounds:

1. Prices: it asks for bids for the oldest tasks by dry runs, one after the other, since a fleet adapter computes one
   bid at a time. It goes on as soon as all known fleets have answered, or after the time window.
2. Allocation (`allocation.py`): as many tasks as possible, each fleet at most one, at the lowest cost.
3. Awards: it asks for the bid for each allocated task, and awards the task to the fleet when the bid is there. It
   repeats each award until the fleet has acknowledged it. Then the next round begins.

A bid of an RMF fleet contains a plan for all its tasks, which the award makes the fleet's plan: an award on an old bid
would remove tasks that the fleet got since. So bids of dry runs have ids of their own, a fleet gets one award at a
time, on a bid that is newer than its last award, and a task has a new id after a bid that came too late.

A task without a bid is asked for again, several times, each time with a longer time window: fleets may be slow. A task
whose award is not acknowledged is withdrawn from that
fleet, and asked for again. So every task ends: a fleet has acknowledged it, it was
cancelled, or it is reported as failed, with the reasons.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Mapping

from robochoc.ros.rmf.fleets import Fleets
from robochoc.ros.rmf.messages import (
    ApiRequest,
    ApiResponse,
    BidNotice,
    BidProposal,
    BidResponse,
    CommandType,
    DispatchAck,
    DispatchCommand,
    DispatchState,
    DispatchStates,
    Message,
    ResponseType,
    TaskStatus,
)
from robochoc.ros.rmf.records import DEFAULTS, Notice, PendingCommand, Round, Settings, Task
from robochoc.ros.rmf.task_request import (
    INVALID_REQUEST,
    NO_BIDS,
    NOT_FEASIBLE,
    CancelTask,
    NewTask,
    RequestError,
    error_json,
    failure_json,
    read_request,
    state_json,
    success_json,
    task_state_update,
)

ACTIVE_MAX = 1000
"""The maximum number of tasks that are being dispatched; further requests are refused."""
FINISHED_MAX = 100
"""The number of finished tasks in `DispatchStates`, as in RMF."""
ANSWERS_MAX = 1000
"""The number of stored answers to requests, which are repeated for repeated requests."""
NOBODY = "robochoc-no-fleet"
"""The name of no fleet. On a command for it, all fleets drop their bids for the task."""
_OVERDUE_ROUNDS = 5
"""A task that had bids in this number of rounds comes first."""
_REFUSAL = 4
"""The number of tries for which a refusal by all fleets counts, since no message was lost."""
_LONGEST = 8
_ATTEMPTS = 3
"""The number of times that a task is asked for before its round goes on without it."""
_LINGER_S = 3600.0
_NS = 10**9
_CONFLICT = "two bidders have the fleet name {}, and both would execute the task: give each its own name"

Allocate = Callable[[Mapping[str, Mapping[str, float]], set[str]], Mapping[str, str]]
"""Returns the fleet of tasks, each fleet at most once, from the costs by task and fleet, and the tasks to prefer."""


class Dispatcher:
    """Dispatches tasks. Each method takes the time in seconds, which never decreases, and `drain` returns messages.

    Args:
        prefix: A text in the ids of tasks, different for each start: fleets remember the ids of former tasks.
        allocate: Allocates tasks to fleets.
        settings: The settings.
        epoch_ns: The time since 1970 in nanoseconds at the time 0 s.
    """

    def __init__(
        self,
        prefix: str,
        allocate: Allocate,
        settings: Settings = DEFAULTS,
        *,
        epoch_ns: int = 0,
    ) -> None:
        self._prefix, self._allocate, self._settings, self._epoch_ns = prefix, allocate, settings, epoch_ns
        self._tasks: dict[str, Task] = {}
        self._finished: dict[str, Task] = {}
        self._answers: dict[str, ApiResponse] = {}
        self._fleets = Fleets()
        self._round: Round | None = None
        self._commands: dict[int, PendingCommand] = {}
        self._numbers = self._rounds = 0
        self._states_s = 0.0
        self._outgoing: list[Message] = []
        self._news: list[DispatchState] = []

    # Input and output

    def receive(self, message: Message, now_s: float) -> None:
        """Handle a message. Messages that are unexpected, repeated or late have no effect."""
        match message:
            case ApiRequest():
                self._answer(message, now_s)
            case BidResponse():
                self._store_bid(message, now_s)
            case DispatchAck():
                self._acknowledged(message, now_s)
            case _:
                return
        self._advance(now_s)

    def tick(self, now_s: float) -> None:
        """Do what is due at a time: repeat commands, end time windows, begin rounds, publish states."""
        for number, command in [*self._commands.items()]:
            if command.is_award and now_s >= command.began_s + self._settings.expire_s:
                self._withdraw(number, now_s)
            elif now_s >= command.began_s + _LINGER_S:
                del self._commands[number]
            elif now_s >= command.next_s:
                command.next_s = now_s + command.pause_s
                command.pause_s *= 1 if command.is_award else 2
                self._outgoing.append(command.command)
        self._advance(now_s)
        if now_s >= self._states_s:
            self._states_s = now_s + self._settings.states_s
            self._outgoing.append(self.states)

    def drain(self) -> list[Message]:
        """Return the messages to send, in order."""
        found, self._outgoing = self._outgoing, []
        return found

    def drain_finished(self) -> list[DispatchState]:
        """Return the tasks that have finished since the last call."""
        found, self._news = self._news, []
        return found

    @property
    def states(self) -> DispatchStates:
        """The states of all tasks."""
        active, finished = (tuple(task.state for task in tasks.values()) for tasks in (self._tasks, self._finished))
        return DispatchStates(active, finished)

    @property
    def is_idle(self) -> bool:
        """True if no task is being dispatched, and all commands are acknowledged."""
        return not self._tasks and not self._commands

    # Requests

    def _answer(self, request: ApiRequest, now_s: float) -> None:
        answer = self._answers.get(request.request_id)
        if answer is None:
            try:
                found = read_request(request.json_msg)
            except RequestError as error:
                text: str | None = failure_json(INVALID_REQUEST, "Invalid request format", str(error))
            else:
                text = self._accept(found, now_s)
            if text is None:
                return
            answer = ApiResponse(int(ResponseType.RESPONDING), text, request.request_id)
            self._answers[request.request_id] = answer
            if len(self._answers) > ANSWERS_MAX:
                del self._answers[next(iter(self._answers))]
        self._outgoing.append(answer)

    def _accept(self, request: NewTask | CancelTask | None, now_s: float) -> str | None:
        """Return the answer to a request as JSON; None if other nodes answer it."""
        match request:
            case NewTask() if len(self._tasks) >= ACTIVE_MAX:
                return failure_json(NOT_FEASIBLE, "Too many tasks", f"{ACTIVE_MAX:,} tasks are being dispatched")
            case NewTask(text, task):
                self._numbers += 1
                task_id = f"{task.category}.dispatch-{self._prefix}{self._numbers}"
                self._tasks[task_id] = Task(task_id, text, task, ask_s=now_s + self._settings.gather_s)
                state = state_json(task_id, task, "queued")
                return success_json(state | {"dispatch": {"status": "queued", "errors": []}})
            case CancelTask(task_id) if task_id in self._tasks:
                self._cancel(self._tasks[task_id], now_s)
                return success_json()
            case _:
                return None

    def _cancel(self, task: Task, now_s: float) -> None:
        for number, command in [*self._commands.items()]:
            if command.task is task and command.is_award:
                del self._commands[number]
                self._command(CommandType.REMOVE, task, command.command.fleet_name, now_s)
        self._drop_bids(task.bid_id)
        self._finish(task, TaskStatus.CANCELED)

    # Bids

    def _store_bid(self, response: BidResponse, now_s: float) -> None:
        one, notice = response.proposal, self._notice_of(response.task_id)
        is_bid = response.has_proposal and one.is_valid
        if is_bid and (notice is not None or self._is_own(response.task_id)):
            self._fleets.add(one.fleet_name)
            if "?" not in response.task_id:
                self._fleets.compare_bid(response.task_id, one, now_s)
        if notice is None:
            return
        if not is_bid:
            notice.refusals += 1
            notice.task.add_errors(*response.errors)
        elif self._fleets.has_conflict(one.fleet_name, now_s):
            notice.refusals += notice.proposals.pop(one.fleet_name, None) is None
            notice.task.add_errors(error_json(NO_BIDS, "conflict", _CONFLICT.format(one.fleet_name)))
        elif notice.task.request.fleet_name in (None, one.fleet_name):
            notice.proposals[one.fleet_name] = one

    def _is_own(self, notice_id: str) -> bool:
        """Return whether a notice is one of this dispatcher, possibly an earlier one."""
        return f".dispatch-{self._prefix}" in notice_id

    def _notice_of(self, notice_id: str) -> Notice | None:
        """Return the notice of the present round with an id."""
        current = self._round
        if current is None:
            return None
        if current.present and current.present.notice_id == notice_id:
            return current.present
        return current.notices.get(notice_id)

    def _ask(self, notice: Notice, *, dry_run: bool) -> None:
        """Ask for bids."""
        self._fleets.ask()
        window = round(notice.window_s * _NS)
        self._outgoing.append(BidNotice(notice.task.text, notice.notice_id, window, dry_run))

    # Rounds

    def _advance(self, now_s: float) -> None:
        """Go as far as possible without further messages."""
        while self._step(now_s):
            pass

    def _step(self, now_s: float) -> bool:
        """Do one step; return whether a further one may be possible."""
        current = self._round
        if current is None:
            return self._begin(now_s)
        if current.present is not None:
            return self._await_bids(current, current.present, now_s)
        if not current.is_priced:
            self._price_next(current, now_s)
            return True
        if current.selected:
            task, fleet, attempt = current.selected.pop(0)
            if self._is_active(task):
                current.present = Notice(task.bid_id, task, fleet, now_s, self._window_s(task, attempt), attempt)
                self._ask(current.present, dry_run=False)
            return True
        if any(command.is_award for command in self._commands.values()):
            return False
        self._round = None
        return True

    def _await_bids(self, current: Round, notice: Notice, now_s: float) -> bool:
        """Return whether the present notice is answered or its time is over."""
        is_over = now_s >= notice.asked_s + notice.window_s
        if not (is_over or notice.is_answered(len(self._fleets)) or not self._is_active(notice.task)):
            return False
        current.present = None
        if current.is_priced and self._is_active(notice.task):
            self._close(current, notice, now_s)
        return True

    def _begin(self, now_s: float) -> bool:
        """Begin a round, if a task can be asked for."""
        ready = self._ready(now_s, self._settings.batch)
        if not ready:
            return False
        self._rounds += 1
        self._round = Round(self._rounds, ready)
        if len(ready) == 1:  # prices are not compared with those of other tasks
            self._round.is_priced, self._round.selected = True, [(ready[0], None, 1)]
        return True

    def _ready(self, now_s: float, most: int) -> list[Task]:
        """Return the tasks that can be asked for, the oldest first."""
        ready = (one for one in self._tasks.values() if one.status == TaskStatus.QUEUED and one.ask_s <= now_s)
        return [*itertools.islice(ready, most)]

    def _window_s(self, task: Task, attempt: int = 1) -> float:
        """Return the time window for bids: twice as long after each failure, up to eight times as long."""
        return self._settings.time_window_s * min(1 << min(task.failures, _LONGEST) + attempt - 1, _LONGEST)

    def _is_active(self, task: Task) -> bool:
        return task.task_id in self._tasks

    def _price_next(self, current: Round, now_s: float) -> None:
        """Ask for the price of the next task, or allocate the tasks if all prices are known."""
        asked = [notice.task for notice in current.notices.values()]
        new = [one for one in self._ready(now_s, self._settings.batch) if one not in (*asked, *current.waiting)]
        current.waiting = [one for one in current.waiting if self._is_active(one)]
        current.waiting += new[: self._settings.batch - len(asked) - len(current.waiting)]
        if not current.waiting:
            self._allocate_round(current, now_s)
            return
        task = current.waiting.pop(0)
        notice = Notice(f"{task.task_id}?{current.number}", task, None, now_s, self._window_s(task))
        current.notices[notice.notice_id] = current.present = notice
        self._ask(notice, dry_run=True)

    def _allocate_round(self, current: Round, now_s: float) -> None:
        """Choose the tasks to be awarded in this round, and their fleets."""
        current.is_priced = True
        notices = {one.task.task_id: one for one in current.notices.values() if self._is_active(one.task)}
        current.notices = {}
        costs = {
            task: {fleet: self._cost(one) for fleet, one in notice.proposals.items()}
            for task, notice in notices.items()
            if notice.proposals
        }
        overdue = {task for task, notice in notices.items() if notice.task.passed_over >= _OVERDUE_ROUNDS}
        chosen = self._allocate(costs, overdue) if costs else {}
        current.selected = [(notices[task].task, fleet, 1) for task, fleet in chosen.items()]
        for task_id, notice in notices.items():
            self._drop_bids(notice.notice_id)  # fleets without dry runs have stored them
            if task_id not in costs:
                self._without_bid(notice, now_s)
            else:
                notice.task.passed_over = 0 if task_id in chosen else notice.task.passed_over + 1

    def _close(self, current: Round, notice: Notice, now_s: float) -> None:
        """Award a task on the bids that have arrived; without one, ask again a few times."""
        task, found = notice.task, notice.proposals
        costs = {fleet: self._cost(one) for fleet, one in found.items() if notice.fleet in (None, fleet)}
        if not costs:
            self._renew(task)
            if notice.attempt < _ATTEMPTS and not notice.refusals:
                current.selected.append((task, notice.fleet, notice.attempt + 1))
            else:
                self._without_bid(notice, now_s)
            return
        fleet = min(costs, key=lambda one: (costs[one], one))
        task.status, task.proposal = TaskStatus.SELECTED, found[fleet]
        self._command(CommandType.AWARD, task, fleet, now_s)

    def _without_bid(self, notice: Notice, now_s: float) -> None:
        why = error_json(NO_BIDS, "rejection", f"no fleet has bid for {notice.task.task_id}")
        self._failed(notice.task, now_s, why, tries=_REFUSAL if notice.refusals else 1)

    def _renew(self, task: Task) -> None:
        """Give a task a new id: fleets may have stored bids for the present one, which become outdated."""
        self._drop_bids(task.bid_id)
        task.version += 1

    def _cost(self, proposal: BidProposal) -> float:
        if self._settings.by_finish:
            return (proposal.finish_time - self._epoch_ns) / _NS
        return proposal.added_cost

    # Commands

    def _command(self, kind: CommandType, task: Task, fleet: str, now_s: float) -> None:
        self._numbers += 1
        at_ns = self._epoch_ns + round(now_s * _NS)
        command = DispatchCommand(fleet, task.bid_id, self._numbers, at_ns, int(kind))
        pause_s = self._settings.repeat_s
        self._commands[self._numbers] = PendingCommand(command, task, now_s, now_s + pause_s, pause_s)
        self._outgoing.append(command)

    def _drop_bids(self, bid_id: str) -> None:
        """Tell all fleets to drop their bids."""
        self._numbers += 1
        self._outgoing.append(DispatchCommand(NOBODY, bid_id, self._numbers, 0, int(CommandType.REMOVE)))

    def _acknowledged(self, ack: DispatchAck, now_s: float) -> None:
        command = self._commands.pop(ack.dispatch_id, None)
        if command is None or not command.is_award:
            return
        if ack.success:
            self._finish(command.task, TaskStatus.DISPATCHED)
        else:
            self._renew(command.task)
            self._failed(command.task, now_s, *ack.errors)

    def _withdraw(self, number: int, now_s: float) -> None:
        """Withdraw an award that was not acknowledged. The command is repeated until the fleet answers again."""
        pending = self._commands.pop(number)
        fleet, task = pending.command.fleet_name, pending.task
        self._fleets.forget(fleet)
        self._command(CommandType.REMOVE, task, fleet, now_s)
        self._renew(task)
        self._failed(task, now_s, error_json(NO_BIDS, "timeout", f"{fleet} has not acknowledged the award"))

    def _failed(self, task: Task, now_s: float, *errors: str, tries: int = 1) -> None:
        """Ask for bids for a task again, or give it up."""
        task.add_errors(*errors)
        task.failures += tries
        task.status, task.proposal = TaskStatus.QUEUED, None
        task.ask_s = now_s + self._settings.retry_s
        if task.failures >= self._settings.tries:
            self._finish(task, TaskStatus.FAILED)

    def _finish(self, task: Task, status: TaskStatus) -> None:
        task.status = status
        self._news.append(task.state)
        if status != TaskStatus.DISPATCHED:  # else the fleet publishes its state
            self._outgoing.append(task_state_update(state_json(task.task_id, task.request, status.name.lower())))
        del self._tasks[task.task_id]
        self._finished[task.task_id] = task
        if len(self._finished) > FINISHED_MAX:
            del self._finished[next(iter(self._finished))]
        self._states_s = 0.0
