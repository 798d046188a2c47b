"""The map of a team as its flight wants it (`robochoc fly --map`): where robots stand, and which cells are blocked."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import suppress

import msgspec

from robochoc.app.runs.run import CHANGE, Run
from robochoc.app.sketch.shape import is_sound
from robochoc.app.sketch.sketch import Sketch
from robochoc.formats.ground_map import BlockedCell, GroundMap

MAP = "map.json"


_MOST_TOLD = 100_000
"""Characters of all that is told of a change: fifty sentences have far fewer."""


class Change(msgspec.Struct):
    """What is read of `change.json`: the team after what has happened; if it decided `anew`, in another run."""

    after: Sketch
    happened: list[str] = []
    anew: str = ""

    @property
    def is_sound(self) -> bool:
        """Whether it can be shown at all, wherever its file is from."""
        return is_sound(self.after) and len(self.anew) + sum(map(len, self.happened)) <= _MOST_TOLD


def ground_of(run: Run) -> GroundMap | None:
    """Return the map of a run's team; None for a team that was not drawn here. Raises as `Run.sketch`."""
    sketch = run.sketch
    if not sketch.decisions:
        return None
    after = changed_to(run) or sketch
    return GroundMap(
        sketch.area.columns,
        sketch.area.rows,
        {
            robot.name: (robot.at.x + 1, robot.at.y + 1)
            for robot in (*after.robots, *sketch.robots)  # where both have one, it stands where it stood first
            if sketch.area.has(robot.at)
        },
        tuple(_blocked(sketch, after)),
    )


def changed_to(run: Run) -> Sketch | None:
    """Return the team after what has happened to it during a run, for which it decided again; None: nothing has."""
    change = _change(run)
    return change.after if change else None


def happened_in(run: Run) -> list[str]:
    """Return what has happened to the team during a run, in sentences."""
    change = _change(run)
    return change.happened if change else []


def _change(run: Run) -> Change | None:
    with suppress(OSError, msgspec.DecodeError, RecursionError):
        change = msgspec.json.decode((run.folder / CHANGE).read_bytes(), type=Change)
        return None if change.anew else change
    return None


def _blocked(before: Sketch, after: Sketch) -> Iterator[BlockedCell]:
    """Yield all blocked cells; those that are blocked by what has happened, from the second epoch on."""
    for cell in sorted(before.area.blocked | after.area.blocked):
        if before.area.has(cell):
            yield BlockedCell(cell.x + 1, cell.y + 1, 0 if cell in before.area.blocked else 1)
