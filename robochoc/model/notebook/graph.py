"""The constraint graph of a team as an SVG picture: robots on a circle, lines between those that share something."""

from __future__ import annotations

import math
from collections.abc import Sequence

from robochoc.model.notebook.tables import text
from robochoc.model.orders import constraint_graph
from robochoc.model.problem import Team

MAX_ROBOTS = 60
"""More robots are not drawn: one could not tell them apart."""
_MARGIN = 110
_LONGEST = 16


def graph_svg(team: Team) -> str:
    """Return the constraint graph of `team`; nothing for one robot, and for too many."""
    if not 1 < len(team.robots) <= MAX_ROBOTS:
        return ""
    near = constraint_graph(team)
    count = len(team.order)
    radius = max(60, 9 * count)
    size = 2 * (radius + _MARGIN)
    places = {name: _on_circle(number, count, radius, size / 2) for number, name in enumerate(team.order)}
    lines = [
        _line(places[one], places[other])
        for number, one in enumerate(team.order)
        for other in team.order[:number]
        if other in near[one]
    ]
    nodes = [_node(name, *places[name], size / 2) for name in team.order]
    top, height = _MARGIN - 30, 2 * radius + 60
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 {top} {size} {height}" role="img"'
        f' aria-label="constraint graph: {count} robots, {len(lines)} links" style="max-width:{size}px;width:100%">'
        f'<g stroke="currentColor" stroke-opacity=".35">{"".join(lines)}</g>{"".join(nodes)}</svg>'
    )


def _on_circle(number: int, count: int, radius: float, middle: float) -> tuple[float, float]:
    angle = 2 * math.pi * number / count - math.pi / 2
    return middle + radius * math.cos(angle), middle + radius * math.sin(angle)


def _line(one: Sequence[float], other: Sequence[float]) -> str:
    return f'<line x1="{one[0]:.1f}" y1="{one[1]:.1f}" x2="{other[0]:.1f}" y2="{other[1]:.1f}"/>'


def _node(name: str, x: float, y: float, middle: float) -> str:
    """Return a robot and its name, which stands outside of the circle."""
    shown = name if len(name) <= _LONGEST else f"{name[: _LONGEST - 1]}…"
    beside = abs(x - middle) > 1
    right = x > middle
    anchor = ("start" if right else "end") if beside else "middle"
    dx, dy = ((11 if right else -11), 4) if beside else (0, 20 if y > middle else -11)
    return (
        f'<circle cx="{x:.1f}" cy="{y:.1f}" r="6" fill="#3f51b5"><title>{text(name)}</title></circle>'
        f'<text x="{x + dx:.1f}" y="{y + dy:.1f}" text-anchor="{anchor}" font-size="12" fill="currentColor">'
        f"{text(shown)}</text>"
    )
