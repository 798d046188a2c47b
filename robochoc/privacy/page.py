"""The privacy loss of a run as a self-contained HTML page: for each kind of secrets, the losses between all robots."""

from __future__ import annotations

import html
from collections.abc import Iterator, Mapping, Sequence

from robochoc.privacy.losses import Kind, Measure, PrivacyReport
from robochoc.system.plain_text import counted, listed

_CELL, _SMALL_CELL = 34, 16
MOST_NUMBERED = 40
"""With more robots than this, the cells are small and have no numbers."""
_LONGEST_LABEL, _LETTER = 16, 7.5
"""The maximum length of an uncut name, in characters; the maximum width of a letter, in pixels."""
_DARK = 0.55
"""The smallest loss with a dark cell and a white number."""
_STYLE = """
:root { color-scheme: light dark; }
body { font: 16px/1.5 system-ui, sans-serif; max-width: 72rem; margin: 0 auto; padding: 1rem; }
h1 { font-size: 1.6rem; } h2 { font-size: 1.2rem; margin-top: 2.2rem; } h3 { font-size: 1rem; margin-top: 2rem; }
figure { margin: 0; overflow-x: auto; }
svg { display: block; font: 12px system-ui, sans-serif; } text { fill: currentColor; }
rect { fill: #a5141e; stroke: currentColor; stroke-opacity: .25; } .unknown { fill: #888; fill-opacity: .4; }
text.number { font-size: 10px; text-anchor: middle; } text.white { fill: #fff; }
table { border-collapse: collapse; font-variant-numeric: tabular-nums; font-size: .9rem; }
th, td { padding: .2rem .8rem .2rem 0; text-align: right; white-space: nowrap; }
th:first-child, td:first-child { text-align: left; }
thead th { border-bottom: 1px solid; }
"""
_POLICY = "default-src 'none'; style-src 'unsafe-inline'"
_SECRETS = {
    Kind.DECISION: "the value of the robot in the answer",
    Kind.DOMAIN: "which of its declared values the robot can take, and what they cost it",
    Kind.CONSTRAINTS: "entries of its constraints that the observer does not share",
}


def page_of(report: PrivacyReport, measure: Measure) -> str:
    """Return the page with a heat map of `measure` for each kind of secrets."""
    title = html.escape(f"Privacy loss: {report.team}, {report.protocol}")
    head = (
        f'<meta charset="utf-8"><title>{title}</title>'
        '<meta name="viewport" content="width=device-width, initial-scale=1">'
        f'<meta http-equiv="Content-Security-Policy" content="{_POLICY}"><style>{_STYLE}</style>'
    )
    body = "\n".join(_body(report, measure))
    return f'<!doctype html>\n<html lang="en"><head>{head}</head>\n<body><h1>{title}</h1>\n{body}\n</body></html>\n'


def _body(report: PrivacyReport, measure: Measure) -> Iterator[str]:
    run = f"Run {report.run} of {report.runs}, " if report.runs > 1 else ""
    robots = counted(len(report.robots), "robot")
    yield f"<p>{run}{robots}. 0: nothing is excluded; 1: everything is known. Losses are lower bounds.</p>"
    if report.without_rule:
        types = html.escape(listed(report.without_rule))
        yield f"<p>Losses are unknown for receivers of these messages, which have no rule: {types}.</p>"
    if report.undecided:
        yield f"<p>No decisions: {html.escape(report.undecided)}.</p>"
    yield _systems(report)
    if report.kinds():
        yield (
            "<h2>Losses between robots</h2>"
            f"<p>Loss by {measure}. Each row is a robot with secrets, each column an observer. Pairs without a cell"
            f" have no secrets.</p>{_legend()}"
        )
    for kind in report.kinds():
        caption = f"{kind.capitalize()}: {_SECRETS[kind]}"
        drawn = heat_map(report, kind, measure)
        yield f"<h3>{caption}</h3><figure>{drawn}</figure>"


def _legend() -> str:
    """Return an SVG legend for the colours."""
    losses = (0.0, 0.25, 0.5, 0.75, 1.0, None)
    cells = "".join(_cell(_CELL * place + 1, 1, _CELL, loss) for place, loss in enumerate(losses))
    beside = _CELL * len(losses) + 8
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" width="{beside + 90}" height="{_CELL + 2}" role="img">'
        f'<title>Colours of losses</title>{cells}<text x="{beside}" y="{_CELL // 2 + 5}">?: not known</text></svg>'
    )


def _systems(report: PrivacyReport) -> str:
    heads = "".join(f"<th>{measure}</th>" for measure in Measure)
    rows = "".join(
        f"<tr><td>{kind}</td>{''.join(f'<td>{_text(report.system_loss(kind, one))}</td>' for one in Measure)}</tr>"
        for kind in report.kinds()
    )
    return f"<table><thead><tr><th>System loss</th>{heads}</tr></thead><tbody>{rows}</tbody></table>"


def heat_map(report: PrivacyReport, kind: Kind, measure: Measure) -> str:
    """Return an SVG heat map with a cell for each pair of a subject (row) and an observer (column)."""
    found = {(loss.subject, loss.observer): loss.by(measure) for loss in report.losses if loss.kind is kind}
    names = [name if len(name) <= _LONGEST_LABEL else f"{name[: _LONGEST_LABEL - 1]}…" for name in report.robots]
    room = round(_LETTER * max(map(len, names))) + 8
    width = _CELL if len(names) <= MOST_NUMBERED else _SMALL_CELL
    size = room + width * len(names) + 1
    parts = [*_labels(names, room, width), *_cells(report.robots, found, room, width)]
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" width="{size}" height="{size}" viewBox="0 0 {size} {size}"'
        f' role="img"><title>{html.escape(f"Loss of {kind} by {measure}")}</title>{"".join(parts)}</svg>'
    )


def _labels(names: Sequence[str], room: int, width: int) -> Iterator[str]:
    """Yield the names before the rows and above the columns."""
    for place, name in enumerate(names):
        text = html.escape(name)
        middle = room + width * place + width // 2
        yield f'<text x="{room - 6}" y="{middle + 4}" text-anchor="end">{text}</text>'
        yield f'<text transform="translate({middle + 4} {room - 6}) rotate(-90)">{text}</text>'


def _cells(
    robots: Sequence[str], found: Mapping[tuple[str, str], float | None], room: int, width: int
) -> Iterator[str]:
    """Yield a cell for each pair with a secret."""
    for row, subject in enumerate(robots):
        for column, observer in enumerate(robots):
            if (subject, observer) in found:
                loss = found[subject, observer]
                title = html.escape(f"{observer} of {subject}: {_text(loss)}")
                cell = _cell(room + width * column, room + width * row, width, loss)
                yield f"<g><title>{title}</title>{cell}</g>"


def _cell(x: int, y: int, width: int, loss: float | None) -> str:
    """Return a square: redder for a larger loss, grey for an unknown loss; with a number if there is room."""
    filled = 'class="unknown"' if loss is None else f'fill-opacity="{loss:.3f}"'
    square = f'<rect x="{x}" y="{y}" width="{width}" height="{width}" {filled}/>'
    if width < _CELL:
        return square
    ink = "number white" if loss is not None and loss >= _DARK else "number"
    number = "?" if loss is None else f"{loss:.2f}"
    return f'{square}<text x="{x + width // 2}" y="{y + width // 2 + 4}" class="{ink}">{number}</text>'


def _text(loss: float | None) -> str:
    return "not known" if loss is None else f"{loss:.3f}"
