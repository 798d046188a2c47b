"""A small picture of a sketch: the map, the robots, and the links between them. An SVG without scripts or styles.

The picture uses the colours of its page (`--paper` and others), and default colours outside a page.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from html import escape

from robochoc.app.sketch.element_checks import check_bounds
from robochoc.app.sketch.palette import Links
from robochoc.app.sketch.rule_checks import SketchFacts
from robochoc.app.sketch.rules import PALETTE
from robochoc.app.sketch.sentences import listed
from robochoc.app.sketch.sketch import Cell, Sketch
from robochoc.app.texts import say

WIDTH, HEIGHT = 320, 200
MAX_LINES = 150
"""The maximum number of drawn links, for readability."""
MAX_DRAWN = 400
"""The maximum number of drawn robots. In a larger team, the first robots are drawn."""
_NAMED_ELSEWHERE = "trouble.team-name"
"""An error that is ignored: the name of an imported team may not be valid for a sketch."""
_MARGIN = 14
_FEW = 8
"""The maximum number of robots whose names are drawn."""
_INK, _ACCENT, _PAPER = "var(--ink, #17202b)", "var(--accent, #1f5fbf)", "var(--paper, #ffffff)"


def thumbnail(sketch: Sketch, links: Iterable[tuple[str, str]] = ()) -> str:
    """Return the picture. Names given by users are escaped.

    Args:
        sketch: The sketch.
        links: Further pairs of robots that are linked.
    """
    if any(one.key != _NAMED_ELSEWHERE for one in check_bounds(sketch)):
        sketch = Sketch()  # an empty map
    scale = min((WIDTH - 2 * _MARGIN) / sketch.area.columns, (HEIGHT - 2 * _MARGIN) / sketch.area.rows)
    drawn = _Thumbnail(sketch, scale)
    label = say("picture.label", name=sketch.name, robots=listed([robot.name for robot in sketch.robots]))
    parts = [*drawn.cells(), *drawn.links(links), *drawn.robots()]
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH} {HEIGHT}" role="img" '
        f'aria-label="{escape(_printable(label))}">{"".join(parts)}</svg>'
    )


def _printable(text: str) -> str:
    """Return a text with spaces instead of characters that are not allowed in XML."""
    return "".join(letter if letter.isprintable() else " " for letter in text)


class _Thumbnail:
    """The parts of a picture. `scale`: the size of a cell."""

    def __init__(self, sketch: Sketch, scale: float) -> None:
        self._sketch, self._scale = sketch, scale
        self._left = (WIDTH - scale * sketch.area.columns) / 2
        self._bottom = HEIGHT - (HEIGHT - scale * sketch.area.rows) / 2

    def _corner(self, cell: Cell) -> tuple[float, float]:
        return self._left + cell.x * self._scale, self._bottom - (cell.y + 1) * self._scale

    def _middle(self, cell: Cell) -> tuple[float, float]:
        x, y = self._corner(cell)
        return x + self._scale / 2, y + self._scale / 2

    def cells(self) -> Iterator[str]:
        """Yield the map: its grid and the blocked cells."""
        area, size = self._sketch.area, self._scale
        x, y = self._corner(Cell(0, area.rows - 1))
        path = "".join(f"M{x + size * column:.1f} {y:.1f}v{size * area.rows:.1f}" for column in range(area.columns + 1))
        path += "".join(f"M{x:.1f} {y + size * row:.1f}h{size * area.columns:.1f}" for row in range(area.rows + 1))
        yield f'<path d="{path}" fill="none" stroke="{_INK}" stroke-opacity="0.14"/>'
        blocked = "".join(
            "M{:.1f} {:.1f}h{:.1f}v{:.1f}h-{:.1f}z".format(*self._corner(cell), size, size, size)
            for cell in sorted(area.blocked)
            if area.has(cell)
        )
        if blocked:
            yield f'<path d="{blocked}" fill="{_INK}" fill-opacity="0.3"/>'

    def links(self, more: Iterable[tuple[str, str]]) -> Iterator[str]:
        """Yield a line for each pair of robots that are linked by rules or in `more`."""
        standing = {robot.name: robot.at for robot in self._sketch.robots if self._sketch.area.has(robot.at)}
        pairs: dict[tuple[str, str], None] = {}
        pairs |= dict.fromkeys(pair for pair in more if standing.keys() >= {*pair})
        for rule in SketchFacts(self._sketch).sound:
            entry = PALETTE[rule.kind]
            if entry.links in {Links.EACH, Links.GROUP}:
                continue
            for one, other in entry.groups(self._sketch, rule):
                if one in standing and other in standing:
                    pairs.setdefault((one, other) if one < other else (other, one))
                if len(pairs) >= MAX_LINES:
                    break
        path = ""
        for one, other in list(pairs)[:MAX_LINES]:
            (x, y), (to_x, to_y) = self._middle(standing[one]), self._middle(standing[other])
            path += f"M{x:.1f} {y:.1f}L{to_x:.1f} {to_y:.1f}"
        if path:
            yield f'<path d="{path}" fill="none" stroke="{_ACCENT}" stroke-opacity="0.35" stroke-width="1.5"/>'

    def robots(self) -> Iterator[str]:
        """Yield the robots, with their names if there are few robots."""
        robots = [robot for robot in self._sketch.robots if self._sketch.area.has(robot.at)][:MAX_DRAWN]
        radius = max(1.5, min(9.0, self._scale * 0.3))
        for robot in robots:
            x, y = self._middle(robot.at)
            circle = f'<circle cx="{x:.1f}" cy="{y:.1f}" r="{radius:.1f}"'
            yield f'{circle} fill="{_ACCENT}" stroke="{_PAPER}" stroke-width="2"/>'
        if len(robots) > _FEW:
            return
        for robot in robots:
            x, y = self._middle(robot.at)
            below = y + radius + 11
            at = below if below < HEIGHT - 1 else y - radius - 4
            yield (
                f'<text x="{x:.1f}" y="{at:.1f}" text-anchor="middle" font-size="11" fill="{_INK}" stroke="{_PAPER}" '
                f'stroke-width="3" paint-order="stroke" font-family="system-ui, sans-serif">'
                f"{escape(_printable(_brief(robot.name)))}</text>"
            )


def _brief(name: str) -> str:
    most = 12
    return name if len(name) <= most else f"{name[: most - 1]}…"
