"""Distributed breakout.

Yokoo, Hirayama: "Distributed breakout algorithm for solving distributed constraint satisfaction problems", ICMAS
1996; also Hirayama, Yokoo: "The distributed breakout algorithms", AIJ 161 (2005). The methods and the state bear the
names of its procedures:

    send_improve   `_send_improve`      wait_ok? mode, wait_improve? mode   `_waits_for_ok`
    send_ok        `_send_ok`           weights of constraint violations    `weights`

Local search in waves. All robots tell their neighbours their values (`Ok`), then by how much each could improve
(`Improve`); of neighbours only the one that improves most moves. Where nobody can improve, what is violated there
weighs more from then on. Whatever the messages' delays, the waves are the same, and so is the result.

Not complete: it proves nothing, and on a problem without a solution it goes on until a limit is reached. How the robots
know that they have finished: a termination counter of c says that all robots within distance c hold no violated
constraint. Distances are less than the number of robots, and when one robot's counter has come that far, so have those
of all robots that it is connected with, in the same wave. So all fall silent at once, and nobody has to be told.

Five things the paper leaves open: constraints may be n-ary (all robots of a scope are neighbours, and each weighs the
violation for itself); a weight belongs to a nogood, that is to a constraint and the values that violate it; the first
value of the domain is where each robot begins, and of equally good values the first is taken, for a protocol draws no
lots; the number of robots stands for the diameter that nobody knows; a robot whose domain is empty gives up at once.
"""

from __future__ import annotations

from typing import assert_never, cast

from robochoc.model.outcome import Verdict
from robochoc.protocols.acts import Act, Performative
from robochoc.protocols.message import Message, Value
from robochoc.protocols.order import PriorityOrder
from robochoc.protocols.protocol import Protocol
from robochoc.protocols.traits import Traits
from robochoc.protocols.wording import Wording
from robochoc.solver.local_problem import LocalProblem
from robochoc.system.plain_text import counted

Nogood = tuple[int, str, tuple[tuple[str, Value], ...]]
"""The own value's place, the constraint that it violates, and what that constraint sees of the others."""


class Ok(Message, frozen=True):
    """The sender's value (`ok?`)."""

    value: Value

    def in_words(self, words: Wording) -> str:
        """Return what the sender says."""
        return f"{words.own_value(self.value)} in this wave"


class Improve(Message, frozen=True):
    """By how much the sender could improve, what it pays now, and its termination counter (`improve`)."""

    my_improve: int
    current_eval: int
    my_termination_counter: int

    act = Act(Performative.PROPOSE, "of neighbours, the one that improves most is to move")

    def in_words(self, _: Wording) -> str:
        """Return what the sender says."""
        weight = counted(self.current_eval, "weighted violation")
        return f"I have {weight}, and could do with {self.my_improve} less"


class Breakout(Protocol):
    """One agent of distributed breakout. State: as the paper names it, and what has come of the two waves so far."""

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
        """Take the first value, and tell it."""
        if self.problem.values:
            self._take(0)
        else:
            self.conclude(Verdict.UNKNOWN)

    def receive(self, sender: str, message: Message) -> None:
        """Dispatch on the message's type; a wave that is complete is answered by the next one.

        A neighbour may be ahead by one message, so each is kept until its wave's turn has come.
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
        """All neighbours' values are known: find the best own one, and say by how much it would be better."""
        self.agent_view, self._oks, self._waits_for_ok = self._oks, {}, False
        current_eval = best = self._eval(self.current_value)
        self.consistent = current_eval == 0
        if not self.consistent:
            self.my_termination_counter = 0
            best, self.new_value = min((self._eval(index), index) for index in range(len(self.problem.values)))
        self.my_improve = current_eval - best
        self.can_move = self.my_improve > 0
        self.quasi_local_minimum = self.my_improve == 0
        self._tell(Improve(self.my_improve, current_eval, self.my_termination_counter))

    def _send_ok(self) -> None:
        """All neighbours' improvements are known: finish, make violations weigh more, or move."""
        for neighbour, told in self._improves.items():
            self._compare(neighbour, told)
        self._improves, self._waits_for_ok = {}, True
        if self.consistent:
            self.my_termination_counter += 1
            if self.my_termination_counter >= self.max_distance:
                return
        if self.quasi_local_minimum:
            for nogood in self._violations(self.current_value):
                self.weights[nogood] = self.weights.get(nogood, 1) + 1
        self._take(self.new_value if self.can_move else self.current_value)

    def _compare(self, neighbour: str, told: Improve) -> None:
        """Who improves most moves, and between equals the one that comes first in the order."""
        self.my_termination_counter = min(self.my_termination_counter, told.my_termination_counter)
        if told.my_improve > self.my_improve:
            self.can_move = self.quasi_local_minimum = False
        elif told.my_improve == self.my_improve and self.order.rank[neighbour] < self.order.rank[self.problem.agent]:
            self.can_move = False
        if told.current_eval > 0:
            self.consistent = False

    def _eval(self, index: int) -> int:
        """The sum of the weights of all violations by the value at `index`."""
        return sum(self.weights.get(nogood, 1) for nogood in self._violations(index))

    def _violations(self, index: int) -> list[Nogood]:
        conflicts = self.problem.conflicts(index, self.agent_view)
        return [(index, key, tuple(conflict.items())) for conflict, key in conflicts]

    def _take(self, index: int) -> None:
        """Take the value at `index`, which may be the present one, and tell all neighbours (`ok?`)."""
        self.value = self.current_value = index
        self._tell(Ok(self.problem.values[index]))

    def _tell(self, message: Message) -> None:
        for neighbour in self.problem.neighbours:
            self.send(neighbour, message)
