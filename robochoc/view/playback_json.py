"""The data of the page's player, besides meshcat's commands, as JSON that is safe in HTML."""

from __future__ import annotations

import json
from collections.abc import Iterator
from typing import Any

from robochoc.system.plain_text import printable
from robochoc.view.drawing import cell_of, colour_of, corners, path_of, row_colours
from robochoc.view.palette import web
from robochoc.view.playback import Playback
from robochoc.view.scene import Scene


def playback_json(scene: Scene) -> str:
    """Return the drones by names, paths and colours, the epochs and events by time, and the extent of the scene.

    Times are in seconds. `corners` and `cell` are in meshcat's frame as `drawing` scales it. Names may come from
    foreign files: they are text, and no character of them ends the script that contains this.
    """
    whole = {
        "corners": [[round(part, 5) for part in corner] for corner in corners(scene)],
        "cell": round(cell_of(scene), 5),
        "drones": [*_drones(scene)],
        **(_story(scene.playback) if scene.playback else {"duration": 0, "chapters": [], "marks": []}),
    }
    return json.dumps(whole, separators=(",", ":")).replace("<", "\\u003c")


def _drones(scene: Scene) -> Iterator[dict[str, Any]]:
    states = scene.playback.states if scene.playback else ((),) * len(scene.drones)
    drawn = zip(scene.drones, row_colours(scene.drones), states, strict=True)
    for number, (drone, colour, changes) in enumerate(drawn):
        yield {
            "name": printable(drone.name),
            "path": path_of(number, drone.name),
            "colour": web(colour),
            "states": [[round(at_s, 3), look.value, web(colour_of(look, colour))] for at_s, look in changes],
        }


def _story(playback: Playback) -> dict[str, Any]:
    return {
        "duration": round(playback.duration_s, 4),
        "chapters": [
            {"at": round(chapter.begins_s, 3), "opened": printable(chapter.opened_by), "says": chapter.says}
            for chapter in playback.chapters
        ],
        "marks": [
            {"at": round(mark.at_s, 3), "drone": mark.drone, "says": printable(mark.says)} for mark in playback.marks
        ],
    }
