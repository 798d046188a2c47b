"""The robots that fly in a run, and the reasons why others do not."""

from __future__ import annotations

from collections.abc import Iterator

from robochoc.app.flights.flight_map import changed_to
from robochoc.app.runs.result import RunResult
from robochoc.app.runs.run import Run
from robochoc.app.sketch.sketch import Kind, Sketch
from robochoc.app.sketch.words import listed
from robochoc.app.texts import say

SENT_BY = frozenset({Kind.LEVEL, Kind.PLACE})
"""The kinds of decisions that are positions of robots."""


def flying_robots_words(run: Run) -> list[str]:
    """Return sentences on the number of flying robots, and on the others; none if no robot flies, or it is not known.

    Raises as `Run.sketch`.
    """
    before = run.sketch
    after = changed_to(run) or before
    if run.result is None or not run.result.assignment or not before.decisions:
        return []
    return [*_sentences(before, after, run.result)]


def _sentences(before: Sketch, after: Sketch, result: RunResult) -> Iterator[str]:
    names = [robot.name for robot in after.robots]
    left = [robot.name for robot in before.robots if robot.name not in {*names}]
    sent = {
        name for decision in after.decisions if decision.kind in SENT_BY for name in after.deciders(decision)
        if result.value(name, decision.name) is not None
    }  # fmt: skip
    aside = [name for name in names if name in {*result.withdrawn}]
    still = [name for name in names if name not in sent and name not in {*aside}]
    flying = len(names) - len(aside) - len(still)
    if not flying:
        return
    if not (aside or still or left):
        yield say("fly.who.all", count=flying) if flying > 1 else say("fly.who.one", name=names[0])
        return
    yield say("fly.who.some", flying=flying, count=len(names) + len(left))
    for key, who in (("aside", aside), ("left", left), ("still", still)):
        if who:
            yield say(f"fly.who.{key}", names=listed(who))
