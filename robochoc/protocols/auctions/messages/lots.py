"""How messages of auctions name tasks."""

from __future__ import annotations

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
