"""How messages of auctions name tasks."""

from __future__ import annotations

from robochoc.model.disclosure import Hearing, Pays, Proof, SomeValuePays, can_take
from robochoc.model.wording import Wording, listed

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
