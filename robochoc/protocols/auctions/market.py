"""The common part of task allocation: what is for sale, what it is worth to a robot, and the base of their protocols.

A *task* is something that is done by one robot at most (`solver/exclusions.py`). A robot's *bundle* is the set of tasks
that it takes; of the robot's values with the same tasks only the cheapest counts. A task is worth to a robot what its
cost is less with the task than without, given the bundle: in maximised problems, what is gained. That is its *marginal
score*.

Where the marginal score of a task never rises as the bundle grows, scores have *diminishing marginal gain* (DMG). Where
they may rise, as with synergies, a bid is never higher than the robot's last one in the bundle (*bid warping*: Johnson,
Choi, Ponda, How, "Allowing non-submodular score functions in distributed task allocation", CDC 2012). With DMG this
changes nothing.
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable, Collection, Mapping
from typing import NamedTuple

from robochoc.model.outcome import Verdict
from robochoc.model.problem import INFINITE
from robochoc.protocols.disclosure import Hearing, Pays, Proof, SomeValuePays, can_take
from robochoc.protocols.order import PriorityOrder
from robochoc.protocols.protocol import Protocol
from robochoc.protocols.wording import Wording
from robochoc.solver.compiled import LocalProblem
from robochoc.solver.encoding import Cost, UnsupportedError
from robochoc.system.plain_text import listed

Lot = tuple[int, int]
"""A task as a robot names it, by its own choice: the place of an interface variable, and its value.

The receiver knows which of its own tasks that excludes.
"""


def lot_in_words(words: Wording, robot: str, lot: Lot) -> str:
    """Return what `robot` calls a task: `task V1 = 3`."""
    place, value = lot
    size = len(words.interfaces.get(robot, ()))
    if not 0 <= place < size:
        return f"task ({place}, {value}) of {robot}"
    return f"task {listed(words.facts(robot, [value if at == place else None for at in range(size)]))}"


def does_proves(robot: str, lot: Lot, hearing: Hearing) -> list[Proof]:
    """Return what it proves that `robot` does a task which it calls `lot`: it can take that value.

    A robot of several variables does not say what the others of them have: that proves nothing of a whole value.
    """
    place, value = lot
    if robot == hearing.receiver or place != 0 or hearing.width(robot) != 1:
        return []
    return [can_take(robot, (value,))]


def bid_proves(robot: str, lot: Lot, amount: int, hearing: Hearing) -> list[Proof]:
    """Return what a bid of `robot` for the task that it calls `lot` proves.

    The bid is what its value for the task costs less than the cheapest one without a task, and that is not above the
    largest cost. A robot of one variable has one task at most, so no other bid has been subtracted.
    """
    does = does_proves(robot, lot, hearing)
    if not does:
        return next_proves(robot, amount, hearing)
    return [Pays(robot, (lot[1],), {}, 0, hearing.max_cost - amount)]


def next_proves(robot: str, amount: int, hearing: Hearing) -> list[Proof]:
    """Return what a bid of `robot` for a task that is not told proves: some value is by so much cheaper than another.

    So it is also where the robot has other tasks: the bid is never above what the next one is worth.
    """
    return [SomeValuePays(robot, {}, hearing.max_cost - amount)] if amount > 0 else []


NO_LIMIT = 2**63 - 1
_NONE: Mapping[Lot, int] = {}


class Offer(NamedTuple):
    """A bid: `amount` for `task`. `score` is the marginal score, before the bid is warped."""

    task: int
    amount: int
    score: int


class Market:
    """The tasks of one robot, by number.

    Attributes:
        rivals: For each task the other robots that can do it, in priority order.
        shared: For each rival, the tasks that both can do.
        congestion: For each task what each pair of robots that does it costs; infinite: one does it at most.
        idle: The place of the cheapest own value without a task. None: there is no value at all.

    Raises:
        UnsupportedError: when the robot's constraints allocate no tasks, or it cannot do without.
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
            raise UnsupportedError(f"{problem.agent} has no value without a task, and it may get none")

    def _cheapest(self, problem: LocalProblem) -> dict[frozenset[int], int]:
        """Return the place of the cheapest value for each set of tasks that the robot can do together."""
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
        """Return how this robot does `task` if it does nothing else; if it cannot, the first way."""
        index = self._places.get(frozenset((task,)))
        value = () if index is None else problem.values[index]
        own = self._own[task]
        return next((choice for choice in own if choice[0] < len(value) and value[choice[0]] == choice[1]), own[0])

    def lot(self, task: int) -> Lot:
        """Return how this robot names `task`."""
        return self._lots[task]

    def task(self, robot: str, lot: Lot) -> int:
        """Return the task that `robot` names `lot`.

        Raises:
            ValueError: when both can do no such task.
        """
        number = self.names(robot, lot)
        if number is None:
            raise ValueError(f"{robot} names a task that it does not share")
        return number

    def score(self, task: int) -> int | None:
        """Return what `task` is worth to a robot that does nothing else; None if it cannot do it."""
        bundle = frozenset((task,))
        return int(self._charge(frozenset()) - self._charge(bundle)) if bundle in self._places else None

    def names(self, robot: str, lot: Lot) -> int | None:
        """Return the task that `robot` names `lot`; None if this robot cannot do it."""
        return self._named.get(robot, _NONE).get(lot)

    def place(self, bundle: Collection[int]) -> int:
        """Return the place of the cheapest own value with the tasks of `bundle`, which there is."""
        return self._places[frozenset(bundle)]

    def best(self, bundle: Collection[int], limit: int, admits: Callable[[int, int], bool]) -> Offer | None:
        """Return the best offer for a task besides `bundle`; None if no task is worth more than nothing.

        Args:
            bundle: The tasks that the robot has.
            limit: No bid is higher.
            admits: Whether a bid of so much for a task will do.
        """
        for task, score in self._scores(frozenset(bundle)):
            amount = min(score, limit)
            if amount > 0 and admits(task, amount):
                return Offer(task, amount, score)
        return None

    def _scores(self, bundle: frozenset[int]) -> list[tuple[int, int]]:
        """Return the tasks that can be added to `bundle` and what they are worth then, the best first."""
        if bundle not in self._scored:
            before = self._charge(bundle)
            more = [(task, bundle | {task}) for task in range(len(self._own)) if task not in bundle]
            scores = [(task, int(before - self._charge(both))) for task, both in more if both in self._places]
            self._scored[bundle] = sorted([one for one in scores if one[1] > 0], key=lambda one: -one[1])
        return self._scored[bundle]

    def _charge(self, bundle: frozenset[int]) -> Cost:
        return self._charges[self._places[bundle]]


