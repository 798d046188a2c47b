"""The answer of an imported team: texts at robots, tables, and the epochs."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from html import escape

from robochoc.app.foreign.facts import Facts
from robochoc.app.runs.result import RunResult, robots_in
from robochoc.app.sketch.sketch import Value
from robochoc.app.texts import say

MOST_ROWS = 300
"""The maximum number of rows of a table."""
MOST_EPOCHS = 40
_MOST_AT_ONE = 3
"""The maximum number of values at a robot in the picture."""
_LONGEST = 160
_VERDICTS = frozenset({"solution", "optimal", "no-solution", "unknown"})


def says_of(facts: Facts, values: Mapping[str, Value]) -> dict[str, str]:
    """Return each robot's decisions in short, by its name."""
    said: dict[str, str] = {}
    for robot in facts.robots:
        own = [str(values[one.variable]) for one in robot.decides if one.variable in values]
        if own:
            said[robot.name] = " · ".join(own[:_MOST_AT_ONE]) + (" …" if len(own) > _MOST_AT_ONE else "")
    return said


def robots_of(facts: Facts, result: RunResult) -> int:
    """Return the number of robots in the last epoch."""
    return len(robots_in(result.epochs[-1])) if result.epochs else len(facts.there)


def table_html(facts: Facts, result: RunResult) -> str:
    """Return each robot's decisions as a table. Names from files are escaped."""
    return _table(facts, result.assignment, frozenset(result.withdrawn))


def epochs_html(facts: Facts, result: RunResult) -> str:
    """Return the list of epochs with their events and verdicts. Names are escaped."""
    parts = []
    for number, epoch in enumerate(result.epochs[:MOST_EPOCHS]):
        verdict = str(epoch.get("verdict"))
        known = say(f"foreign.verdict.{verdict}") if verdict in _VERDICTS else verdict
        happened = facts.events[number - 1] if 0 < number <= len(facts.events) else ""
        title = happened or say("foreign.epoch", opened=_cut(str(epoch.get("opened_by", ""))))
        told = say("foreign.epoch-took", robots=len(robots_in(epoch)), messages=epoch.get("messages", 0))
        assignment = epoch.get("assignment")
        table = _table(facts, assignment, frozenset()) if isinstance(assignment, dict) and assignment else ""
        head = f"<b>{escape(title)}</b> {escape(known)} <span class='soft'>{escape(told)}</span>"
        parts.append(f"<li><details><summary>{head}</summary>{table}</details></li>" if table else f"<li>{head}</li>")
    if (more := len(result.epochs) - MOST_EPOCHS) > 0:
        parts.append(f"<li>{escape(say('foreign.more', count=more))}</li>")
    return f"<ol>{''.join(parts)}</ol>"


def _table(facts: Facts, values: Mapping[str, Value], aside: frozenset[str]) -> str:
    rows = []
    for robot in facts.robots:
        if robot.name in aside:
            rows.append((robot.name, "", say("decide.steps-aside")))
        rows += [
            (robot.name, one.variable, str(values[one.variable])) for one in robot.decides if one.variable in values
        ]
    heads = say("decide.robot"), say("foreign.decision"), say("foreign.value")
    more = len(rows) - MOST_ROWS
    rest = f"<p class='soft'>{escape(say('foreign.more', count=f'{more:,}'))}</p>" if more > 0 else ""
    return rows_html(say("decide.table"), heads, rows[:MOST_ROWS]) + rest


def rows_html(caption: str, heads: Iterable[str], rows: Iterable[Iterable[str]]) -> str:
    """Return a table whose rows begin with a heading. All texts are escaped."""
    head = "".join(f'<th scope="col">{escape(one)}</th>' for one in heads)
    body = "".join(_row(*row) for row in rows)
    return f"<table><caption>{escape(caption)}</caption><thead><tr>{head}</tr></thead><tbody>{body}</tbody></table>"


def _row(name: str, *cells: str) -> str:
    told = "".join(f"<td>{escape(cell)}</td>" for cell in cells)
    return f'<tr><th scope="row">{escape(name)}</th>{told}</tr>'


def _cut(text: str) -> str:
    return text if len(text) <= _LONGEST else f"{text[: _LONGEST - 1]}…"
