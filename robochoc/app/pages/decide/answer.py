"""An answer as a headline in words, a table of robots, and the costs of rules."""

from __future__ import annotations

from collections.abc import Mapping
from html import escape

from nicegui import run, ui

from robochoc.app.flights.answer_check import claim_words
from robochoc.app.imported.facts import ImportedFacts
from robochoc.app.pages.imported.answer import robots_of
from robochoc.app.runs.result import RunResult
from robochoc.app.runs.rule_costs import rule_costs, rules_with_costs
from robochoc.app.runs.run import Run, RunState
from robochoc.app.sketch.sentences import listed, sentence, value_words
from robochoc.app.sketch.sketch import Sketch
from robochoc.app.texts import say
from robochoc.model.cost_units import cost_shown

_WHOLE = frozenset({"solution", "optimal"})


def headline(run: Run, imported: ImportedFacts | None = None) -> str:
    """Return the outcome of a run in one or two sentences. `imported`: the facts about an imported team.

    For a run from an opened file, the text says that the file claims this outcome, and whether it was checked.
    """
    return claim_words(run, _headline(run, imported))


def _headline(run: Run, imported: ImportedFacts | None) -> str:
    result, sketch = run.result, run.sketch
    if run.state == RunState.FAILED:
        known = {"lost": "decide.lost", "broken": "decide.broken"}
        return say(known[run.message]) if run.message in known else say("decide.failed", why=run.message)
    if result is None:
        return say("decide.nothing-yet")
    if result.verdict == "no-solution":
        return say("decide.no-solution")
    if not result.assignment:
        return say("decide.nothing-yet")
    count = robots_of(imported, result) if imported else len(sketch.robots)
    costs = imported.costs if imported else bool(rules_with_costs(sketch))
    worth = imported is not None and imported.maximised
    words = [_who(count, result), _so_far(result, run.state)]
    words.append(_cost(result, worth=worth) if costs else "")
    words.append(_bound(run, result, imported, worth=worth) if costs or run.record.options.withdraw else "")
    return " ".join(filter(None, words))


def _who(count: int, result: RunResult) -> str:
    if result.withdrawn:
        aside = listed(result.withdrawn)
        fewest = "decide.aside-fewest" if result.verdict == "optimal" else "decide.aside"
        return say(fewest, count=count - len(result.withdrawn), all=count, aside=aside)
    return say("decide.one") if count == 1 else say("decide.all", count=count)


def _so_far(result: RunResult, state: RunState) -> str:
    if result.verdict in _WHOLE:
        return ""
    return say("decide.stopped") if state == RunState.STOPPED else say("decide.limit")


def _cost(result: RunResult, *, worth: bool) -> str:
    """Return the cost of an answer, or its utility if `worth`; of a Pareto front, the costs of the chosen point."""
    if result.front or result.cost is None:
        return result.point_in_words
    if result.verdict == "optimal" and not result.withdrawn:
        key = "imported.worth-proven" if worth else "decide.proven"
    else:
        key = "imported.worth" if worth else "decide.best"
    return say(key, cost=cost_shown(result.cost))


def _bound(run: Run, result: RunResult, imported: ImportedFacts | None, *, worth: bool) -> str:
    """Return the lower bound on the cost, or on the number of robots that must withdraw."""
    if result.verdict in _WHOLE or result.bound is None:
        return ""
    if not run.record.options.withdraw:
        return say("imported.worth-bound" if worth else "decide.bound", bound=cost_shown(result.bound))
    if result.bound <= 0:
        return ""
    robots = imported.robots if imported else run.sketch.robots
    weighted = any(robot.weight != 1 for robot in robots)
    return say("decide.aside-bound-weight" if weighted else "decide.aside-bound", bound=cost_shown(result.bound))


def effort(run: Run) -> str:
    """Return the protocol, runtime, number of messages and time of a run, in words."""
    result = run.result
    if result is None:
        return say("decide.took-time", seconds=f"{run.seconds:.1f}")
    runtime = say("decide.runtime-processes" if result.runtime == "processes" else "decide.runtime-simulator")
    return say(
        "decide.took",
        protocol=result.protocol,
        runtime=runtime,
        messages=f"{result.messages:,}",
        seconds=f"{result.metrics.wall_s:.2g}",
    )


def table_html(sketch: Sketch, result: RunResult) -> str:
    """Return each robot's decisions as a table. Names given by users are escaped."""
    heads = "".join(f'<th scope="col">{escape(decision.name)}</th>' for decision in sketch.decisions)
    rows = []
    for robot in sketch.robots:
        cells = []
        for decision in sketch.decisions:
            value = result.value(robot.name, decision.name)
            cells.append("" if value is None else value_words(sketch, decision, value))
        if robot.name in result.withdrawn:
            cells = [say("decide.steps-aside"), *[""] * (len(cells) - 1)]
        row = "".join(f"<td>{escape(cell)}</td>" for cell in cells)
        rows.append(f'<tr><th scope="row">{escape(robot.name)}</th>{row}</tr>')
    return (
        f"<table><caption>{escape(say('decide.table'))}</caption><thead><tr>"
        f'<th scope="col">{escape(say("decide.robot"))}</th>{heads}</tr></thead><tbody>{"".join(rows)}</tbody></table>'
    )


MOST_BARS = 40
"""The maximum number of rules with a bar. The costs of the other rules are added up on one line."""


async def show_costs(where: ui.element, sketch: Sketch, result: RunResult) -> None:
    """Fill `where` with the costs of rules, if there are any. The costs are computed in a thread."""
    costs = await run.io_bound(rule_costs, sketch, result.values)
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
