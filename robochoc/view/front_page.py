"""The Pareto front of several objectives as a self-contained HTML page on which one point is chosen.

Each point of the chart is a link; the page shows the values of the point to which its address refers (`#p3`), without
a script.
"""

from __future__ import annotations

import html
import itertools
from collections.abc import Iterator, Sequence

from robochoc.model.cost_units import Cost, cost_shown
from robochoc.model.outcome import FrontPoint, Outcome
from robochoc.model.problem import Team

MOST_SHOWN = 300
"""The maximum number of points on the page. Of a longer front, points at equal distances in the list are shown."""
_WIDTH, _HEIGHT, _ROOM = 520, 340, 56
"""The size of a chart and the space for its labels, in pixels."""
_POLICY = "default-src 'none'; style-src 'unsafe-inline'"
_STYLE = """
:root { color-scheme: light dark; }
body { font: 16px/1.5 system-ui, sans-serif; max-width: 72rem; margin: 0 auto; padding: 1rem; }
h1 { font-size: 1.6rem; } h2 { font-size: 1.2rem; }
main { display: flex; flex-wrap: wrap; gap: 2rem; align-items: flex-start; }
svg { display: block; max-width: 100%; height: auto; font: 12px system-ui, sans-serif; } text { fill: currentColor; }
.axis { stroke: currentColor; stroke-opacity: .5; } circle { fill: #1f6fb4; }
a:focus circle, a:hover circle { fill: #d9730d; }
.point { display: none; } i { position: fixed; top: 0; }
table { border-collapse: collapse; font-variant-numeric: tabular-nums; }
th, td { padding: .15rem 1rem .15rem 0; text-align: left; } thead th { border-bottom: 1px solid; }
"""
_CHOSEN = "{display:block}"
_MARKED = "{fill:#d9730d;stroke:currentColor;stroke-width:2px}"


def front_page(outcome: Outcome, team: Team) -> str:
    """Return the page of an outcome with a Pareto front, of a `team` with the same variables."""
    shown = _shown(outcome.front)
    title = html.escape(f"Pareto front: {outcome.team}")
    charts = _charts(shown)
    points = "".join(_point(number, point, outcome, team, len(shown)) for number, point in shown)
    anchors = "".join(f'<i id="p{number}"></i>' for number, _ in shown)
    head = (
        f'<meta charset="utf-8"><title>{title}</title><meta name="viewport" content="width=device-width,'
        f' initial-scale=1"><meta http-equiv="Content-Security-Policy" content="{_POLICY}">'
        f"<style>{_STYLE}{''.join(_rules(shown))}</style>"
    )
    return (
        f'<!doctype html>\n<html lang="en"><head>{head}</head>\n<body>{anchors}<header><h1>{title}</h1>'
        f"<p>{_summary(outcome, len(shown))}</p></header>\n<main><div>{charts}</div>\n<div>{points}</div></main>"
        "</body></html>\n"
    )


def front_choice(front: Sequence[FrontPoint], chosen: int) -> str:
    """Return the charts and the table of a front in HTML. Each point is a link: `#p3`.

    Args:
        front: The points.
        chosen: The number of the marked point, from 1 on.
    """
    shown = sorted({*dict(_shown(front)), chosen})
    points = [(number, front[number - 1]) for number in shown]
    heads = "".join(f'<th scope="col">{html.escape(name)}</th>' for name in front[0].objectives)
    rows = "".join(_row(number, point, is_chosen=number == chosen) for number, point in points)
    return (
        f"<style>.front .c{chosen} circle{_MARKED}</style>{_charts(points)}"
        f'<div class="points"><table><thead><tr><th scope="col">point</th>{heads}</tr></thead>'
        f"<tbody>{rows}</tbody></table></div>"
    )


def _row(number: int, point: FrontPoint, *, is_chosen: bool) -> str:
    costs = "".join(f"<td>{_text(cost)}</td>" for cost in point.objectives.values())
    current = ' aria-current="true"' if is_chosen else ""
    link = f'<a href="#p{number}"{current}>{number:,}</a>'
    return f'<tr{" class=chosen" * is_chosen}><th scope="row">{link}</th>{costs}</tr>'


