"""The 3D scene beside the page: the drones on the ground, and where each goes by what its robot decides.

A drone hovers at the place that its robot's decision says, and stands on its ground place as long as there is none.
Lengths are in cells, as in `layout`.
"""

from __future__ import annotations

import base64
from collections.abc import Iterator, Mapping
from contextlib import suppress
from itertools import islice
from typing import Any

import msgspec

from robochoc.flight.crafts import Craft, craft_of_variable, crafts_of, possible_crafts
from robochoc.flight.layout import Layout, Point, layout_of
from robochoc.formats import InvalidInputError, robot_in
from robochoc.model.priorities import natural_key
from robochoc.model.problem import Assignment, Robot
from robochoc.sniffer.page_data import BadRequestError
from robochoc.sniffer.trace import Trace
from robochoc.view.drawing import path_of, still
from robochoc.view.scene import DrawnDrone, Scene

_MOST_DRONES = 2_000
"""The maximum that browsers animate smoothly and readers can distinguish."""
_MOST_PLACES = 1_000
"""Of all robots: when so many places are known, what is decided need not be looked at for the box to hold it."""

Move = tuple[int, int, float, float, float]
"""From a step on, a drone (by its number) is at x, y, z."""


def whole_scene(trace: Trace) -> bytes:
    """Return the scene of a complete trace as JSON, from the robots' files in the trace."""
    stage = TraceScene(trace, robots_given(trace))
    return msgspec.json.encode(stage.answer() if stage else None)


def robots_given(trace: Trace) -> dict[str, Robot]:
    """Return the robots given in the last run, without those whose file is invalid."""
    robots = {}
    for name, file in (trace.runs[-1].files if trace.runs else {}).items():
        with suppress(InvalidInputError, UnicodeEncodeError):
            robots[name] = robot_in(file.encode(), name)
    return robots


class TraceScene:
    """The drones of one trace. `robots` are those with known files; for others, only decisions are known.

    The box contains all possible places of known robots, and the places that others have taken so far.
    """

    def __init__(self, trace: Trace, robots: Mapping[str, Robot]) -> None:
        self._trace = trace
        self._robots = {name: robots.get(name) for name in sorted({*trace.robots, *robots}, key=natural_key)}
        crew = [(name, craft) for name in self._robots for craft in self._crafts(name, {})]
        crew = crew if len(crew) <= _MOST_DRONES else []
        order = sorted(range(len(crew)), key=lambda place: (natural_key(crew[place][1].name), crew[place][1].name))
        self._owners = [crew[place][0] for place in order]
        crafts = [crew[place][1] for place in order]
        self._field: Layout = layout_of(crafts, self._others())
        self._drones: dict[str, list[int]] = {}
        for number, owner in enumerate(self._owners):
            self._drones.setdefault(owner, []).append(number)
        self._names = [craft.name for craft in crafts]

    def __bool__(self) -> bool:
        """Return whether there is anything to show."""
        return bool(self._owners)

    def answer(self, first: int = 0) -> dict[str, Any]:
        """Return the page's data, with the moves of the decisions from `first`; JSON-compatible."""
        upto = len(self._trace.decisions)
        if first > upto:
            raise BadRequestError(f"there are {upto} decisions")
        commands = self._commands() if self and not first else []
        return {
            "commands": [base64.b64encode(command).decode() for command in commands],
            "drones": [
                {"robot": owner, "path": path_of(number, name), "ground": home}
                for number, (owner, name, home) in enumerate(
                    zip(self._owners, self._names, self._field.homes, strict=True)
                )
            ],
            "moves": [*self.moves(first, upto)],
            "decisions": upto,
        }

    def moves(self, first: int, end: int) -> Iterator[Move]:
        """Yield the moves of the drones for the decisions from `first` to before `end`."""
        trace = self._trace
        opened = [run.step for run in trace.runs[1:] if run.epoch is None]
        before = trace.decisions[first - 1][0] if first else -1
        opened = [step for step in opened if step > before]
        for step, values in islice(trace.decisions, first, end):
            while opened and opened[0] <= step:
                yield from ((opened[0], number, *home) for number, home in enumerate(self._field.homes))
                del opened[0]
            robot = trace.robots[trace.steps.robot[step]]
            yield from ((step, number, *point) for number, point in self._places(robot, values))

    def _commands(self) -> list[bytes]:
        homes = zip(self._names, self._field.homes, strict=True)
        return still(
            Scene("", (), tuple(DrawnDrone(name, round(home[0]), home) for name, home in homes), self._field.axes)
        )

    def _crafts(self, name: str, values: Assignment) -> list[Craft]:
        robot = self._robots[name]
        if robot is not None:
            return crafts_of(robot, values)
        return [craft_of_variable(variable, values) for variable in self._trace.variables.get(name, ())]

    def _places(self, name: str, values: Assignment) -> Iterator[tuple[int, Point]]:
        """Yield the places of a robot's drones for its decision."""
        numbers = self._drones.get(name)
        if not numbers:
            return
        crafts = {craft.name: craft for craft in self._crafts(name, values)}
        rows, columns, levels = self._field.axes
        for number in numbers:
            home = self._field.homes[number]
            craft = crafts.get(self._names[number])
            if craft is None or craft.level is None:
                yield number, home
            elif craft.cell is None:
                yield number, (home[0], home[1], levels.at(craft.level))
            else:
                yield number, (rows.at(craft.cell[0]), columns.at(craft.cell[1]), levels.at(craft.level))

    def _others(self) -> Iterator[Craft]:
        """Yield the possible and past places of drones."""
        seen: set[Craft] = set()
        for robot in self._robots.values():
            if robot is not None:
                seen.update(possible_crafts(robot))
        known = {name for name, robot in self._robots.items() if robot is not None}
        for step, values in self._trace.decisions:
            name = self._trace.robots[self._trace.steps.robot[step]]
            if name not in known or len(seen) < _MOST_PLACES:
                seen.update(self._crafts(name, values))
        yield from seen
