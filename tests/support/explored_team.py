"""Every order in which the real master and robots can act, breadth first: `explored_master.py`, `explored_robots.py`.

Each pair of participants is connected by channels, first in, first out: orders and reports between the master and a
process, and a queue from robot to robot. Everything in a channel can be delayed as long as anything else happens.
"""

from __future__ import annotations

import itertools
from collections import deque
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from random import Random
from typing import Any, NamedTuple

import msgspec

from robochoc.communication.processes.queues import Stamped
from robochoc.communication.processes.robot_process import QueueRobot
from robochoc.exploration.components import strong_components
from tests.support.explored_master import Arrived, Ended, Input, Master, MasterView, Output, Passed, Step
from tests.support.explored_robots import Action, Robots, RobotView, Wake, without_system

_SHARE_USUAL = 0.9
"""The share of steps of a random order in which no process is killed, and no time passes."""
END = Output("end", "")
"""In a channel: its other end is closed."""

Judge = Callable[[Any, Mapping[str, RobotView]], str]
"""Returns why the result is wrong, given the states of the present robots; empty if it is right."""


class TeamState(NamedTuple):
    """A state: of the master, of each process, of each channel that is not empty, and what may still go wrong.

    The last state of a process that has ended is negative: see `_ended_state`.
    """

    master: int
    robots: tuple[tuple[str, int], ...] = ()
    channels: tuple[tuple[str, tuple[int, ...]], ...] = ()
    crashes: int = 0
    passes: int = 0
    losses: int = 0


class Move(NamedTuple):
    """A step in words, the state after it, and why it is wrong (empty if it is not)."""

    words: str
    state: TeamState
    fault: str = ""


@dataclass
class Found:
    """The result of an exploration. `path`: the steps that lead to the fault."""

    states: int = 0
    steps: int = 0
    ends: int = 0
    fault: str = ""
    is_complete: bool = False
    waves: int = 0
    path: Sequence[str] = ()
    results: set[str] = field(default_factory=set)


