"""An answer in words, and robot by robot."""

from __future__ import annotations

from html import escape

from robochoc.app.runs.paid import costly
from robochoc.app.runs.result import RunResult
from robochoc.app.runs.run import Run, State
from robochoc.app.sketch.sketch import Sketch
from robochoc.app.sketch.words import listed, value_words
from robochoc.app.texts import say


def headline(run: Run) -> str:
    """Return what came of a run, in a sentence or two."""
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
    return " ".join(filter(None, [_who(sketch, result), _cost(sketch, result, run.state)]))


def _who(sketch: Sketch, result: RunResult) -> str:
    count = len(sketch.robots)
    if result.withdrawn:
        aside = listed(result.withdrawn)
        fewest = "decide.aside-fewest" if result.verdict == "optimal" else "decide.aside"
        return say(fewest, count=count - len(result.withdrawn), all=count, aside=aside)
    return say("decide.one") if count == 1 else say("decide.all", count=count)


def _cost(sketch: Sketch, result: RunResult, state: State) -> str:
    best = say("decide.best", cost=result.cost) if result.cost is not None and costly(sketch) else ""
    if result.verdict == "optimal":
        if result.withdrawn:
            return best
        return "" if result.cost is None else say("decide.proven", cost=result.cost)
    if result.verdict == "solution":
        return best
    bound = "" if result.bound is None else say("decide.bound", bound=result.bound)
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