def _shown(front: Sequence[FrontPoint]) -> list[tuple[int, FrontPoint]]:
    """Return the points that are shown, with their numbers from 1 on."""
    step = -(-len(front) // MOST_SHOWN)
    return [*enumerate(front, 1)][::step]


def _charts(shown: Sequence[tuple[int, FrontPoint]]) -> str:
    """Return a chart for each pair of objectives."""
    names = (*shown[0][1].objectives,)
    return "".join(_chart(shown, names, pair) for pair in itertools.combinations(names, 2))


def _summary(outcome: Outcome, shown: int) -> str:
    many = len(outcome.front)
    part = f" {shown:,} of them are shown." if shown < many else ""
    return (
        f"{many:,} point{'s' * (many != 1)}, found by {html.escape(outcome.protocol)} and checked against every"
        f" constraint.{part} No point is better than another one in one objective without being worse in another."
        " Choose a point to see its values."
    )


def _rules(shown: Sequence[tuple[int, FrontPoint]]) -> Iterator[str]:
    """Yield the style rules that show the chosen point; without a choice, the first one."""
    yield f"body:not(:has(:target)) .v1{_CHOSEN}body:not(:has(:target)) .c1 circle{_MARKED}"
    for number, _ in shown:
        yield f"#p{number}:target~main .v{number}{_CHOSEN}#p{number}:target~main .c{number} circle{_MARKED}"


def _chart(shown: Sequence[tuple[int, FrontPoint]], names: Sequence[str], pair: tuple[str, str]) -> str:
    """Return an SVG chart of two objectives, in which each point is a link."""
    across, up = pair
    columns = [float(point.objectives[across]) for _, point in shown]
    rows = [float(point.objectives[up]) for _, point in shown]
    marks = "".join(
        f'<a href="#p{number}" class="c{number}"><title>{html.escape(_costs(point))}</title>'
        f'<circle cx="{_place(x, columns, _ROOM, _WIDTH - 16):.1f}" cy="{_place(y, rows, _HEIGHT - _ROOM, 16):.1f}"'
        ' r="6"/></a>'
        for (number, point), x, y in zip(shown, columns, rows, strict=True)
    )
    left, bottom = _ROOM - 12, _HEIGHT - _ROOM + 12
    labels = [
        (left, bottom + 18, "start", _text(min(point.objectives[across] for _, point in shown))),
        (_WIDTH - 8, bottom + 18, "end", _text(max(point.objectives[across] for _, point in shown))),
        (left - 6, _HEIGHT - _ROOM + 4, "end", _text(min(point.objectives[up] for _, point in shown))),
        (left - 6, 20, "end", _text(max(point.objectives[up] for _, point in shown))),
        ((left + _WIDTH) // 2, bottom + 34, "middle", across),
    ]
    texts = "".join(
        f'<text x="{x}" y="{y}" text-anchor="{anchor}">{html.escape(label)}</text>' for x, y, anchor, label in labels
    )
    middle = _HEIGHT // 2 - 20
    return (
        f'<svg width="{_WIDTH}" height="{_HEIGHT}" viewBox="0 0 {_WIDTH} {_HEIGHT}" role="img"'
        f' aria-label="{html.escape(f"{across} and {up} of {len(names)} objectives")}">'
        f'<path class="axis" fill="none" d="M{left} 8V{bottom}H{_WIDTH - 8}"/>{texts}'
        f'<text transform="translate(14 {middle}) rotate(-90)" text-anchor="middle">{html.escape(up)}</text>'
        f"{marks}</svg>"
    )


def _place(value: float, values: Sequence[float], first: int, last: int) -> float:
    """Return the coordinate of `value` on an axis from the minimum of `values` to their maximum."""
    least, most = min(values), max(values)
    return (first + last) / 2 if most == least else first + (value - least) / (most - least) * (last - first)


def _point(number: int, point: FrontPoint, outcome: Outcome, team: Team, shown: int) -> str:
    """Return the section with the costs and the values of a point."""
    labelled = outcome.labelled(point.assignment)
    rows = "".join(
        f"<tr><td>{html.escape(robot.name)}</td><td>{html.escape(one.name)}</td>"
        f"<td>{html.escape(str(labelled[one.name]))}</td></tr>"
        for robot in team.robots
        for one in robot.variables
        if one.name in labelled
    )
    costs = "".join(f"<li>{html.escape(name)}: {_text(cost)}</li>" for name, cost in point.objectives.items())
    step = -(-len(outcome.front) // MOST_SHOWN)
    others = [(number - step, "previous"), (number + step, "next")]
    links = " ".join(
        f'<a href="#p{other}">{word}</a>' for other, word in others if 1 <= other <= 1 + (shown - 1) * step
    )
    return (
        f'<section class="point v{number}"><h2>Point {number:,}</h2><ul>{costs}</ul><p>{links}</p>'
        f"<table><thead><tr><th>robot</th><th>variable</th><th>value</th></tr></thead><tbody>{rows}</tbody></table>"
        "</section>"
    )


def _costs(point: FrontPoint) -> str:
    return ", ".join(f"{name} {_text(cost)}" for name, cost in point.objectives.items())


def _text(cost: Cost) -> str:
    return cost_shown(cost)
