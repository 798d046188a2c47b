"""An answer in words, and robot by robot."""

from __future__ import annotations

from html import escape

from robochoc.app.foreign.facts import Facts
from robochoc.app.pages.foreign.answer import robots_of
from robochoc.app.runs.paid import costly
from robochoc.app.runs.result import RunResult
from robochoc.app.runs.run import Run, State
from robochoc.app.sketch.sketch import Sketch
from robochoc.app.sketch.words import listed, value_words
from robochoc.app.texts import say


def headline(run: Run, foreign: Facts | None = None) -> str:
    """Return what came of a run, in a sentence or two. `foreign`: what is known of a team that was not drawn here."""
    result, sketch = run.result, run.sketch
    if run.state is State.FAILED:
        known = {"lost": "decide.lost", "broken": "decide.broken"}
        return say(known[run.message]) if run.message in known else say("decide.failed", why=run.message)
    if result is None:
        return say("decide.nothing-yet")
    if result.verdict == "no-solution":
        return say("decide.no-solution")
    if not result.assignment:
        return say("decide.nothing-yet")
    count = robots_of(foreign, result) if foreign else len(sketch.robots)
    costs = foreign.costs if foreign else bool(costly(sketch))
    worth = foreign is not None and foreign.maximised
    return " ".join(filter(None, [_who(count, result), _cost(result, run.state, costs=costs, worth=worth)]))


def _who(count: int, result: RunResult) -> str:
    if result.withdrawn:
        aside = listed(result.withdrawn)
        fewest = "decide.aside-fewest" if result.verdict == "optimal" else "decide.aside"
        return say(fewest, count=count - len(result.withdrawn), all=count, aside=aside)
    return say("decide.one") if count == 1 else say("decide.all", count=count)


def _cost(result: RunResult, state: State, *, costs: bool, worth: bool) -> str:
    """Return what an answer costs, or is `worth`, and how good that is."""
    best = (
        say("foreign.worth" if worth else "decide.best", cost=result.cost) if result.cost is not None and costs else ""
    )
    if result.verdict == "optimal":
        if result.withdrawn:
            return best
        return (
            "" if result.cost is None else say("foreign.worth-proven" if worth else "decide.proven", cost=result.cost)
        )
    if result.verdict == "solution":
        return best
    above = "foreign.worth-bound" if worth else "decide.bound"
    bound = "" if result.bound is None else say(above, bound=result.bound)
    stopped = say("decide.stopped") if state is State.STOPPED else say("decide.limit")
    return " ".join(filter(None, [stopped, best, bound]))


def took(run: Run) -> str:
    """Return what it took, in words."""
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
    """Return what each robot has decided, as a table. All that users have named is escaped in it."""
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
