"""The costs of rules in an answer: a bar for each rule, and the sum."""

from __future__ import annotations

from collections.abc import Mapping

from nicegui import run, ui

from robochoc.app.runs.result import RunResult
from robochoc.app.runs.rule_costs import rule_costs
from robochoc.app.sketch.sketch import Sketch
from robochoc.app.sketch.words import sentence
from robochoc.app.texts import say
from robochoc.model.cost_units import cost_shown

MOST_BARS = 40
"""The maximum number of rules with a bar; the cost of the others is summed up in one line."""


async def show_costs(where: ui.element, sketch: Sketch, result: RunResult) -> None:
    """Fill `where` with the costs of rules, if there are any. They are computed in a thread."""
    costs = await run.io_bound(rule_costs, sketch, result.assignment)
    if not costs or where.is_deleted:
        return
    with where, ui.element("section").classes("panel costs"):
        with ui.element("h2"):
            ui.label(say("decide.costs"))
        if result.withdrawn:
            ui.label(say("decide.costs-aside")).classes("soft")
        _bars(sketch, costs)


def _bars(sketch: Sketch, costs: Mapping[str, int]) -> None:
    highest_first = sorted(costs.items(), key=lambda item: -item[1])
    most = max(1, *costs.values())
    with ui.element("ul").classes("rules"):
        for name, cost in highest_first[:MOST_BARS]:
            rule = sketch.rule(name)
            _bar(f"{name}: {sentence(sketch, rule)}" if rule else name, cost, most)
        if rest := highest_first[MOST_BARS:]:
            _bar(say("decide.other-rules", count=len(rest)), sum(cost for _, cost in rest), most)
    with ui.element("p").classes("together"):
        ui.label(say("decide.together", cost=cost_shown(sum(costs.values()))))


def _bar(words: str, cost: int, most: int) -> None:
    with ui.element("li"):
        ui.label(words).classes("words")
        with ui.element("div").classes("track").props("aria-hidden=true"):
            ui.element("div").classes("fill").style(f"width: {min(100.0, 100 * cost / most):.1f}%")
        says = say("decide.rule-paid", cost=cost_shown(cost)) if cost else say("decide.rule-kept")
        ui.label(says).classes("cost-paid" if cost else "soft")
