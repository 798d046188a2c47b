"""The table of a study: medians of each protocol, with bars."""

from __future__ import annotations

from collections.abc import Sequence

from nicegui import ui

from robochoc.app.studies.study import Line
from robochoc.app.texts import say


def show_lines(lines: Sequence[Line], *, worth: bool = False) -> None:
    """Show the medians of each protocol. `worth`: whether costs are utilities."""
    if not lines:
        return
    costs = any(line.cost for line in lines)
    most = max(1.0, *(line.messages for line in lines))
    heads = ["protocol", "messages", "ncccs", "bytes", *([("worth" if worth else "cost")] if costs else []), "finished"]
    with ui.element("div").classes("panel compare-lines"), ui.element("table"):
        with ui.element("caption"):
            ui.label(say("compare.medians"))
        with ui.element("thead"), ui.element("tr"):
            for head in heads:
                with ui.element("th").props("scope=col"):
                    ui.label(say(f"compare.head.{head}"))
        with ui.element("tbody"):
            for line in lines:
                _row(line, most, costs=costs)


def _row(line: Line, most: float, *, costs: bool) -> None:
    with ui.element("tr"):
        with ui.element("th").props("scope=row"):
            ui.label(line.protocol)
        with ui.element("td").classes("measured"):
            ui.label(_count(line.messages))
            with ui.element("div").classes("track").props("aria-hidden=true"):
                ui.element("div").classes("fill").style(f"width: {100 * line.messages / most:.1f}%")
        cells = [_count(line.ncccs), _count(line.bytes)]
        cells += [("-" if line.cost is None else _count(line.cost))] if costs else []
        for text in [*cells, say("compare.finished", finished=line.finished, runs=line.runs)]:
            with ui.element("td"):
                ui.label(text)


def _count(number: float) -> str:
    return f"{number:,.0f}" if number == int(number) else f"{number:,.1f}"
