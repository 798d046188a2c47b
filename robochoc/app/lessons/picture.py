"""Pictures of a team as SVG, with the colours of the page (`picture.css`)."""

from __future__ import annotations

import math
from html import escape

from robochoc.app.lessons.lesson import ROBOTS, TeamSpec
from robochoc.app.lessons.recording import LessonMessage, LessonMoment

WIDTH, HEIGHT = 400, 290
_RADIUS = 27
_BEND = 32.0
_HEAD = 9.0
_SIGN = 0.4
_Point = tuple[float, float]


def picture(team: TeamSpec, moment: LessonMoment) -> str:
    """Return the picture of a team at a moment, without empty lines, so that a Markdown page can contain it."""
    if team.chain:
        return _chain(team.chain)
    parts = [
        *(_link(team, one, other) for one, other in team.apart),
        *(_robot(team, moment, robot) for robot in ROBOTS),
        *(_arrow(team, sender, to, kind) for (sender, to), kind in _arrows(moment.messages).items()),
    ]
    return _framed(in_words(team, moment), parts)


def in_words(team: TeamSpec, moment: LessonMoment) -> str:
    """Return a description of the picture, for screen readers."""
    levels = [
        f"{robot} is at level {moment.levels[robot]}" if robot in moment.levels else f"{robot} has no level yet"
        for robot in ROBOTS
    ]
    rules = [f"{one} and {other}" for one, other in team.apart]
    sent = [f"{message.sender} to {message.to}: {message.words}" for message in moment.messages]
    messages = f" Messages: {'; '.join(sent)}." if sent else ""
    return f"{', '.join(levels)}. Not at the same level: {', '.join(rules)}.{messages}"


def _framed(words: str, parts: list[str]) -> str:
    content = "\n".join(parts)
    box = f'viewBox="0 0 {WIDTH} {HEIGHT}" role="img" aria-label="{escape(words)}"'
    return f'<svg class="team-picture" xmlns="http://www.w3.org/2000/svg" {box}>\n{content}\n</svg>'


def _link(team: TeamSpec, one: str, other: str) -> str:
    (x1, y1), (x2, y2) = team.place(one), team.place(other)
    part = 0.5 if x1 == x2 or y1 == y2 else _SIGN  # keeps the signs on crossing links apart
    x, y = x1 + part * (x2 - x1), y1 + part * (y2 - y1)
    return (
        f'<line class="link" x1="{x1}" y1="{y1}" x2="{x2}" y2="{y2}"/>'
        f'<circle class="rule" cx="{x:.0f}" cy="{y:.0f}" r="11"/>'
        f'<text class="sign" x="{x:.0f}" y="{y + 5:.0f}">≠</text>'
    )


def _robot(team: TeamSpec, moment: LessonMoment, robot: str) -> str:
    x, y = team.place(robot)
    kind = "robot asked" if robot == moment.asked else "robot"
    level = moment.levels.get(robot)
    side = team.names.get(robot, "")
    above = y < HEIGHT / 2
    away = _RADIUS + 10
    beside, name = {"left": (x - away, y + 5), "right": (x + away, y + 5)}.get(
        side, (x, y - away if above else y + away + 10)
    )
    domain = ", ".join(map(str, team.levels(robot)))
    return (
        f'<circle class="{kind}" cx="{x}" cy="{y}" r="{_RADIUS}"/>'
        f'<text class="level" x="{x}" y="{y + 8}">{"·" if level is None else level}</text>'
        f'<text class="{f"name {side}".rstrip()}" x="{beside}" y="{name}">{escape(robot)}'
        f'<tspan class="domain" dx="6">of {domain}</tspan></text>'
    )


def _arrows(messages: tuple[LessonMessage, ...]) -> dict[tuple[str, str], str]:
    """Return one arrow for each pair of sender and receiver, with the kind of the last message."""
    return {(one.sender, one.to): one.kind for one in messages}


def _arrow(team: TeamSpec, sender: str, to: str, kind: str) -> str:
    start, end = team.place(sender), team.place(to)
    middle = _beside(start, end)
    first, last = _edge(start, middle, 3), _edge(end, middle, 5)
    neck = _towards(last, middle, _HEAD)
    left, right = _across(last, neck)
    path = f"M{_at(first)} Q{_at(middle)} {_at(neck)}"
    x, y = ((first[0] + 2 * middle[0] + neck[0]) / 4, (first[1] + 2 * middle[1] + neck[1]) / 4)
    return (
        f'<path class="said" d="{path}"/><polygon class="head" points="{_at(last)} {_at(left)} {_at(right)}"/>'
        f'<text class="kind" x="{x:.0f}" y="{y + 4:.0f}">{escape(kind)}</text>'
    )


def _beside(start: _Point, end: _Point) -> _Point:
    """Return the control point of an arrow: beside the link, on the right in the arrow's direction."""
    away = math.dist(start, end)
    x, y = (start[0] + end[0]) / 2, (start[1] + end[1]) / 2
    bend = 2 * _BEND
    return x - bend * (end[1] - start[1]) / away, y + bend * (end[0] - start[0]) / away


def _edge(centre: _Point, to: _Point, gap: float) -> _Point:
    return _towards(centre, to, _RADIUS + gap)


def _towards(start: _Point, end: _Point, by: float) -> _Point:
    part = by / math.dist(start, end)
    return start[0] + part * (end[0] - start[0]), start[1] + part * (end[1] - start[1])


def _across(last: _Point, neck: _Point) -> tuple[_Point, _Point]:
    x, y = (last[0] - neck[0]) / 2, (last[1] - neck[1]) / 2
    return (neck[0] - y, neck[1] + x), (neck[0] + y, neck[1] - x)


def _at(point: _Point) -> str:
    return f"{point[0]:.1f},{point[1]:.1f}"


_SHOWN = 7


def _chain(count: int) -> str:
    """Return the picture of a long row of robots, of which only a few are drawn."""
    xs = [40 + 53 * place for place in range(_SHOWN)]
    y = HEIGHT // 2
    gap = _SHOWN - 2
    parts = [f'<line class="link" x1="{xs[0]}" y1="{y}" x2="{xs[-1]}" y2="{y}"/>']
    for place, x in enumerate(xs):
        name = "" if place == gap else f"R{count if place == _SHOWN - 1 else place + 1}"
        dots = f'<circle class="rule" cx="{x}" cy="{y}" r="17"/><text class="level" x="{x}" y="{y + 4}">…</text>'
        robot = f'<circle class="robot" cx="{x}" cy="{y}" r="17"/><text class="name" x="{x}" y="{y + 40}">{name}</text>'
        parts.append(robot if name else dots)
    return _framed(f"A row of {count} robots; neighbours may not be at the same level.", parts)
