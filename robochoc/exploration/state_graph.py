"""The states of a whole team, and every order of deliveries between them, breadth first.

A state of the team is the state of each robot, and the messages on each channel, first in, first out. A step delivers
the first message of a channel, or a packet: some waiting messages at once, as runtimes deliver them. Because the search
is breadth first, the way to a faulty state is one of the shortest.
"""

from __future__ import annotations

import itertools
from collections import deque
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple, Protocol

from robochoc.communication.host import Host
from robochoc.exploration.components import strong_components
from robochoc.exploration.local_steps import LocalState, LocalSteps, Received, Step
from robochoc.model.outcome import Verdict

Channel = tuple[int, int]
"""The places of a receiver and a sender in the order of the robots."""

LOST = -1
"""The number of a lost message in a queue, which its receiver will notice at the next message of the channel."""

_OFTEN = 256
"""The number of states between two checks of the time."""


class TeamState(NamedTuple):
    """A state of the team.

    Attributes:
        robots: The number of each robot's state.
        queues: The numbers of the messages on each channel, the oldest first.
        losses: The number of messages that may still be lost.
    """

    robots: tuple[int, ...]
    queues: tuple[tuple[Channel, tuple[int, ...]], ...]
    losses: int = 0


class Delivery(NamedTuple):
    """A step of the team: `receiver` receives the next messages of `senders` as a packet.

    `lost`: the message is lost instead. Without a receiver, the robots continue without the messages that they lack.
    """

    receiver: str = ""
    senders: tuple[str, ...] = ()
    lost: bool = False

    @property
    def in_words(self) -> str:
        """The step as a sentence."""
        if not self.receiver:
            return "the robots continue without the messages that they lack"
        messages = " and ".join(f"the next message of {sender}" for sender in self.senders)
        return f"{messages} to {self.receiver} is lost" if self.lost else f"{self.receiver} receives {messages}"


class Judge(Protocol):
    """Judges the states of a team."""

    def at_the_end(self, robots: Sequence[LocalState], witness: int | None, losses: int) -> str:
        """Return the fault when the search is over; empty if there is none. `witness`: the robot that concluded it."""

    def on_the_way(self, robots: Sequence[LocalState]) -> str:
        """Return the fault in a state at any time; empty if there is none."""


@dataclass
class Exploration:
    """The result of an exploration.

    Attributes:
        states: The number of the team's states.
        steps: The number of steps between them.
        ends: The number of states in which the search is over.
        local_states: The number of the robots' states, for all robots together.
        is_complete: True if nothing is left to explore.
        is_cyclic: True if there is an order of deliveries in which the robots continue forever although each message
            arrives. None: unknown.
        fault: The fault that ended it; empty if there is none.
        path: The deliveries from the start to the fault.
    """

    states: int = 0
    steps: int = 0
    ends: int = 0
    local_states: int = 0
    is_complete: bool = False
    is_cyclic: bool | None = None
    fault: str = ""
    path: Sequence[Delivery] = ()


class _Move(NamedTuple):
    """A step from a state: the delivery, the next state, and why a robot refuses the delivery (empty: none does)."""

    delivery: Delivery
    state: TeamState
    refusal: str = ""