class Auction(Protocol):
    """One agent of an auction. State: its `market`, and the `bundle`, its tasks in the order in which it took them."""

    def __init__(self, problem: LocalProblem, order: PriorityOrder) -> None:
        super().__init__(problem, order)
        self.market = Market(problem, congestion=self.traits.congestion)
        self.bundle: list[int] = []

    @abstractmethod
    def start_auction(self) -> None:
        """Begin to bid, for a robot that has values, and neighbours."""

    def start(self) -> None:
        """Start; a robot without values ends the search, one without rivals takes its cheapest value."""
        if self.market.idle is None:
            self.conclude(Verdict.NO_SOLUTION)
        elif not self.market.shared:
            self.value = self.problem.charges.index(min(self.problem.charges))
        else:
            self.choose_bundle()
            self.start_auction()

    def choose_bundle(self) -> None:
        """Take the value with the tasks of the bundle."""
        self.value = self.market.place(self.bundle)

    def refuse_winner(self, task: int, winner: str, amount: int) -> None:
        """Raise `ValueError` for a bid that no robot can have made for `task`."""
        if winner != self.problem.agent and winner not in self.market.rivals[task]:
            raise ValueError(f"{winner} cannot have won a task that it does not share")
        if amount <= 0:
            raise ValueError(f"{winner} cannot have won a task for {amount}")

    def outbids(self, robot: str, amount: int, other: str | None, most: int) -> bool:
        """Return whether `robot` with a bid of `amount` comes before `other` with `most`; None: nobody has bid.

        Of equal bids that of the robot of higher priority counts.
        """
        if other is None:
            return True
        rank = self.order.rank
        return (amount, -rank[robot]) > (most, -rank[other])
