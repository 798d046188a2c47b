"""An answer as a headline in words, and as a table of robots."""

from __future__ import annotations

from html import escape

from robochoc.app.flights.answer_check import claim_words
from robochoc.app.foreign.facts import Facts
from robochoc.app.pages.foreign.answer import robots_of
from robochoc.app.runs.result import RunResult
from robochoc.app.runs.rule_costs import rules_with_costs
from robochoc.app.runs.run import Run, State
from robochoc.app.sketch.sketch import Sketch
from robochoc.app.sketch.words import listed, value_words
from robochoc.app.texts import say
from robochoc.model.cost_units import cost_shown

_WHOLE = frozenset({"solution", "optimal"})


def headline(run: Run, foreign: Facts | None = None) -> str:
    """Return the outcome of a run in one or two sentences. `foreign`: the facts about an imported team.

    For a run from an opened file, the text says that it is a claim of the file, and whether it was checked.
    """
    return claim_words(run, _headline(run, foreign))


def _headline(run: Run, foreign: Facts | None) -> str:
    result, sketch = run.result, run.sketch
    if run.state == State.FAILED:
        known = {"lost": "decide.lost", "broken": "decide.broken"}
        return say(known[run.message]) if run.message in known else say("decide.failed", why=run.message)
    if result is None:
        return say("decide.nothing-yet")
    if result.verdict == "no-solution":
        return say("decide.no-solution")
    if not result.assignment:
        return say("decide.nothing-yet")
    count = robots_of(foreign, result) if foreign else len(sketch.robots)
    costs = foreign.costs if foreign else bool(rules_with_costs(sketch))
    worth = foreign is not None and foreign.maximised
    words = [_who(count, result), _so_far(result, run.state)]
    words.append(_cost(result, worth=worth) if costs else "")
    words.append(_bound(run, result, foreign, worth=worth) if costs or run.record.options.withdraw else "")
    return " ".join(filter(None, words))


def _who(count: int, result: RunResult) -> str:
    if result.withdrawn:
        aside = listed(result.withdrawn)
        fewest = "decide.aside-fewest" if result.verdict == "optimal" else "decide.aside"
        return say(fewest, count=count - len(result.withdrawn), all=count, aside=aside)
    return say("decide.one") if count == 1 else say("decide.all", count=count)


def _so_far(result: RunResult, state: State) -> str:
    if result.verdict in _WHOLE:
        return ""
    return say("decide.stopped") if state == State.STOPPED else say("decide.limit")


def _cost(result: RunResult, *, worth: bool) -> str:
    """Return the cost of an answer, or its `worth`."""
    if result.cost is None:
        return ""
    if result.verdict == "optimal" and not result.withdrawn:
        key = "foreign.worth-proven" if worth else "decide.proven"
    else:
        key = "foreign.worth" if worth else "decide.best"
    return say(key, cost=cost_shown(result.cost))


def _bound(run: Run, result: RunResult, foreign: Facts | None, *, worth: bool) -> str:
    """Return the lower bound of the cost, or of the number of robots that must withdraw."""
    if result.verdict in _WHOLE or result.bound is None:
        return ""
    if not run.record.options.withdraw:
        return say("foreign.worth-bound" if worth else "decide.bound", bound=cost_shown(result.bound))
    if result.bound <= 0:
        return ""
    robots = foreign.robots if foreign else run.sketch.robots
    weighted = any(robot.weight != 1 for robot in robots)
    return say("decide.aside-bound-weight" if weighted else "decide.aside-bound", bound=cost_shown(result.bound))


def effort(run: Run) -> str:
    """Return the protocol, runtime, messages and time of a run, in words."""
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
