"""Soft arc consistency in one robot: costs of binary constraints move to the values of their ends, none gets lost.

One robot of a pseudo-tree holds its unary costs, and the binary constraints with robots above it: its arcs. The
operations are those of Larrosa and Schiex, "In the quest of the best form of local consistency for weighted CSP", IJCAI
2003; each leaves the cost of every assignment as it is:

- *projection* moves what a row or a column charges at least to the value that it belongs to;
- *extension* moves unary costs into an arc, so that more can be projected out of it at the other end.

Infinite costs are moved, too, and never subtracted from each other. What is infinite for good is left out from then on:
an own value that no solution has, and a value above with which no own value goes (`up` is infinite there).
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from robochoc.model.problem import INFINITE
from robochoc.protocols.optimization.bounding_messages import Number

Row = list[Number]


class SoftArc:
    """The binary constraints with one robot above.

    Attributes:
        costs: What is left in the arc: a row for each value of that robot, with an entry for each own value.
        up: For each row, what was moved to that robot's value. Infinite: no own value goes with it.
        put_in: For each own value, what was moved into the arc, less what was moved out of it to that value.
    """

    def __init__(self, costs: Sequence[Row], size: int) -> None:
        self.costs = costs
        self.up: Row = [0] * len(costs)
        self.put_in: Row = [0] * size

    def project_up(self, own: Row, *, extending: bool) -> bool:
        """Move costs to the values above; return whether there were any.

        With `extending`, as much of the `own` unary costs goes with them as can: full arc consistency of the robot
        above.
        """
        live = _live(own)
        gains = [min([(own[i] if extending else 0) + row[i] for i in live], default=INFINITE) for row in self.costs]
        rows = [(row, gain) for row, gain in self._rows(gains) if gain < INFINITE]
        if extending:
            self._extend(own, rows)
        for row, gain in rows:
            for index in live:
                row[index] -= gain
        moved = any(gain for _, gain in self._rows(gains))
        self.up = [up + gain for up, gain in zip(self.up, gains, strict=True)]
        return moved

    def project_down(self, own: Row) -> bool:
        """Move what each own value costs at least, whatever value is above, to the `own` costs; return if any."""
        rows = [row for row, _ in self._rows(self.up)]
        moved = False
        for index in _live(own):
            least = min([row[index] for row in rows], default=INFINITE)
            moved = moved or least > 0
            own[index] += least
            if 0 < least < INFINITE:
                self.put_in[index] -= least
                for row in rows:
                    row[index] -= least
        return moved

    def move_least(self, own: Row) -> None:
        """Move what the cheapest of the `own` values costs to all values above."""
        least = min(own)
        self.up = [up + least for up in self.up]
        for index in _live(own):
            own[index] -= least
            self.put_in[index] += least

    def _extend(self, own: Row, rows: Sequence[tuple[Row, Number]]) -> None:
        """Move so much of the `own` costs into the arc that each of `rows` can give what it is to gain."""
        for index in _live(own):
            needed = max([gain - row[index] for row, gain in rows], default=0)
            if needed > 0:
                own[index] -= needed
                self.put_in[index] += needed
                for row, _ in rows:
                    row[index] += needed

    def _rows(self, numbers: Row) -> Iterator[tuple[Row, Number]]:
        """Yield each row that is not ruled out yet, with its number."""
        for row, up, number in zip(self.costs, self.up, numbers, strict=True):
            if up < INFINITE:
                yield row, number


def move_costs(own: Row, arcs: Sequence[SoftArc], *, extending: bool) -> None:
    """Make `arcs` soft arc consistent; of the `own` costs remain what could not be moved up.

    Args:
        own: What each own value costs by itself, with what robots below have moved to it. It is changed.
        arcs: The arcs, that of the parent first: it gets what every own value costs at least (C_phi).
        extending: Full directional arc consistency (FDAC*): unary costs are moved up. Otherwise arc consistency (AC*).
    """
    going_on = bool(arcs)
    while going_on:
        up = [arc.project_up(own, extending=extending) for arc in arcs]
        down = [arc.project_down(own) for arc in arcs]
        going_on = any(up) or any(down)
    if arcs and not extending:
        arcs[0].move_least(own)


def _live(own: Row) -> list[int]:
    """Return the places of the values that a solution may have."""
    return [index for index, cost in enumerate(own) if cost < INFINITE]