class ExploredTeam:
    """The states of a team and its master.

    Args:
        program: Runs the master: opens sessions of `processes.ProcessesRun`, and returns the result.
        judge: What the result must be.
        crashes: The maximum number of processes that are killed, at any moment, also within a step.
        passes: The maximum number of times at which nothing is read for `pass_s` seconds, at any moment.
        pass_s: That time, in seconds.
        patient: True to let this time pass only when nothing else can happen.
        losses: The maximum number of messages between robots that are lost.
        batches: True to let participants also read all that has arrived at once.
        kind: The class of the robots.
    """

    def __init__(  # noqa: PLR0913 - keyword options
        self,
        program: Callable[[], Any],
        judge: Judge,
        *,
        crashes: int = 0,
        passes: int = 0,
        pass_s: float = 1.0,
        patient: bool = False,
        losses: int = 0,
        batches: bool = False,
        kind: type[QueueRobot] = QueueRobot,
    ) -> None:
        self._master, self._robots = Master(program), Robots(kind)
        self._patient, self._losses = patient, losses
        self._judge, self._batches = judge, batches
        self._crashes, self._passes, self._pass_s = crashes, passes, pass_s
        self._items: list[Output] = []
        self._numbers: dict[Output, int] = {}
        self._epochs: list[int] = []
        self._before: dict[TeamState, tuple[TeamState, str] | None] = {}
        self._after: dict[TeamState, list[TeamState]] = {}

    def explore(self, most: int) -> Found:
        """Explore up to `most` states, or up to the first fault."""
        with without_system():
            return self._explored(most)

    def _explored(self, most: int) -> Found:
        found = Found()
        first = self._started()
        self._before[first] = None
        waiting = deque([first])
        while waiting and found.states < most:
            state = waiting.popleft()
            found.states += 1
            view = self._master.views[state.master]
            found.waves = max(found.waves, view.waves)
            fault = self._fault(state, view)
            moves = [] if view.has_ended or fault else [*self._moves(state, view)]
            found.steps += len(moves)
            found.ends += view.has_ended
            if view.has_ended:
                found.results.add(str(getattr(view.result, "verdict", view.result)))
            self._after[state] = [move.state for move in moves]
            for words, after, wrong in moves:
                if after not in self._before:
                    self._before[after] = state, words
                    waiting.append(after)
                if wrong and not fault:
                    fault, state = wrong, after
            if fault:
                found.fault, found.path = fault, self._path(state)
                return found
        found.is_complete = not waiting
        if found.is_complete and any(strong_components(first, self._after.__getitem__)):
            found.fault = "the team can continue forever"
        return found

    def walk(self, chance: Random, walks: int) -> Found:
        """Play so many random orders from the beginning to the end, or up to the first fault."""
        found = Found()
        with without_system():
            while found.ends < walks and not found.fault:
                self._walk(chance, found)
        return found

    def _walk(self, chance: Random, found: Found) -> None:
        state, path = self._started(), list[str]()
        while True:
            found.states += 1
            view = self._master.views[state.master]
            found.fault = self._fault(state, view)
            if view.has_ended:
                found.ends += 1
                found.results.add(str(getattr(view.result, "verdict", view.result)))
            if view.has_ended or found.fault:
                break
            moves = [*self._moves(state, view)]
            usual = [move for move in moves if move.state[-3:] == state[-3:]]
            chosen = usual if usual and chance.random() < _SHARE_USUAL else moves
            words, state, found.fault = chance.choice(chosen)
            path.append(words)
            if found.fault:
                break
        found.path = path

    def _started(self) -> TeamState:
        step = self._master.start()
        first = TeamState(step.state, crashes=self._crashes, passes=self._passes, losses=self._losses)
        return self._with(first, "", step.outputs)

    def _path(self, state: TeamState) -> list[str]:
        path = []
        while (step := self._before[state]) is not None:
            state, words = step
            path.append(words)
        return path[::-1]

    # What must hold

    def _fault(self, state: TeamState, view: MasterView) -> str:
        last = {process.rpartition(".")[0]: number for process, number in state.robots}
        if view.has_ended:
            unjust = len(getattr(view.result, "lost", ())) > self._crashes - state.crashes
            ends = {name: self._robots.views[_living(number)] for name, number in last.items()}
            return "a robot counts as lost that was not killed" if unjust else self._judge(view.result, ends)
        here = [self._robots.views[_living(last[name])] for name in view.order if name in last]
        searching = [one for one in here if one.epoch == view.epoch]
        most = 2 + self._passes + 2 * sum(one.sent for one in searching)
        if view.waves > most and not view.is_limited:
            return f"the master has started {view.waves} waves, although nothing has changed"
        is_lossy = state.losses < self._losses or any(last.get(name, -1) < 0 for name in view.order)
        if is_lossy or any(one.is_paused for one in searching):
            return "the search counts as over, but a message was lost" if self._is_deceived(state, view) else ""
        under_way = sum(one.held for one in searching) + sum(
            self._epochs[item] == view.epoch for channel, items in state.channels if ">" in channel for item in items
        )
        if sum(one.sent - one.received for one in searching) != under_way:
            return "the robots have handled messages that were not sent in this search"
        is_quiet = not under_way and searching == here and all(one.is_searching for one in searching)
        return "" if is_quiet or not view.quiescent else f"the search counts as over, but {under_way} are under way"

    def _is_deceived(self, state: TeamState, view: MasterView) -> bool:
        return state.losses < self._losses and view.quiescent

    # Steps

    def _moves(self, state: TeamState, view: MasterView) -> Iterator[Move]:
        channels = dict(state.channels)
        moved = False
        by_all = self._of_the_master(state, view, channels), self._of_the_robots(state, channels), self._lost(state)
        for move in itertools.chain(*by_all):
            moved = moved or move.state != state
            if move.state != state or move.fault:
                yield move
        if state.passes and not (moved and self._patient):
            after = state._replace(passes=state.passes - 1)
            yield self._mastered(after, Passed(self._pass_s), f"{self._pass_s:g} s pass")
        elif not moved:
            why = "the master waits for a time limit, since nothing else will happen"
            yield Move(why, state, why)

    def _lost(self, state: TeamState) -> Iterator[Move]:
        for queue, items in state.channels if state.losses else ():
            if ">" in queue and self._items[items[0]].kind == "put":
                after = self._without(state, {queue: 1})
                yield Move(f"a message of {queue} is lost", after._replace(losses=state.losses - 1))

    def _of_the_master(
        self, state: TeamState, view: MasterView, channels: Mapping[str, tuple[int, ...]]
    ) -> Iterator[Move]:
        reports = {process: channels[f"{process}!"] for process in sorted(view.links) if f"{process}!" in channels}
        for process, items in reports.items():
            yield self._read(state, {process: items[:1]})
        if self._batches and sum(map(len, reports.values())) > 1:
            yield self._read(state, reports)
        yield self._mastered(state, Passed(0), "the master continues")
        for process, number in state.robots:
            if number < 0 and process in view.links:
                rest = channels.get(f"{process}!", ())
                after = self._without(state, {f"{process}!": len(rest)})
                ended = Ended(process, tuple(self._items[item].content for item in rest))
                yield self._mastered(after, ended, f"the master notices the end of {process}")

    def _read(self, state: TeamState, reports: Mapping[str, tuple[int, ...]]) -> Move:
        after = self._without(state, {f"{process}!": len(items) for process, items in reports.items()})
        arrived = tuple(
            (process, tuple(self._items[item].content for item in items)) for process, items in reports.items()
        )
        words = ", ".join(f"{len(items)} of {process}" for process, items in reports.items())
        return self._mastered(after, Arrived(arrived), f"the master reads {words}")

    def _mastered(self, state: TeamState, arrived: Input, words: str) -> Move:
        step = self._master.step(state.master, arrived)
        return Move(words, self._with(state._replace(master=step.state), "", step.outputs), step.fault)

    def _of_the_robots(self, state: TeamState, channels: Mapping[str, tuple[int, ...]]) -> Iterator[Move]:
        for process, number in state.robots:
            if number < 0:
                continue
            view = self._robots.views[number]
            readable = [channel for channel in sorted(view.readers) if channel in channels]
            readable = [f"!{process}"] * (f"!{process}" in channels) + readable
            wakes = [{channel: channels[channel][:1]} for channel in readable]
            if self._batches and sum(len(channels[channel]) for channel in readable) > 1:
                whole = {channel: self._until_end(channels[channel]) for channel in readable}
                wakes += [whole, dict(reversed(whole.items()))][: len(readable)]
            for wake in wakes:
                yield from self._woken(state, process, wake)
            if view.is_restless:
                yield from self._woken(state, process, {})
            if state.crashes:
                yield Move(f"{process} is killed", self._ended(state._replace(crashes=state.crashes - 1), process))

    def _until_end(self, items: tuple[int, ...]) -> tuple[int, ...]:
        """Return the items that are read at once: the end of a channel is read alone."""
        content = tuple(item for item in items if self._items[item] != END)
        return content or items

    def _woken(self, state: TeamState, process: str, wake: Mapping[str, tuple[int, ...]]) -> Iterator[Move]:
        actions: Wake = tuple(
            Action(
                "" if channel.startswith("!") else channel,
                tuple(self._items[i] for i in items if self._items[i] != END),
            )
            for channel, items in wake.items()
        )
        step = self._robots.step(dict(state.robots)[process], actions)
        words = " and ".join(f"{len(items)} from {channel}" for channel, items in wake.items())
        words = f"{process} reads {words}" if words else f"{process} reports that it is idle"
        before = self._without(state, {channel: len(items) for channel, items in wake.items()})
        if step.fault:
            yield Move(words, state, step.fault)
            return
        yield Move(words, self._stepped(before, process, step, step.outputs))
        for many in range(len(step.outputs)) if state.crashes else ():
            after = self._stepped(before._replace(crashes=state.crashes - 1), process, step, step.outputs[:many])
            yield Move(f"{words}, and is killed after {many} effects", self._ended(after, process))

    def _stepped(self, state: TeamState, process: str, step: Step, outputs: Sequence[Output]) -> TeamState:
        robots = tuple((name, step.state if name == process else number) for name, number in state.robots)
        after = self._with(state._replace(robots=robots), process, outputs)
        return after if self._robots.views[step.state].is_running else self._ended(after, process)

    # Effects

    def _without(self, state: TeamState, taken: Mapping[str, int]) -> TeamState:
        channels = dict(state.channels)
        for channel, many in taken.items():
            channels[channel] = channels.get(channel, ())[many:]
        return _state(state, dict(state.robots), channels)

    def _with(self, state: TeamState, sender: str, outputs: Sequence[Output]) -> TeamState:
        """Return the state after the effects of a step by `sender`, a process or (empty) the master."""
        for output in outputs:
            match output.kind:
                case "spawn":
                    step = self._robots.spawn(output.content)
                    robots = {**dict(state.robots), output.to: step.state}
                    state = self._with(_state(state, robots, dict(state.channels)), output.to, step.outputs)
                case "order":
                    state = self._put(state, f"!{output.to}", output)
                case "report":
                    state = self._put(state, f"{sender}!", output)
                case "put":
                    state = self._put(state, output.to, output)
                case "shut" if output.to.startswith(f"{sender}>"):
                    state = self._put(state, output.to, END)
                case "shut":
                    state = _dropped(state, output.to)
                case "kill":
                    state = self._ended(state, output.to)
                case "close":
                    state = self._put(_dropped(state, f"{output.to}!"), f"!{output.to}", END)
                case kind:
                    raise AssertionError(kind)
        return state

    def _put(self, state: TeamState, channel: str, item: Output) -> TeamState:
        """Return the state with another item in a channel; without it if the reader has ended."""
        robots, channels = dict(state.robots), dict(state.channels)
        if robots.get(_reader(channel), 0) < 0:
            return state
        channels[channel] = (*channels.get(channel, ()), self._number(item))
        return _state(state, robots, channels)

    def _ended(self, state: TeamState, process: str) -> TeamState:
        """Return the state after the end of a process: its orders and queues to it are gone, its queues end."""
        robots = dict(state.robots)
        if robots[process] < 0:
            return state
        writers = self._robots.views[robots[process]].writers
        robots[process] = _ended_state(robots[process])
        channels = {channel: items for channel, items in state.channels if _reader(channel) != process}
        state = _state(state, robots, channels)
        for queue in writers:
            state = self._put(state, queue, END)
        return state

    def _number(self, item: Output) -> int:
        number = self._numbers.setdefault(item, len(self._items))
        if number == len(self._items):
            self._items.append(item)
            is_stamped = item.kind == "put"
            self._epochs.append(msgspec.msgpack.decode(item.content, type=Stamped).epoch if is_stamped else -1)
        return number


def _ended_state(number: int) -> int:
    """Return the state of a process that has ended in the state `number`."""
    return -1 - number


def _living(number: int) -> int:
    """Return the number of the last state of a process before its end, if it has ended."""
    return max(number, -1 - number)


def _reader(channel: str) -> str:
    """Return the process that reads a channel: `!A` (orders), `B>A#1` (a queue); of `A!` (reports) it is the master."""
    return channel[1:] if channel.startswith("!") else channel.partition(">")[2].partition("#")[0]


def _dropped(state: TeamState, channel: str) -> TeamState:
    return state._replace(channels=tuple(one for one in state.channels if one[0] != channel))


def _state(state: TeamState, robots: Mapping[str, int], channels: Mapping[str, tuple[int, ...]]) -> TeamState:
    return state._replace(
        robots=tuple(sorted(robots.items())), channels=tuple(sorted(one for one in channels.items() if one[1]))
    )
