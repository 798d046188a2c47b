"""Task allocation: the tasks, their value to a robot, and the base class of the auction protocols.

A *task* is done by at most one robot (`solver/exclusions.py`). A robot's *bundle* is the set of tasks that it does; of
the robot's values with the same tasks only the cheapest counts. A task's *marginal score*, given the bundle, is the
robot's cost without the task minus its cost with the task: in maximised problems, the gain.

If the marginal score of a task never rises as the bundle grows, scores have *diminishing marginal gain* (DMG). If it
may rise, as with synergies, a bid is never higher than the robot's last bid in the bundle (*bid warping*: Johnson,
Choi, Ponda, How, "Allowing non-submodular score functions in distributed task allocation", CDC 2012). With DMG this
changes nothing.
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable, Collection, Mapping
from typing import NamedTuple

from robochoc.model.outcome import Verdict
from robochoc.model.problem import INFINITE
from robochoc.protocols.disclosure import Pays, Proof, Reception, SomeValuePays, can_take
from robochoc.protocols.order import PriorityOrder
from robochoc.protocols.protocol import Protocol
from robochoc.protocols.wording import Wording
from robochoc.solver.encoding import Cost
from robochoc.solver.errors import UnsupportedError
from robochoc.solver.local_problem import LocalProblem
from robochoc.system.plain_text import listed

Lot = tuple[int, int]
"""A robot's name for a task: the index of an interface variable, and its value.

The receiver knows which of its own tasks this value excludes.
"""


def lot_in_words(words: Wording, robot: str, lot: Lot) -> str:
    """Return the name of a task of `robot`: `task V1 = 3`."""
    place, value = lot
    size = len(words.interfaces.get(robot, ()))
    if not 0 <= place < size:
        return f"task ({place}, {value}) of {robot}"
    return f"task {listed(words.facts(robot, [value if at == place else None for at in range(size)]))}"


def proofs_of_task(robot: str, lot: Lot, reception: Reception) -> list[Proof]:
    """Return the proofs given by the fact that `robot` does the task that it calls `lot`: it can take that value.

    For a robot with several variables, the other values are not known: this proves nothing about a whole value.
    """
    place, value = lot
    if robot == reception.receiver or place != 0 or reception.width(robot) != 1:
        return []
    return [can_take(robot, (value,))]


def proofs_of_bid(robot: str, lot: Lot, amount: int, reception: Reception) -> list[Proof]:
    """Return the proofs given by a bid of `robot` for the task that it calls `lot`.

    The bid is the cost of its value for the task minus the cost of the cheapest value without a task, which is at most
    the largest cost. A robot with one variable has at most one task, so no other bid has been subtracted.
    """
    does = proofs_of_task(robot, lot, reception)
    if not does:
        return proofs_of_next_bid(robot, amount, reception)
    return [Pays(robot, (lot[1],), {}, 0, reception.max_cost - amount)]


def proofs_of_next_bid(robot: str, amount: int, reception: Reception) -> list[Proof]:
    """Return the proofs given by a bid of `robot` for an unnamed task: one value is cheaper than another by the amount.

    This also holds if the robot has other tasks: the bid is never above the value of the next task.
    """
    return [SomeValuePays(robot, {}, reception.max_cost - amount)] if amount > 0 else []


NO_LIMIT = 2**63 - 1
_NONE: Mapping[Lot, int] = {}


class Offer(NamedTuple):
    """A bid of `amount` for `task`. `score` is the marginal score, before the bid is warped."""

    task: int
    amount: int
    score: int


class Market:
    """The tasks of one robot, by number.

    Attributes:
        rivals: For each task, the other robots that can do it, in priority order.
        shared: For each rival, the tasks that both can do.
        congestion: For each task, the cost of each pair of robots that do it; infinite if at most one robot may do it.
        idle: The index of this robot's cheapest value without a task. None if it has no value at all.

    Raises:
        UnsupportedError: if the robot's constraints do not describe a task allocation, or it has no value without a
            task.
    """

    def __init__(self, problem: LocalProblem, *, congestion: bool = False) -> None:
        tasks = problem.tasks(congestion=congestion)
        self._own = [task.own for task in tasks]
        self._charges = problem.charges
        self._places = self._cheapest(problem)
        self._scored: dict[frozenset[int], list[tuple[int, int]]] = {}
        same: dict[tuple[str, ...], tuple[str, ...]] = {}
        names = [tuple(task.others) for task in tasks]
        self.rivals = [same.setdefault(one, one) for one in names]
        self.congestion = [task.cost for task in tasks]
        self.shared: dict[str, list[int]] = {}
        named: dict[str, dict[Lot, int]] = {}
        for number, task in enumerate(tasks):
            for robot, choices in task.others.items():
                self.shared.setdefault(robot, []).append(number)
                named.setdefault(robot, {}).update(dict.fromkeys(choices, number))
        alike: dict[tuple[tuple[Lot, int], ...], dict[Lot, int]] = {}
        self._named = {robot: alike.setdefault(tuple(numbers.items()), numbers) for robot, numbers in named.items()}
        self._lots = [self._lot(problem, number) for number in range(len(self._own))]
        self.idle = self._places.get(frozenset())
        if self.idle is None and self._places:
            raise UnsupportedError(
                f"{problem.agent} has no value that stands for no task, but may win no task: add such a value"
            )

    def _cheapest(self, problem: LocalProblem) -> dict[frozenset[int], int]:
        """Return the index of the cheapest value for each set of tasks that the robot can do together."""
        task_of = {choice: number for number, own in enumerate(self._own) for choice in own}
        found: dict[frozenset[int], int] = {}
        for index, value in enumerate(problem.values):
            chosen = [task_of.get((place, part)) for place, part in enumerate(value) if part is not None]
            bundle = frozenset(number for number in chosen if number is not None)
            least = self._charges[found[bundle]] if bundle in found else INFINITE
            if self._charges[index] < least:
                found[bundle] = index
        return found

    def _lot(self, problem: LocalProblem, task: int) -> Lot:
        """Return how this robot does `task` if it does nothing else; if that is impossible, the first way."""
        index = self._places.get(frozenset((task,)))
        value = () if index is None else problem.values[index]
        own = self._own[task]
        return next((choice for choice in own if choice[0] < len(value) and value[choice[0]] == choice[1]), own[0])

    def lot(self, task: int) -> Lot:
        """Return this robot's name for `task`."""
        return self._lots[task]

    def task(self, robot: str, lot: Lot) -> int:
        """Return the task that `robot` names `lot`.

        Raises:
            ValueError: if this robot and `robot` share no such task.
        """
        number = self.names(robot, lot)
        if number is None:
            raise ValueError(f"{robot} names a task that it does not share: {lot}")
        return number

    def score(self, task: int) -> int | None:
        """Return the score of `task` for a robot that does nothing else; None if it cannot do the task."""
        bundle = frozenset((task,))
        return int(self._charge(frozenset()) - self._charge(bundle)) if bundle in self._places else None

    def names(self, robot: str, lot: Lot) -> int | None:
        """Return the task that `robot` names `lot`; None if this robot cannot do it."""
        return self._named.get(robot, _NONE).get(lot)

    def place(self, bundle: Collection[int]) -> int:
        """Return the index of this robot's cheapest value with the tasks in `bundle`; there must be one."""
        return self._places[frozenset(bundle)]

    def best(self, bundle: Collection[int], limit: int, admits: Callable[[int, int], bool]) -> Offer | None:
        """Return the best offer for a task besides `bundle`; None if no task has a positive score.

        Args:
            bundle: The tasks that the robot has.
            limit: The highest bid allowed.
            admits: Returns whether a bid of an amount for a task is acceptable.
        """
        for task, score in self._scores(frozenset(bundle)):
            amount = min(score, limit)
            if amount > 0 and admits(task, amount):
                return Offer(task, amount, score)
        return None

    def _scores(self, bundle: frozenset[int]) -> list[tuple[int, int]]:
        """Return the tasks that can be added to `bundle`, with their resulting scores, the best first."""
        if bundle not in self._scored:
            before = self._charge(bundle)
            more = [(task, bundle | {task}) for task in range(len(self._own)) if task not in bundle]
            scores = [(task, int(before - self._charge(both))) for task, both in more if both in self._places]
            self._scored[bundle] = sorted([one for one in scores if one[1] > 0], key=lambda one: -one[1])
        return self._scored[bundle]

    def _charge(self, bundle: frozenset[int]) -> Cost:
        return self._charges[self._places[bundle]]


