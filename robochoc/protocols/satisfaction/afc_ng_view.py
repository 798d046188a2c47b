"""The agent view of AFC-ng, a mapping of the current partial assignment; separate, as mypyc cannot compile its base."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from itertools import islice

from robochoc.protocols.message import Value
from robochoc.protocols.satisfaction.afc_ng_messages import Assignment


class AgentView(Mapping[str, Value]):
    """The values in `assignments`, by robot: they belong to the first robots in `line`, whose indices are `places`.

    All robots in a process share `line`; `assignments` is the tuple in the received message itself.
    """

    def __init__(self, line: Sequence[str], places: Mapping[str, int]) -> None:
        self.assignments: tuple[Assignment, ...] = ()
        self._line = line
        self._places = places

    def __getitem__(self, agent: str) -> Value:
        place = self._places[agent]
        if place >= len(self.assignments):
            raise KeyError(agent)
        return self.assignments[place][0]

    def __iter__(self) -> Iterator[str]:
        return islice(self._line, len(self.assignments))

    def __len__(self) -> int:
        return len(self.assignments)