class StateGraph:
    """The states of a team.

    Args:
        hosts: The robots, by name, in priority order. They are not started.
        judge: What must hold.
        packets: True to deliver also several waiting messages at once.
        losses: The maximum number of messages that are lost.
        reduced: False to explore also orders that lead to the same states in another sequence.
    """

    def __init__(
        self,
        hosts: Mapping[str, Host],
        judge: Judge,
        *,
        packets: bool = False,
        losses: int = 0,
        reduced: bool = True,
    ) -> None:
        self._robots = [LocalSteps(host) for host in hosts.values()]
        self._names = [robot.name for robot in self._robots]
        self._everybody = {*range(len(self._robots))}
        self._places = {name: place for place, name in enumerate(self._names)}
        self._judge = judge
        self._packets, self._losses = packets, losses
        self._contents: list[bytes] = []
        self._numbers: dict[bytes, int] = {}
        self._before: dict[TeamState, tuple[TeamState, Delivery] | None] = {}
        traits = next(iter(hosts.values())).protocol.traits
        self._ends_at_once = Verdict.SOLUTION in traits.concludes
        self._reduced = reduced and not losses and not self._ends_at_once
        self._explored_states: set[TeamState] = set()
        self._only: dict[TeamState, int] = {}
        """The receiver of the explored steps from each state; not for states from which all steps are explored."""
        self._writers = [
            {self._places[name] for name in (host.protocol.problem.neighbours if _is_local(host) else hosts)} - {place}
            for place, host in enumerate(hosts.values())
        ]
        """The robots that may send a message to each robot."""

    def explore(self, most: int, is_over: Callable[[int], bool] = lambda _: False) -> Exploration:
        """Explore up to `most` states, or up to the first fault.

        Args:
            most: The maximum number of states.
            is_over: Asked from time to time, with the number of states so far, whether to stop.
        """
        found = Exploration()
        first = self._started()
        if isinstance(first, str):
            found.fault = first
            return found
        self._before = {first: None}
        waiting = deque([first])
        while waiting and len(self._before) <= most and not (found.states % _OFTEN == 0 and is_over(found.states)):
            state = waiting.popleft()
            found.states += 1
            fault, delivery = self._explored(state, found, waiting)
            if fault:
                found.fault = fault
                found.path = [*self._path(state), *([delivery] if delivery else [])]
                break
        found.local_states = sum(len(robot.states) for robot in self._robots)
        found.is_complete = not waiting and not found.fault
        if found.is_complete:
            found.is_cyclic = self._is_cyclic(first)
        return found

    def _explored(self, state: TeamState, found: Exploration, waiting: deque[TeamState]) -> tuple[str, Delivery | None]:
        """Add the states after `state` to `waiting`. Return its fault, if any, and the faulty delivery."""
        robots = [robot.states[number] for robot, number in zip(self._robots, state.robots, strict=True)]
        fault = self._judge.on_the_way(robots)
        if fault:
            return fault, None
        self._explored_states.add(state)
        moves = self._chosen(state)
        if not moves:
            found.ends += 1
            return self._judge.at_the_end(robots, self._witness(state), self._losses - state.losses), None
        found.steps += len(moves)
        for delivery, after, refusal in moves:
            if refusal:
                return refusal, delivery
            if after not in self._before:
                self._before[after] = state, delivery
                waiting.append(after)
        return "", None

    def _path(self, state: TeamState) -> list[Delivery]:
        """Return the deliveries from the start to `state`."""
        path = []
        while (step := self._before[state]) is not None:
            state, delivery = step
            path.append(delivery)
        return path[::-1]

    def _is_cyclic(self, first: TeamState) -> bool:
        """Return whether the robots can continue forever although each message arrives at some time.

        They can if there is a set of states, each reachable from each other, in which every channel that is never empty
        delivers a message.
        """
        for component in strong_components(first, lambda state: (move.state for move in self._again(state))):
            delivered: set[Channel] = set()
            full = set.intersection(*({channel for channel, _ in state.queues} for state in component))
            for state in component:
                for delivery, after, _ in self._again(state):
                    if after in component:
                        place = self._places.get(delivery.receiver, -1)
                        delivered.update((place, self._places[sender]) for sender in delivery.senders)
            if full <= delivered:
                return True
        return False

    def _witness(self, state: TeamState) -> int | None:
        """Return the robot that has concluded the search alone; None if there is none."""
        for place, number in enumerate(state.robots):
            if self._robots[place].states[number].verdict is not None:
                return place
        return None

    # Steps

    def _started(self) -> TeamState | str:
        """Return the state after all robots have started, or the fault of a robot that has not."""
        numbers, queues = [], dict[Channel, tuple[int, ...]]()
        for place, robot in enumerate(self._robots):
            step = robot.start()
            if step.refusal:
                return step.refusal
            numbers.append(step.state)
            self._send(place, step, queues)
        return _state(numbers, queues, self._losses)

    def _chosen(self, state: TeamState) -> list[_Move]:
        """Return the steps from `state` that must be explored; none if the search is over.

        Deliveries to different robots commute. So it is enough to explore the deliveries to one robot, if every robot
        that may write to it before has already done so: they form a persistent set (Godefroid, "Partial-order methods
        for the verification of concurrent systems", LNCS 1032, 1996, Section 4). As one of them must lead to a state
        that is still to be explored, no step is put off forever.
        """
        for receiver in self._independent(state) if self._reduced else ():
            moves = [*self._moves(state, receiver)]
            if any(move.refusal or move.state not in self._explored_states for move in moves):
                self._only[state] = receiver
                return moves
        return [*self._moves(state)]

    def _again(self, state: TeamState) -> Iterator[_Move]:
        """Return the result of `_chosen` once more; none after a conclusion, even if robots have yet to hear it."""
        if self._witness(state) is not None:
            return iter(())
        return self._moves(state, self._only.get(state))

    def _independent(self, state: TeamState) -> Iterator[int]:
        """Yield each receiver to which nobody may write before its next step, except behind waiting messages."""
        full = {channel for channel, _ in state.queues}
        receivers = dict.fromkeys(receiver for receiver, _ in full)
        for receiver in receivers:
            active, found = {*receivers} - {receiver}, set[int]()
            while active:
                found |= active
                active = {place for place in self._everybody - found - {receiver} if self._writers[place] & found}
            if all((receiver, writer) in full for writer in self._writers[receiver] & found):
                yield receiver

    def _moves(self, state: TeamState, only: int | None = None) -> Iterator[_Move]:
        """Yield each possible step from `state`, or to one receiver; none if the search is over."""
        if self._ends_at_once and self._witness(state) is not None:
            return
        queues = dict(state.queues)
        receivers: dict[int, list[Channel]] = {}
        for channel, queue in state.queues:
            if queue[-1] != LOST and only in {None, channel[0]}:
                receivers.setdefault(channel[0], []).append(channel)
        if state.losses:
            for channel in (channel for channels in receivers.values() for channel in channels):
                yield self._lost(state, channel, queues)
        for receiver, channels in receivers.items():
            for packet in self._orders(channels, queues) if self._packets else [(channel,) for channel in channels]:
                yield self._received(state, receiver, packet, queues)
        if not receivers and state.queues:
            yield from self._went_on(state, queues)

    def _orders(
        self, channels: Sequence[Channel], queues: Mapping[Channel, Sequence[int]]
    ) -> Iterator[tuple[Channel, ...]]:
        """Yield the packets of waiting messages, as the channels in the order in which their messages arrive."""
        left = {channel: sum(number != LOST for number in queues[channel]) for channel in channels}
        packets: list[tuple[Channel, ...]] = [(channel,) for channel in channels]
        while packets:
            yield from packets
            longer = itertools.product(packets, channels)
            packets = [(*packet, channel) for packet, channel in longer if packet.count(channel) < left[channel]]

    def _received(
        self, state: TeamState, receiver: int, packet: Sequence[Channel], queues: Mapping[Channel, tuple[int, ...]]
    ) -> _Move:
        """Return the step in which `receiver` receives the next message of each channel in `packet`."""
        after = dict(queues)
        received = []
        for channel in packet:
            queue = after[channel]
            missing = next(place for place, number in enumerate(queue) if number != LOST)
            received.append(Received(self._names[channel[1]], self._contents[queue[missing]], missing))
            after[channel] = queue[missing + 1 :]
        delivery = Delivery(self._names[receiver], tuple([one.sender for one in received]))
        step = self._robots[receiver].packet(state.robots[receiver], tuple(received))
        if step.refusal:
            return _Move(delivery, state, step.refusal)
        self._send(receiver, step, after)
        robots = (*state.robots[:receiver], step.state, *state.robots[receiver + 1 :])
        return _Move(delivery, _state(robots, after, state.losses))

    def _lost(self, state: TeamState, channel: Channel, queues: Mapping[Channel, tuple[int, ...]]) -> _Move:
        """Return the step in which the next message of `channel` is lost."""
        queue = queues[channel]
        missing = next(place for place, number in enumerate(queue) if number != LOST)
        after = {**queues, channel: (*queue[:missing], LOST, *queue[missing + 1 :])}
        delivery = Delivery(self._names[channel[0]], (self._names[channel[1]],), lost=True)
        return _Move(delivery, _state(state.robots, after, state.losses - 1))

    def _went_on(self, state: TeamState, queues: dict[Channel, tuple[int, ...]]) -> Iterator[_Move]:
        """Yield the step in which all robots continue without lost messages, if any robot does."""
        numbers, went = [*state.robots], False
        for place, robot in enumerate(self._robots):
            step = robot.go_on(numbers[place])
            if step is not None:
                went = True
                numbers[place] = step.state
                self._send(place, step, queues)
        if went:
            yield _Move(Delivery(), _state(numbers, queues, state.losses))

    def _send(self, sender: int, step: Step, queues: dict[Channel, tuple[int, ...]]) -> None:
        """Append the messages of a step to the queues."""
        for receiver, content in step.sent:
            number = self._numbers.setdefault(content, len(self._contents))
            if number == len(self._contents):
                self._contents.append(content)
            channel = self._places[receiver], sender
            queues[channel] = (*queues.get(channel, ()), number)


def _state(robots: Sequence[int], queues: Mapping[Channel, tuple[int, ...]], losses: int) -> TeamState:
    return TeamState(tuple(robots), tuple(sorted([item for item in queues.items() if item[1]])), losses)


def _is_local(host: Host) -> bool:
    """Return whether a robot writes to its neighbours only."""
    return not host.protocol.traits.writes_to_non_neighbours
