"""The values that a robot has told in the middle of a search: the master may say that they count."""

from __future__ import annotations

from bisect import bisect_right

from robochoc.communication.network.control_messages import Recall
from robochoc.communication.network.framing import FrameRefusedError
from robochoc.protocols.findings import Trail
from robochoc.protocols.protocol import Protocol
from robochoc.solver.domain import CompiledDomain

_Values = dict[str, int]


class Recalled:
    """The values that a robot has told, by the numbers of the snapshots: the last ones, and those that it is to keep.

    Attributes:
        adopted: The values that are the robot's decision until it hears otherwise; None: there are none.
    """

    def __init__(self) -> None:
        self.adopted: _Values | None = None
        self._last: tuple[int, _Values] = (0, {})
        self._kept: tuple[int, _Values] = (0, {})

    @property
    def is_used(self) -> bool:
        """Return whether the robot was ever asked for a snapshot."""
        return self._last[0] > 0

    def note(self, number: int, values: _Values) -> None:
        """Keep `values` until the next snapshot."""
        self._last = (number, values)

    def at(self, number: int) -> _Values:
        """Return the values of a snapshot. Raises `FrameRefusedError` if they are not known, or no more."""
        for known, values in (self._last, self._kept):
            if known == number:
                return values
        raise FrameRefusedError(f"it is about snapshot {number}, which is not known")

    def adopt(self, number: int, *, published: bool) -> None:
        """Keep the values of a snapshot (0: none), and decide on them if they are `published`.

        Raises `FrameRefusedError` if they are not known.
        """
        values = self.at(number) if number else None
        if values is not None:
            self._kept = (number, values)
        if published:
            self.adopted = values


def values_asked_for(order: Recall, protocol: Protocol, domain: CompiledDomain) -> _Values:
    """Return the values of the robot's variables that `order` asks for. Empty: it has none, or withdraws."""
    if order.value is not None:
        return domain.behind(order.value)
    trail = protocol.findings.trail
    if order.cycle is None or trail is None:
        return protocol.assignment
    place = _place_in(trail, order.cycle)
    return {} if place is None else domain.solution(place)


def _place_in(trail: Trail, cycle: int) -> int | None:
    """Return the place of the value that the robot had in `cycle`; None if it had none yet."""
    after = bisect_right(trail.entries, cycle, key=lambda entry: entry[0])
    return trail.entries[after - 1][1] if after else None
