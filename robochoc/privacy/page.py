"""The privacy loss of a run as a page that needs nothing else: for each kind of secrets, who knows how much of whom."""

from __future__ import annotations

import html
from collections.abc import Iterator, Mapping

from robochoc.model.wording import counted, listed
from robochoc.privacy.losses import Kind, Measure, PrivacyReport

_CELL, _LABELS, _FONT = 34, 120, 12
MOST_NUMBERED = 40
"""With more robots the cells are too many for numbers in them."""
_DARK = 0.55
"""From this loss on a cell is so dark that its number is white."""
_STYLE = """
:root { color-scheme: light dark; }
body { font: 16px/1.5 system-ui, sans-serif; max-width: 72rem; margin: 0 auto; padding: 1rem; }
h1 { font-size: 1.6rem; } h2 { font-size: 1.2rem; margin-top: 2.2rem; }
figure { margin: 0; overflow-x: auto; } figcaption { font-size: .85rem; opacity: .8; }
figure svg { background: #fff; border-radius: 4px; }
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
    """Return the page, with a heat map by `measure` for each kind of secrets."""
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
    yield f"<p>{run}{robots}. 0: nothing is excluded; 1: all is known. Losses are lower bounds.</p>"
    if report.without_rule:
        types = html.escape(listed(report.without_rule))
        yield f"<p>Not known, where one of these messages was heard, as they have no rule: {types}.</p>"
    if report.undecided:
        yield f"<p>No decisions: {html.escape(report.undecided)}.</p>"
    yield _systems(report)
    for kind in report.kinds():
        yield f"<h2>{kind.capitalize()}: {_SECRETS[kind]}</h2>"
        caption = f"Loss by {measure}. A row for each robot that has secrets, a column for each observer."
        yield f"<figure>{heat_map(report, kind, measure)}<figcaption>{caption}</figcaption></figure>"


def _systems(report: PrivacyReport) -> str:
    heads = "".join(f"<th>{measure}</th>" for measure in Measure)
    rows = "".join(
        f"<tr><td>{kind}</td>{''.join(f'<td>{_text(report.system_loss(kind, one))}</td>' for one in Measure)}</tr>"
        for kind in report.kinds()
    )
    return f"<table><thead><tr><th>System loss</th>{heads}</tr></thead><tbody>{rows}</tbody></table>"


def heat_map(report: PrivacyReport, kind: Kind, measure: Measure) -> str:
    """Return an SVG with a cell for each pair of a subject (row) and an observer (column)."""
    found = {(loss.subject, loss.observer): loss.by(measure) for loss in report.losses if loss.kind is kind}
    size = _LABELS + _CELL * len(report.robots)
    parts = [*_labels(report), *_cells(report, found)]
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" width="{size}" height="{size}" viewBox="0 0 {size} {size}"'
        f' role="img" font-family="system-ui, sans-serif" font-size="{_FONT}">'
        f"<title>{html.escape(f'Loss of {kind} by {measure}')}</title>{''.join(parts)}</svg>"
    )


def _labels(report: PrivacyReport) -> Iterator[str]:
    for place, robot in enumerate(report.robots):
        name = html.escape(robot if len(robot) <= _FONT else f"{robot[: _FONT - 1]}…")
        middle = _LABELS + _CELL * place + _CELL // 2
        yield f'<text x="{_LABELS - 6}" y="{middle + 4}" text-anchor="end">{name}</text>'
        yield f'<text transform="translate({middle + 4} {_LABELS - 6}) rotate(-90)">{name}</text>'


def _cells(report: PrivacyReport, found: Mapping[tuple[str, str], float | None]) -> Iterator[str]:
    for row, subject in enumerate(report.robots):
        for column, observer in enumerate(report.robots):
            pair = (subject, observer)
            if pair not in found:
                continue
            loss = found[pair]
            x, y = _LABELS + _CELL * column, _LABELS + _CELL * row
            told = html.escape(f"{observer} of {subject}: {_text(loss)}")
            yield (
                f'<g><title>{told}</title><rect x="{x}" y="{y}" width="{_CELL - 1}" height="{_CELL - 1}"'
                f' fill="{_colour(loss)}"/>'
            )
            if len(report.robots) <= MOST_NUMBERED:
                ink = "#fff" if loss is not None and loss >= _DARK else "#222"
                number = "?" if loss is None else f"{loss:.2f}"
                yield (
                    f'<text x="{x + _CELL // 2}" y="{y + _CELL // 2 + 4}" text-anchor="middle" font-size="10"'
                    f' fill="{ink}">{number}</text>'
                )
            yield "</g>"


def _colour(loss: float | None) -> str:
    """Return from near white (no loss) to dark red (all is known); grey: not known."""
    if loss is None:
        return "#ccc"
    red, green, blue = (round(start + (end - start) * loss) for start, end in ((253, 140), (245, 20), (240, 30)))
    return f"#{red:02x}{green:02x}{blue:02x}"


def _text(loss: float | None) -> str:
    return "not known" if loss is None else f"{loss:.3f}"