class Auction(Protocol):
    """One agent of an auction. State: its `market`, and the `bundle`, its tasks in the order of their addition."""

    def __init__(self, problem: LocalProblem, order: PriorityOrder) -> None:
        super().__init__(problem, order)
        self.market = Market(problem, congestion=self.traits.congestion)
        self.bundle: list[int] = []

    @abstractmethod
    def start_auction(self) -> None:
        """Start to bid; called for a robot that has values and neighbours."""

    def start(self) -> None:
        """Start; a robot without values ends the search, a robot without rivals chooses its cheapest value."""
        if self.market.idle is None:
            self.conclude(Verdict.NO_SOLUTION)
        elif not self.market.shared:
            self.value = self.problem.charges.index(min(self.problem.charges))
        else:
            self.choose_bundle()
            self.start_auction()

    def choose_bundle(self) -> None:
        """Choose the value with the tasks in the bundle."""
        self.value = self.market.place(self.bundle)

    def refuse_winner(self, task: int, winner: str, amount: int) -> None:
        """Raise `ValueError` for a bid for `task` that no robot can have made."""
        if winner != self.problem.agent and winner not in self.market.rivals[task]:
            raise ValueError(f"{winner} cannot have won a task that it does not share")
        if amount <= 0:
            raise ValueError(f"{winner} cannot have won a task for {amount}")

    def outbids(self, robot: str, amount: int, other: str | None, most: int) -> bool:
        """Return whether a bid of `amount` by `robot` beats the bid `most` by `other`; None: there is no other bid.

        If bids are equal, the robot with higher priority wins.
        """
        if other is None:
            return True
        rank = self.order.rank
        return (amount, -rank[robot]) > (most, -rank[other])
