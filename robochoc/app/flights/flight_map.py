"""The map for a team's flight (`robochoc fly --map`): the robots' positions and blocked cells."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import suppress

import msgspec

from robochoc.app.runs.run import CHANGE, Run
from robochoc.app.sketch.element_checks import is_sound
from robochoc.app.sketch.sketch import Sketch
from robochoc.maps.ground_map import BlockedCell, GroundMap

MAP = "map.json"


_MOST_TOLD = 100_000
"""The maximum number of characters in the texts for a change."""


class RunChange(msgspec.Struct):
    """The content of `change.json`: the team after the events, and why it decided from scratch, if it did (`anew`)."""

    after: Sketch
    happened: list[str] = []
    anew: str = ""

    @property
    def is_sound(self) -> bool:
        """True if the change, whose file may be untrusted, is within the limits."""
        return is_sound(self.after) and len(self.anew) + sum(map(len, self.happened)) <= _MOST_TOLD


def ground_of(run: Run) -> GroundMap | None:
    """Return the map for a run's team, or None for an imported team. Raises the exceptions of `Run.sketch`."""
    sketch = run.sketch
    if not sketch.decisions:
        return None
    after = changed_to(run) or sketch
    return GroundMap(
        sketch.area.columns,
        sketch.area.rows,
        {
            robot.name: (robot.at.x + 1, robot.at.y + 1)
            for robot in (*after.robots, *sketch.robots)  # a robot in both has its first position
            if sketch.area.has(robot.at)
        },
        tuple(_blocked(sketch, after)),
    )


def changed_to(run: Run) -> Sketch | None:
    """Return the team after the events in a run, for which it decided again, or None if there were no events."""
    change = _change(run)
    return change.after if change else None


def happened_in(run: Run) -> list[str]:
    """Return the events in a run as sentences."""
    change = _change(run)
    return change.happened if change else []


def _change(run: Run) -> RunChange | None:
    with suppress(OSError, msgspec.DecodeError, RecursionError):
        change = msgspec.json.decode((run.folder / CHANGE).read_bytes(), type=RunChange)
        return None if change.anew else change
    return None


def _blocked(before: Sketch, after: Sketch) -> Iterator[BlockedCell]:
    """Yield all blocked cells. Cells blocked by an event are blocked from the second epoch on."""
    for cell in sorted(before.area.blocked | after.area.blocked):
        if before.area.has(cell):
            yield BlockedCell(cell.x + 1, cell.y + 1, 0 if cell in before.area.blocked else 1)
