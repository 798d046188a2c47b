"""A scene as one self-contained HTML page: meshcat's viewer, its commands, a caption, a legend and a player.

Names of teams and robots may come from foreign files, and are inserted into HTML only as escaped text. The page's
Content-Security-Policy allows only the page's two scripts, and no loading.
"""

from __future__ import annotations

import base64
import json
from collections.abc import Iterator
from html import escape
from importlib.resources import files
from string import Template
from typing import Any

from robochoc.system.plain_text import printable
from robochoc.view.drawing import cell_of, colour_of, commands, corners, path_of, row_colours
from robochoc.view.page_scripts import content_security_policy, viewer_script
from robochoc.view.palette import GREY, RED, STONE, UNKNOWN, Colour, colours, css_colour
from robochoc.view.playback import DroneState, Playback
from robochoc.view.scene import Scene

_SWATCHES_MAX = 9
"""The maximum number of rows with legend entries; for more rows, the legend shows a colour ramp with its two ends."""


_PLAYER = ("picture.js", "labels.js", "swarm.js", "trails.js", "camera.js", "player.js", "timeline.js", "page.js")
"""The parts of the player's script, in order."""


def scene_page(scene: Scene) -> bytes:
    """Return the page in UTF-8.

    The page plays the flight once, needs no server and no network, and is identical for equal scenes.
    """
    return _page(scene, "\n".join(base64.b64encode(command).decode() for command in commands(scene)), "'none'")


def live_page(scene: Scene, port: int) -> bytes:
    """Return the page without the commands, which it receives from its server, at `port` of this machine."""
    return _page(scene, "", f"ws://127.0.0.1:{port} ws://localhost:{port}")


def _page(scene: Scene, embedded: str, connections: str) -> bytes:
    here = files(__package__)
    viewer, player = viewer_script(), "".join((here / part).read_text(encoding="utf-8") for part in _PLAYER)
    return (
        Template((here / "page.html").read_text(encoding="utf-8"))
        .substitute(
            policy=content_security_policy((viewer, player), connections),
            title=_text(scene.title),
            facts="".join(f"<dt>{_text(name)}</dt><dd>{_text(fact)}</dd>" for name, fact in scene.facts),
            legend=legend(scene),
            commands=embedded,
            playback=playback_json(scene),
            viewer=viewer,
            player=player,
        )
        .encode()
    )


def _text(text: str) -> str:
    return escape(printable(text))


def legend(scene: Scene) -> str:
    """Return the legend of `scene` as HTML: the colours of rows, grey and red; empty if all drones look the same."""
    entries = [*_row_entries(scene), *_state_entries(scene)]
    return f'<ul id="legend" aria-label="Legend">{"".join(entries)}</ul>\n' if entries else ""


def _row_entries(scene: Scene) -> Iterator[str]:
    """Yield an entry for each row along the first axis, since drones in a row have the same colour."""
    rows = sorted({drone.group for drone in scene.drones})
    axis = scene.axes[0]
    name = f"{axis.name} = " if axis.name == "x" else f"{axis.name or 'row'} "
    unit = "" if axis.unit_m is None else " m"
    ramp = colours(len(rows))
    if len(rows) <= 1:
        return
    if len(rows) <= _SWATCHES_MAX:
        for row, colour in zip(rows, ramp, strict=True):
            yield _entry(css_colour(colour), f"{name}{axis.text(row)}{unit}")
    else:
        ends = " to ".join(map(axis.text, (rows[0], rows[-1])))
        yield _entry(f"linear-gradient(to right, {', '.join(map(css_colour, ramp))})", f"{name}{ends}{unit}", "ramp")


def _state_entries(scene: Scene) -> Iterator[str]:
    """Yield an entry for each colour that does not represent a row."""
    changes = scene.playback.states if scene.playback else ()
    seen = {state for drone in changes for _, state in drone}
    if DroneState.WITHDRAWN in seen:
        yield _named_entry(GREY, "withdrawn")
    if DroneState.FALLEN in seen:
        yield _named_entry(RED, "fallen")
    if scene.playback and scene.playback.obstacles:
        yield _entry(f"{css_colour(RED)}59", "obstacle", "edged")
    if scene.blocks:
        yield _named_entry(STONE, "blocked cell")
    if (scene.walls and len(scene.walls.occupied)) or scene.faces is not None:
        yield _named_entry(STONE, "wall")
    if scene.walls and len(scene.walls.unknown):
        yield _named_entry(UNKNOWN, "not known")


def _named_entry(colour: Colour, text: str) -> str:
    return _entry(css_colour(colour), text)


def _entry(background: str, text: str, kind: str = "") -> str:
    """Return an entry: a swatch and its text."""
    return f'<li><i class="{kind}" style="background:{background}"></i>{escape(printable(text))}</li>'


def playback_json(scene: Scene) -> str:
    """Return the player's data as JSON that is safe in HTML: drones, epochs, events, and the extent of the scene.

    Times are in seconds. `corners` and `cell` are in meshcat's frame, as scaled by `drawing`. Names may come from
    foreign files, and are escaped so that they cannot end the script element.
    """
    data = {
        "corners": [[round(part, 5) for part in corner] for corner in corners(scene)],
        "cell": round(cell_of(scene), 5),
        "drones": [*_drone_data(scene)],
        **(_playback_data(scene.playback) if scene.playback else {"duration": 0, "chapters": [], "marks": []}),
    }
    return json.dumps(data, separators=(",", ":")).replace("<", "\\u003c")


def _drone_data(scene: Scene) -> Iterator[dict[str, Any]]:
    states = scene.playback.states if scene.playback else ((),) * len(scene.drones)
    drawn = zip(scene.drones, row_colours(scene.drones), states, strict=True)
    for number, (drone, colour, changes) in enumerate(drawn):
        yield {
            "name": printable(drone.name),
            "path": path_of(number, drone.name),
            "colour": css_colour(colour),
            "states": [[round(at_s, 3), state.value, css_colour(colour_of(state, colour))] for at_s, state in changes],
        }


def _playback_data(playback: Playback) -> dict[str, Any]:
    return {
        "duration": round(playback.duration_s, 4),
        "chapters": [
            {"at": round(chapter.begins_s, 3), "opened": printable(chapter.opened_by), "says": chapter.result}
            for chapter in playback.chapters
        ],
        "marks": [
            {"at": round(mark.at_s, 3), "drone": mark.drone, "says": printable(mark.text)} for mark in playback.marks
        ],
    }
