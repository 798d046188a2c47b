"""Colours of the scene. The colours of rows, from dark violet to light yellow, also differ in lightness."""

from __future__ import annotations

import numpy as np

Colour = tuple[float, float, float]
"""Red, green and blue, 0 to 1."""

GREY: Colour = (0.62, 0.64, 0.67)
"""The colour of withdrawn drones."""
RED: Colour = (0.86, 0.16, 0.18)
"""The colour of obstacles, and of fallen drones."""
STONE: Colour = (0.40, 0.44, 0.50)
"""The colour of blocked cells, and of walls."""
UNKNOWN: Colour = (0.73, 0.70, 0.62)
"""The colour of unknown parts of a map."""

_RAMP = np.array(
    [
        (0.42, 0.20, 0.62),
        (0.26, 0.36, 0.80),
        (0.12, 0.56, 0.78),
        (0.16, 0.70, 0.58),
        (0.50, 0.80, 0.36),
        (0.98, 0.86, 0.28),
    ]
)


def colours(count: int) -> list[Colour]:
    """Return `count` colours, evenly spaced along the ramp."""
    stops = np.linspace(0, 1, len(_RAMP))
    at = np.linspace(0, 1, count)
    red, green, blue = (np.interp(at, stops, _RAMP[:, part]) for part in range(3))
    return [(float(r), float(g), float(b)) for r, g, b in zip(red, green, blue, strict=True)]


def css_colour(colour: Colour) -> str:
    """Return `colour` in CSS notation."""
    return "#" + "".join(f"{round(255 * part):02x}" for part in colour)
