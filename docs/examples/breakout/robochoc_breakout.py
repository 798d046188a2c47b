"""Distributed breakout.

Yokoo, Hirayama: "Distributed breakout algorithm for solving distributed constraint satisfaction problems", ICMAS
1996; also Hirayama, Yokoo: "The distributed breakout algorithms", AIJ 161 (2005). The methods and the state have the
names of its procedures:

    send_improve   `_send_improve`      wait_ok? mode, wait_improve? mode   `_waits_for_ok`
    send_ok        `_send_ok`           weights of constraint violations    `weights`

Local search in waves. All robots send their neighbours their values (`Ok`), then their possible improvements
(`Improve`); among neighbours only the one with the largest improvement moves. If no neighbour can improve, the robot's
violated constraints weigh more from then on. The waves, and so the result, do not depend on the messages' delays.

Incomplete: it proves nothing, and on a problem without a solution it continues until a limit is reached. Termination: a
counter of c means that no robot within distance c has a violated constraint. Distances are less than the number of
robots, and when one robot's counter reaches this number, so do those of all connected robots, in the same wave. So all
robots stop sending at once, without further messages.

Choices that the paper leaves open: constraints may be n-ary (all robots of a scope are neighbours, and each weighs the
violation for itself); a weight belongs to a nogood, that is to a constraint and the values that violate it; each robot
starts with the first value of its domain, and of equally good values the first is chosen, without random numbers; the
number of robots replaces the unknown diameter; a robot whose domain is empty gives up at once.
"""

from __future__ import annotations

from typing import assert_never, cast

from robochoc import Verdict
from robochoc.protocols import Act, LocalProblem, Message, Performative, PriorityOrder, Protocol, Traits, Value, Wording
from robochoc.system.plain_text import counted

Nogood = tuple[int, str, tuple[tuple[str, Value], ...]]
"""The place of this robot's value, the constraint that it violates, and the values of others in that constraint."""


class Ok(Message, frozen=True):
    """The sender's value (`ok?`)."""

    value: Value

    def in_words(self, words: Wording) -> str:
        """Return the sender's sentence."""
        return f"{words.own_value(self.value)} in this wave"


class Improve(Message, frozen=True):
    """The sender's possible improvement, its present cost, and its termination counter (`improve`)."""

    my_improve: int
    current_eval: int
    my_termination_counter: int

    act = Act(Performative.PROPOSE, "the neighbour with the largest improvement moves")

    def in_words(self, _: Wording) -> str:
        """Return the sender's sentence."""
        weight = counted(self.current_eval, "weighted violation")
        return f"I have {weight}, and could do with {self.my_improve} less"


class Breakout(Protocol):
    """One agent of distributed breakout. State: as in the paper, and the messages of both waves received so far."""

    messages = Ok | Improve
    traits = Traits(
        paper="Yokoo & Hirayama 1996, 2005", complete=False, shared_scopes=True, privacy="constraints among others"
    )

    def __init__(self, problem: LocalProblem, order: PriorityOrder) -> None:
        super().__init__(problem, order)
        self.max_distance = len(order.names) - 1
        self.agent_view: dict[str, Value] = {}
        self.weights: dict[Nogood, int] = {}
        self.my_termination_counter = 0
        self.my_improve = 0
        self.current_value = self.new_value = 0
        self.can_move = self.quasi_local_minimum = self.consistent = False
        self._waits_for_ok = True
        self._oks: dict[str, Value] = {}
        self._improves: dict[str, Improve] = {}

    def start(self) -> None:
        """Choose the first value, and send it."""
        if self.problem.values:
            self._choose(0)
        else:
            self.conclude(Verdict.UNKNOWN)

    def receive(self, sender: str, message: Message) -> None:
        """Store the message; a complete wave is answered by the next one.

        A neighbour may be ahead by one message, so each message is stored until its wave.
        """
        if self.verdict is not None:
            return
        match cast("Ok | Improve", message):
            case Ok(value):
                self._oks[sender] = value
            case Improve() as improve:
                self._improves[sender] = improve
            case never:
                assert_never(never)
        if self._waits_for_ok and len(self._oks) == len(self.problem.neighbours):
            self._send_improve()
        if not self._waits_for_ok and len(self._improves) == len(self.problem.neighbours):
            self._send_ok()

    def _send_improve(self) -> None:
        """All neighbours' values are known: find this robot's best value, and send the improvement."""
        self.agent_view, self._oks, self._waits_for_ok = self._oks, {}, False
        current_eval = best = self._eval(self.current_value)
        self.consistent = current_eval == 0
        if not self.consistent:
            self.my_termination_counter = 0
            best, self.new_value = min((self._eval(index), index) for index in range(len(self.problem.values)))
        self.my_improve = current_eval - best
        self.can_move = self.my_improve > 0
        self.quasi_local_minimum = self.my_improve == 0
        self._send_to_all(Improve(self.my_improve, current_eval, self.my_termination_counter))

    def _send_ok(self) -> None:
        """All neighbours' improvements are known: finish, make violations weigh more, or move."""
        for neighbour, improve in self._improves.items():
            self._compare(neighbour, improve)
        self._improves, self._waits_for_ok = {}, True
        if self.consistent:
            self.my_termination_counter += 1
            if self.my_termination_counter >= self.max_distance:
                return
        if self.quasi_local_minimum:
            for nogood in self._violations(self.current_value):
                self.weights[nogood] = self.weights.get(nogood, 1) + 1
        self._choose(self.new_value if self.can_move else self.current_value)

    def _compare(self, neighbour: str, improve: Improve) -> None:
        """Let the robot with the largest improvement move; of equal ones the first in the order."""
        self.my_termination_counter = min(self.my_termination_counter, improve.my_termination_counter)
        if improve.my_improve > self.my_improve:
            self.can_move = self.quasi_local_minimum = False
        elif improve.my_improve == self.my_improve and self.order.rank[neighbour] < self.order.rank[self.problem.agent]:
            self.can_move = False
        if improve.current_eval > 0:
            self.consistent = False

    def _eval(self, index: int) -> int:
        """Return the sum of the weights of all violations by the value at `index`."""
        return sum(self.weights.get(nogood, 1) for nogood in self._violations(index))

    def _violations(self, index: int) -> list[Nogood]:
        conflicts = self.problem.conflicts(index, self.agent_view)
        return [(index, key, tuple(conflict.items())) for conflict, key in conflicts]

    def _choose(self, index: int) -> None:
        """Choose the value at `index`, which may be the present one, and send it to all neighbours (`ok?`)."""
        self.value = self.current_value = index
        self._send_to_all(Ok(self.problem.values[index]))

    def _send_to_all(self, message: Message) -> None:
        for neighbour in self.problem.neighbours:
            self.send(neighbour, message)
