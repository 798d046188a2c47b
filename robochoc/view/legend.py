"""The page's legend: which row has which colour, and what grey and red mean."""

from __future__ import annotations

from collections.abc import Iterator
from html import escape

from robochoc.system.plain_text import printable
from robochoc.view.palette import GREY, RED, STONE, UNKNOWN, Colour, colours, web
from robochoc.view.playback import DroneState
from robochoc.view.scene import Scene

_SWATCHES_MAX = 9
"""More rows than that are one ramp, with its ends named."""


def legend(scene: Scene) -> str:
    """Return the legend of `scene` as HTML; empty where all drones look alike."""
    entries = [*_rows(scene), *_states(scene)]
    return f'<ul id="legend" aria-label="What colours mean">{"".join(entries)}</ul>\n' if entries else ""


def _rows(scene: Scene) -> Iterator[str]:
    """Yield an entry for each row, by the first axis: drones of a row have the same colour."""
    rows = sorted({drone.group for drone in scene.drones})
    axis = scene.axes[0]
    name = f"{axis.name} = " if axis.name == "x" else f"{axis.name or 'row'} "
    unit = "" if axis.unit_m is None else " m"
    ramp = colours(len(rows))
    if len(rows) <= 1:
        return
    if len(rows) <= _SWATCHES_MAX:
        for row, colour in zip(rows, ramp, strict=True):
            yield _entry(web(colour), f"{name}{axis.text(row)}{unit}")
    else:
        ends = " to ".join(map(axis.text, (rows[0], rows[-1])))
        yield _entry(f"linear-gradient(to right, {', '.join(map(web, ramp))})", f"{name}{ends}{unit}", "ramp")


def _states(scene: Scene) -> Iterator[str]:
    """Yield an entry for each colour that some drone or obstacle has other than its row's."""
    changes = scene.playback.states if scene.playback else ()
    seen = {state for drone in changes for _, state in drone}
    if DroneState.WITHDRAWN in seen:
        yield _named(GREY, "withdrawn")
    if DroneState.FALLEN in seen:
        yield _named(RED, "fallen")
    if scene.playback and scene.playback.obstacles:
        yield _entry(f"{web(RED)}59", "obstacle", "edged")
    if scene.blocks:
        yield _named(STONE, "blocked cell")
    if (scene.walls and len(scene.walls.occupied)) or scene.faces is not None:
        yield _named(STONE, "wall")
    if scene.walls and len(scene.walls.unknown):
        yield _named(UNKNOWN, "not known")


def _named(colour: Colour, text: str) -> str:
    return _entry(web(colour), text)


def _entry(background: str, text: str, kind: str = "") -> str:
    """Return one entry: a swatch, then its text."""
    return f'<li><i class="{kind}" style="background:{background}"></i>{escape(printable(text))}</li>'
