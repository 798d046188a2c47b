"""Records the runs of a lesson in the simulator. `robochoc app` does not use this module."""

from __future__ import annotations

from collections import defaultdict
from itertools import pairwise

import robochoc
from robochoc.app.lessons.lesson import ROBOTS, Lesson, RunSpec, TeamSpec
from robochoc.app.lessons.recording import LessonMessage, LessonRun, LessonTurn
from robochoc.journal.entries import Header
from robochoc.journal.events import AnyEvent
from robochoc.modelling.model import Model
from robochoc.replay import states_of
from robochoc.run.choice import choose
from robochoc.run.options import Options
from robochoc.sniffer.page_data import PageData
from robochoc.sniffer.trace import Trace

LEVEL = "level"
AUTO = "auto"


def recorded(lesson: Lesson) -> dict[str, LessonRun]:
    """Execute the runs of a lesson, and return their recordings."""
    return {name: _recorded(lesson.teams[run.team], run) for name, run in lesson.runs.items()}


def model_of(spec: TeamSpec) -> Model:
    """Return the model of a team."""
    model = robochoc.Model("lesson")
    names = [f"R{place + 1}" for place in range(spec.chain)] if spec.chain else ROBOTS
    robots = {name: model.robot(name, priority=len(names) - place) for place, name in enumerate(names)}
    level = {name: robots[name].variable(LEVEL, list(spec.levels(name))) for name in names}
    for one, other in pairwise(names) if spec.chain else spec.apart:
        rule = level[one] != level[other]
        if spec.partly_known:
            robots[one].knows(rule)
        else:
            model.add(rule, cost=spec.broken_costs or None)
    if spec.low:
        model.minimize(sum(level.values()))
    if spec.changes:
        model.after_solution().remove_value(level[names[-1]], spec.values[-1])
    return model


def _recorded(spec: TeamSpec, run: RunSpec) -> LessonRun:
    model = model_of(spec)
    if run.protocol == AUTO:
        choice = choose(model.team, Options(protocol=AUTO))
        return LessonRun(choice.options.protocol, choice.options.chosen["protocol"])
    events: list[AnyEvent] = []
    found = model.solve(
        run.protocol,
        "simulator",
        order=ROBOTS,
        settings=run.settings,
        seed=run.seed,
        schedule=run.schedule,
        observer=events.append,
    )
    events.sort(key=lambda event: event.t)
    messages, turns = _messages_and_turns(events, run)
    return LessonRun(
        run.protocol,
        messages=messages,
        turns=turns,
        verdict=str(found.verdict),
        cost=None if found.cost is None else int(found.cost),
    )


def _messages_and_turns(
    events: list[AnyEvent], run: RunSpec
) -> tuple[tuple[LessonMessage, ...], tuple[LessonTurn, ...]]:
    """Return the messages and turns, in the words used by the sniffer and the replay."""
    header = Header(team="lesson", protocol=run.protocol, runtime="simulator", seed=run.seed)
    trace = Trace(header)
    trace.add(events)
    trace.end()
    why = {robot: [tuple(state.why) for state in states_of(events, robot, header=header)] for robot in ROBOTS}
    decisions, done, levels = dict(trace.decisions), defaultdict[str, int](int), dict[str, int]()
    turns = []
    for step in range(min(run.turns or len(trace.steps.t), len(trace.steps.t))):
        robot = trace.robots[trace.steps.robot[step]]
        if step in decisions:
            levels[robot] = decisions[step][f"{robot}.{LEVEL}"]
        reasons = why[robot][done[robot]] if step in decisions else ()
        done[robot] += 1
        turns.append(
            LessonTurn(robot, tuple(trace.packet(step)), tuple(trace.sent_in(step)), levels.get(robot), reasons)
        )
    data = PageData(trace)
    count = max((*turns[-1].said, *(one for turn in turns for one in (*turn.said, *turn.heard))), default=-1) + 1
    return tuple(_message(data, one) for one in range(count)), tuple(turns)


def _message(data: PageData, number: int) -> LessonMessage:
    trace, of = data.trace, data.trace.messages
    sender, to = trace.robots[of.sender[number]], trace.robots[of.receiver[number]]
    return LessonMessage(sender, to, trace.kinds[of.kind[number]], data.words(number).removeprefix(f"{sender} says: "))
