"""The states of a whole team, and every order of deliveries between them, breadth first.

A state of the team is the state of each robot, and the messages on each channel, first in, first out. A step delivers
the first message of a channel, or a packet: some waiting messages at once, as runtimes deliver them. Because the search
is breadth first, the way to a faulty state is one of the shortest.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterator, Mapping, Sequence

from robochoc.exploration.endless_runs import Edge, EndlessRun, endless_run
from robochoc.exploration.local_steps import LocalState, Received, Step
from robochoc.exploration.stage import Stage
from robochoc.exploration.state_store import StateStore
from robochoc.exploration.team_state import LOST, Channel, Delivery, Exploration, Move, TeamState
from robochoc.model.outcome import Verdict
from robochoc.solver.errors import UnsupportedError

NOT_A_NEIGHBOUR = "with which it shares no constraint; set Traits.writes_to_non_neighbours if this is intended"
MOST_PACKETS = 20_000
"""The maximum number of packets that are explored from a state: their number grows exponentially."""
_OFTEN = 256
"""The number of states between two checks of the time, which is also checked after each new stage."""


class TooManyPacketsError(UnsupportedError):
    """Raised if more than `MOST_PACKETS` packets may be received in a state."""


class StateGraph:
    """The states of a team.

    Args:
        first: The robots, which are not started, and what must hold.
        packets: True to deliver also several waiting messages at once.
        losses: The maximum number of messages that are lost.
        reduced: False to explore also orders that lead to the same states in another sequence.
    """

    def __init__(self, first: Stage, *, packets: bool = False, losses: int = 0, reduced: bool = True) -> None:
        self._stages = [first]
        self._stage_numbers = {id(first): 0}
        self._packets, self._losses = packets, losses
        self._contents: list[bytes] = []
        self._numbers: dict[bytes, int] = {}
        self._store = StateStore()
        self._independent_receivers: dict[tuple[int, tuple[Channel, ...]], tuple[int, ...]] = {}
        self._deliveries: dict[tuple[int, int, tuple[Channel, ...]], Delivery] = {}
        self._ends_at_once = Verdict.SOLUTION in first.traits.concludes
        self._reduced = reduced and not losses and not self._ends_at_once

    def explore(self, most: int, is_over: Callable[[int], bool] = lambda _: False) -> Exploration:
        """Explore up to `most` states, or up to the first fault.

        Args:
            most: The maximum number of states.
            is_over: Asked from time to time, with the number of states so far, whether to stop.
        """
        found, store = Exploration(), self._store
        _, first, found.fault = self.start()
        if found.fault:
            return found
        store.add(store.key(first))
        stages = 0
        while found.states < len(store) <= most:
            if (found.states % _OFTEN == 0 or len(self._stages) > stages) and is_over(found.states):
                break
            stages, number = len(self._stages), found.states
            try:
                fault, delivery = self._explored(number, found)
            except TooManyPacketsError:
                break
            found.states += 1
            if fault:
                found.fault = fault
                found.path = [*store.path(number), *([delivery] if delivery else [])]
                break
        found.local_states = sum(len(robot.states) for stage in self._stages for robot in stage.robots)
        found.is_complete = found.states == len(store) and not found.fault
        if found.is_complete:
            found.is_cyclic = self.endless_run() is not None
        return found

    def _explored(self, number: int, found: Exploration) -> tuple[str, Delivery | None]:
        """Add the states after a state to the store. Return its fault, if any, and the faulty delivery."""
        store = self._store
        state = store.state(number)
        fault = self.fault_on_the_way(state)
        if fault:
            return fault, None
        moves = self._chosen(state)
        if not moves or self._is_over(state):
            found.ends += 1
            fault = self.fault_at_the_end(state)
            if fault:
                return fault, None
        changes = [*self._changes(state, is_over=not moves)]
        found.steps += len(moves) + len(changes)
        after = []
        for move in moves + changes:
            if move.refusal:
                return move.refusal, move.delivery
            after.append(store.add(store.key(move.state), number, move.delivery))
        store.explored(after if self.witness(state) is None else after[len(moves) :])
        return "", None

    @property
    def states(self) -> Iterator[TeamState]:
        """The states found so far."""
        return map(self._store.state, range(len(self._store)))

    # What is in a state

    def stage_of(self, state: TeamState) -> Stage:
        """Return the robots, and what must hold."""
        return self._stages[state.stage]

    def robots_in(self, state: TeamState) -> list[LocalState]:
        """Return the state of each robot."""
        robots = self._stages[state.stage].robots
        return [robot.states[number] for robot, number in zip(robots, state.robots, strict=True)]

    def content(self, number: int) -> bytes:
        """Return the content of a message in a queue. `number` is not `LOST`."""
        return self._contents[number]

    def fault_on_the_way(self, state: TeamState) -> str:
        """Return the fault in a state at any time; empty if there is none."""
        judge = self._stages[state.stage].judge
        return judge.on_the_way(self.robots_in(state), self._losses - state.losses) if self._is_judged(state) else ""

    def fault_at_the_end(self, state: TeamState) -> str:
        """Return the fault in a state in which the search is over; empty if there is none."""
        judge = self._stages[state.stage].judge
        return judge.at_the_end(self.robots_in(state), self.witness(state), self._losses - state.losses)

    def is_end(self, state: TeamState) -> bool:
        """Return whether the search is over: no message arrives any more."""
        return self._is_over(state) or next(self._moves(state), None) is None

    def moves(self, state: TeamState) -> Iterator[Move]:
        """Yield every possible step, also those that are not explored because they commute."""
        deliveries = [*self._moves(state)]
        yield from deliveries
        yield from self._changes(state, is_over=not deliveries)

    def along(self, path: Sequence[Delivery]) -> list[TeamState]:
        """Return the states before the steps on `path`, and the state after them; none if a robot cannot start."""
        _, state, refusal = self.start()
        states = [] if refusal else [state]
        for delivery in path:
            state = next(move.state for move in self.moves(state) if move.delivery == delivery)
            states.append(state)
        return states

    def endless_run(self) -> EndlessRun | None:
        """Return a run of explored states in which the robots continue forever although each message arrives.

        The problem does not change in it, because it changes a limited number of times. After a conclusion, no delivery
        counts. None: there is no such run.
        """
        return endless_run(self._store.after, self._edges, self._waiting)

    def _edges(self, number: int) -> Iterator[Edge]:
        """Yield the steps from a state to explored states."""
        state = self._store.state(number)
        places = self._stages[state.stage].places
        for delivery, after, _ in self.moves(state):
            reached = self._store.number(self._store.key(after))
            if reached is not None:
                channels = frozenset((places[delivery.receiver], places[sender]) for sender in delivery.senders)
                yield Edge(reached, delivery, channels)

    def _waiting(self, number: int) -> set[Channel]:
        return {channel for channel, _ in self._store.state(number).queues}

    def witness(self, state: TeamState) -> int | None:
        """Return the robot that has concluded the search alone; None if there is none."""
        robots = self._stages[state.stage].robots
        for place, number in enumerate(state.robots):
            if robots[place].states[number].verdict is not None:
                return place
        return None

    def _is_over(self, state: TeamState) -> bool:
        """Return whether a robot has concluded the search, so that the values of all robots count at once."""
        return (self._ends_at_once or state.lossless is not None) and self.witness(state) is not None

    def _goes_on(self, state: TeamState) -> bool:
        """Return whether the robots that have started continue until they hear of a conclusion: a change may follow."""
        return state.lossless is None and bool(self._stages[state.stage].changes)

    def _is_judged(self, state: TeamState) -> bool:
        """Return whether what the robots know is used: from their start on, or if a verdict is still valid."""
        return state.lossless is None or self.witness(state) is not None

    # Steps

    def start(self) -> Move:
        """Return the step in which all robots start."""
        steps = self._stages[0].first()
        state = TeamState(tuple([step.state for step in steps]), (), self._losses, 0, lossless=True)
        refusal = next((step.refusal for step in steps if step.refusal), "")
        return Move(Delivery(starts=True), state, refusal) if refusal else self._started(state)

    def _started(self, state: TeamState) -> Move:
        """Return the step in which all robots start."""
        numbers, queues = [], dict[Channel, tuple[int, ...]]()
        delivery = Delivery(starts=True)
        for place, (robot, number) in enumerate(zip(self._stages[state.stage].robots, state.robots, strict=True)):
            step = robot.start(number, lossless=bool(state.lossless))
            refusal = step.refusal or self._send(place, step, queues, state)
            if refusal:
                return Move(delivery, state, refusal)
            numbers.append(step.state)
        return Move(delivery, _state(numbers, queues, state._replace(lossless=None)))

    def _changes(self, state: TeamState, *, is_over: bool) -> Iterator[Move]:
        """Yield each step in which the problem changes. `is_over`: the search is over in `state`.

        Messages in transit are dropped. Nothing was lost if the search had become quiescent, and this was noticed
        before the change. If a robot crashes, the search ends before it is noticed.
        """
        stage = self._stages[state.stage]
        for change in stage.changes:
            if state.lossless is not None:
                known = {state.lossless}
            elif is_over and not change.lost and not self._losses and self.witness(state) is None:
                known = {True, False}
            else:
                known = {False}
            after = stage.after(change)
            number = self._stage_numbers.setdefault(id(after), len(self._stages))
            if number == len(self._stages):
                self._stages.append(after)
            steps = after.adopted(stage, state.robots)
            robots = tuple([step.state for step in steps])
            refusal = next((step.refusal for step in steps if step.refusal), "")
            for lossless in sorted(known):
                delivery = Delivery(change=change, lossless=lossless and state.lossless is None)
                yield Move(delivery, TeamState(robots, (), state.losses, number, lossless), refusal)

    def _chosen(self, state: TeamState) -> list[Move]:
        """Return the steps from `state` that must be explored; none if the search is over.

        Deliveries to different robots commute. So it is enough to explore the deliveries to one robot, if no other
        robot can write to it before, except behind a waiting message (with packets: not at all, because this message
        could be in the same packet): they form a persistent set (Godefroid, "Partial-order methods for the verification
        of concurrent systems", LNCS 1032, 1996, Section 4). As one of them must lead to a state that is still to be
        explored, no step is put off forever.
        """
        for receiver in self._independent(state) if state.queues and self._is_reduced(state) else ():
            moves = [*self._moves(state, receiver)]
            if any(move.refusal or self._is_unexplored(move.state) for move in moves):
                return moves
        return [*self._moves(state)]

    def _is_unexplored(self, state: TeamState) -> bool:
        number = self._store.number(self._store.key(state))
        return number is None or number > self._store.explored_count

    def _is_reduced(self, state: TeamState) -> bool:
        """Return whether some steps may be left out: the problem may not change in a state that they lead to."""
        return self._reduced and state.lossless is None and not self._stages[state.stage].changes

    def _independent(self, state: TeamState) -> tuple[int, ...]:
        """Return the receivers whose next step is the same, whatever the others do before."""
        channels = tuple([channel for channel, _ in state.queues])
        known = self._independent_receivers.get((state.stage, channels))
        if known is None:
            known = tuple(self._found_independent(self._stages[state.stage], channels, joins=self._packets))
            self._independent_receivers[state.stage, channels] = known
        return known

    @staticmethod
    def _found_independent(stage: Stage, channels: Sequence[Channel], *, joins: bool) -> Iterator[int]:
        """Yield the independent receivers. `joins`: a message behind a waiting one may be in the same packet."""
        full = set() if joins else {*channels}
        receivers = dict.fromkeys(receiver for receiver, _ in channels)
        for receiver in receivers:
            active, found = {*receivers} - {receiver}, set[int]()
            while active:
                found |= active
                active = {place for place in stage.everybody - found - {receiver} if stage.writers[place] & found}
            if all((receiver, writer) in full for writer in stage.writers[receiver] & found):
                yield receiver

    def _moves(self, state: TeamState, only: int | None = None) -> Iterator[Move]:
        """Yield each possible step from `state`, or to one receiver; none if the search is over."""
        if self._is_over(state) and not self._goes_on(state):
            return
        if state.lossless is not None:
            yield self._started(state)
            return
        queues = dict(state.queues)
        receivers: dict[int, list[Channel]] = {}
        for channel, queue in state.queues:
            if queue[-1] != LOST and only in {None, channel[0]}:
                receivers.setdefault(channel[0], []).append(channel)
        for channel in itertools.chain.from_iterable(receivers.values()) if state.losses else ():
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
        number = 0
        while packets:
            number += len(packets)
            if number > MOST_PACKETS:
                raise TooManyPacketsError(f"more than {MOST_PACKETS:,} packets may be received in a state")
            yield from packets
            longer = itertools.product(packets, channels)
            packets = [(*packet, channel) for packet, channel in longer if packet.count(channel) < left[channel]]

    def _received(
        self, state: TeamState, receiver: int, packet: tuple[Channel, ...], queues: Mapping[Channel, tuple[int, ...]]
    ) -> Move:
        """Return the step in which `receiver` receives the next message of each channel in `packet`."""
        stage = self._stages[state.stage]
        after = dict(queues)
        received = []
        for channel in packet:
            queue = after[channel]
            missing = 0
            while queue[missing] == LOST:
                missing += 1
            received.append(Received(stage.names[channel[1]], self._contents[queue[missing]], missing))
            after[channel] = queue[missing + 1 :]
        delivery = self._deliveries.get((state.stage, receiver, packet))
        if delivery is None:
            delivery = Delivery(stage.names[receiver], tuple([one.sender for one in received]))
            self._deliveries[state.stage, receiver, packet] = delivery
        step = stage.robots[receiver].packet(state.robots[receiver], tuple(received))
        refusal = step.refusal or self._send(receiver, step, after, state)
        if refusal:
            return Move(delivery, state, refusal)
        robots = [*state.robots]
        robots[receiver] = step.state
        return Move(delivery, _state(robots, after, state))

    def _lost(self, state: TeamState, channel: Channel, queues: Mapping[Channel, tuple[int, ...]]) -> Move:
        """Return the step in which the next message of `channel` is lost."""
        queue = queues[channel]
        missing = next(place for place, number in enumerate(queue) if number != LOST)
        after = {**queues, channel: (*queue[:missing], LOST, *queue[missing + 1 :])}
        names = self._stages[state.stage].names
        delivery = Delivery(names[channel[0]], (names[channel[1]],), lost=True)
        return Move(delivery, _state(state.robots, after, state._replace(losses=state.losses - 1)))

    def _went_on(self, state: TeamState, queues: dict[Channel, tuple[int, ...]]) -> Iterator[Move]:
        """Yield the step in which all robots continue without lost messages, if any robot does."""
        numbers, went = [*state.robots], False
        for place, robot in enumerate(self._stages[state.stage].robots):
            step = robot.go_on(numbers[place])
            if step is not None and step.refusal:
                yield Move(Delivery(), state, step.refusal)
                return
            if step is not None:
                went = True
                numbers[place] = step.state
                refusal = self._send(place, step, queues, state)
                if refusal:
                    yield Move(Delivery(), state, refusal)
                    return
        if went:
            yield Move(Delivery(), _state(numbers, queues, state))

    def _send(self, sender: int, step: Step, queues: dict[Channel, tuple[int, ...]], state: TeamState) -> str:
        """Append the messages of a step to the queues. Return why it is not possible, or an empty text."""
        stage = self._stages[state.stage]
        for receiver, content in step.sent:
            if receiver not in stage.places:
                return f"{stage.names[sender]} sends a message to {receiver}, which is not in the team"
            if sender not in stage.writers[stage.places[receiver]] and not stage.traits.writes_to_non_neighbours:
                return f"{stage.names[sender]} sends a message to {receiver}, {NOT_A_NEIGHBOUR}"
            number = self._numbers.setdefault(content, len(self._contents))
            if number == len(self._contents):
                self._contents.append(content)
            channel = stage.places[receiver], sender
            queues[channel] = (*queues.get(channel, ()), number)
        return ""


def _state(robots: Sequence[int], queues: Mapping[Channel, tuple[int, ...]], before: TeamState) -> TeamState:
    """Return a state of the same stage as `before`."""
    waiting = tuple(sorted([item for item in queues.items() if item[1]]))
    return TeamState(tuple(robots), waiting, before.losses, before.stage)
