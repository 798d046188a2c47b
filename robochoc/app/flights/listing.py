"""A run in one line, for a list of runs: time, purpose and verdict."""

from __future__ import annotations

from datetime import datetime

from robochoc.app.runs.run import Checked, Run, State
from robochoc.app.texts import say
from robochoc.model.cost_units import cost_shown

_PURPOSES = {"decide": "decide", "whatif": "whatif", "whatif-anew": "anew"}
_VERDICTS = frozenset({"solution", "optimal", "no-solution"})


def run_words(run: Run, now: datetime | None = None) -> str:
    """Return a run in a line.

    Args:
        run: The run.
        now: The local time; by default the present. The lines of runs on other days include the date.
    """
    began = datetime.fromtimestamp(run.record.started).astimezone()
    when = (
        f"{began:%H:%M}" if began.date() == (now or datetime.now().astimezone()).date() else f"{began:%Y-%m-%d %H:%M}"
    )
    return say("fly.run.line", when=when, purpose=purpose_words(run), verdict=_verdict(run))


def purpose_words(run: Run) -> str:
    """Return the purpose of a run in words."""
    key = "opened" if run.record.opened else _PURPOSES.get(run.record.purpose, "other")
    return say(f"fly.run.{key}")


def _verdict(run: Run) -> str:
    result = run.result
    if result is None:
        return say("fly.verdict.nothing")
    key = result.verdict if result.verdict in _VERDICTS else "stopped" if run.state == State.STOPPED else "limit"
    if key in {"stopped", "limit"} and not result.assignment:
        return say("fly.verdict.nothing")
    words = [say(f"fly.verdict.{key}")]
    if result.withdrawn:
        words.append(say("fly.verdict.aside", count=len(result.withdrawn)))
    if result.cost:
        words.append(
            say("fly.verdict.worth" if run.record.maximised else "fly.verdict.cost", cost=cost_shown(result.cost))
        )
    if run.record.checked in {Checked.BROKEN, Checked.COST}:
        words.append(say("fly.verdict.wrong"))
    return ", ".join(words)
