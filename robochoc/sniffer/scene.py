"""The page's 3D scene: drones move to the positions that their robots decide.

A drone hovers at the position of its robot's decision. Before a decision it stands at its home on the ground. Lengths
are measured in cells, as in `layout`.
"""

from __future__ import annotations

import base64
from collections.abc import Iterator, Mapping
from contextlib import suppress
from itertools import islice
from typing import Any

import msgspec

from robochoc.flight.crafts import Craft, craft_of_variable, crafts_of, possible_crafts
from robochoc.flight.layout import MissionLayout, Point, layout_of
from robochoc.formats import InvalidInputError, robot_in
from robochoc.model.priorities import natural_key
from robochoc.model.problem import Assignment, Robot
from robochoc.sniffer.page_data import BadRequestError
from robochoc.sniffer.trace import Trace
from robochoc.view.drawing import commands_at_home, path_of
from robochoc.view.scene import DrawnDrone, Scene

_MOST_DRONES = 2_000
"""The maximum number of drones that browsers can animate smoothly and readers can distinguish."""
_MOST_PLACES = 1_000
"""If more positions are known, the decisions of known robots are ignored when the size of the box is computed."""

Move = tuple[int, int, float, float, float]
"""A step, the number of a drone, and the drone's position x, y, z from that step on."""


def complete_scene(trace: Trace) -> bytes:
    """Return the scene for a complete trace as JSON, using the robots' files in the trace."""
    stage = TraceScene(trace, robots_given(trace))
    return msgspec.json.encode(stage.answer() if stage else None)


def robots_given(trace: Trace) -> dict[str, Robot]:
    """Return the robots in the last run by name, except those with an invalid file."""
    robots = {}
    for name, file in (trace.runs[-1].files if trace.runs else {}).items():
        with suppress(InvalidInputError, UnicodeEncodeError):
            robots[name] = robot_in(file.encode(), name)
    return robots


class TraceScene:
    """The drones in one trace. `robots`: the robots with known files. Of other robots, only decisions are known.

    The box contains all possible positions of known robots, and the past positions of other robots.
    """

    def __init__(self, trace: Trace, robots: Mapping[str, Robot]) -> None:
        self._trace = trace
        self._robots = {name: robots.get(name) for name in sorted({*trace.robots, *robots}, key=natural_key)}
        crew = [(name, craft) for name in self._robots for craft in self._crafts(name, {})]
        crew = crew if len(crew) <= _MOST_DRONES else []
        order = sorted(range(len(crew)), key=lambda place: (natural_key(crew[place][1].name), crew[place][1].name))
        self._owners = [crew[place][0] for place in order]
        crafts = [crew[place][1] for place in order]
        self._field: MissionLayout = layout_of(crafts, self._others())
        self._drones: dict[str, list[int]] = {}
        for number, owner in enumerate(self._owners):
            self._drones.setdefault(owner, []).append(number)
        self._names = [craft.name for craft in crafts]

    def __bool__(self) -> bool:
        """Return whether there is anything to show."""
        return bool(self._owners)

    def answer(self, first: int = 0) -> dict[str, Any]:
        """Return the page's data as JSON-compatible values, with the moves for the decisions from `first`."""
        upto = len(self._trace.decisions)
        if first > upto:
            raise BadRequestError(f"decision {first} does not exist; there are {upto}")
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
        """Yield the moves of the drones for the decisions from `first` up to, but not including, `end`."""
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
        return commands_at_home(
            Scene("", (), tuple(DrawnDrone(name, round(home[0]), home) for name, home in homes), self._field.axes)
        )

    def _crafts(self, name: str, values: Assignment) -> list[Craft]:
        robot = self._robots[name]
        if robot is not None:
            return crafts_of(robot, values)
        return [craft_of_variable(variable, values) for variable in self._trace.variables.get(name, ())]

    def _places(self, name: str, values: Assignment) -> Iterator[tuple[int, Point]]:
        """Yield the positions of a robot's drones for its decision."""
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
        """Yield the possible and past positions of drones."""
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
