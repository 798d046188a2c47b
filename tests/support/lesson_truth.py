"""Whether what a lesson's choice claims is true: by the recorded run, or by trying all levels of the team.

What a step asks about is its `about`:

    next                what the robot of the next turn says or takes
    told WORDS          whom it tells these words
    levels              a solution, the cheapest if there are costs
    solutions           their number
    rule A B            in whose files this rule stands
    neighbours A        who shares a rule with A
    hears WORDS         who gets these words in any message of the run
    children A          whom A has given the token of the tree
    least A B | C=1     the least cost of what A and B have to do with, if C is at level 1
    broken, cost        of the levels at this turn: broken rules; what they cost in all
    gain A              what A saves at most by a move of its own, at this turn
    best                what the best levels cost
    protocol            the choice of `auto`
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from itertools import product

from robochoc.app.lessons.lesson import ROBOTS, AnswerChoice, Lesson, LessonStep, TeamSpec
from robochoc.app.lessons.record import model_of
from robochoc.app.lessons.recording import LessonRun, LessonTurn


def is_true(lesson: Lesson, runs: Mapping[str, LessonRun], step: LessonStep, choice: AnswerChoice) -> bool:
    """Return whether what the choice claims is so."""
    kind, _, rest = step.about.partition(" ")
    team = lesson.team_of(step)
    run = runs.get(step.run, LessonRun(""))
    if kind == "next":
        return _next(run, run.turns[step.turn], choice, step.turn)
    if kind == "levels":
        return _is_best(team, choice.levels)
    if kind == "protocol":
        return run.protocol == choice.protocol
    if kind in _ROBOTS:
        assert choice.robots is not None
        return {*choice.robots} == _ROBOTS[kind](team, run, step, rest)
    assert choice.number is not None
    return choice.number == _NUMBERS[kind](team, run.levels(step.turn), rest)


def breaks(team: TeamSpec, choice: AnswerChoice) -> bool:
    """Return whether the two that a wrong choice names are joined by a rule, and at the same level in it."""
    assert choice.breaks is not None
    one, other = choice.breaks
    return choice.breaks in team.apart and choice.levels[one] == choice.levels[other]


def _next(run: LessonRun, turn: LessonTurn, choice: AnswerChoice, number: int) -> bool:
    if choice.words:
        return any((run.messages[one].to, run.messages[one].words) == (choice.to, choice.words) for one in turn.said)
    if choice.silent:
        return not turn.said
    if choice.undecided:
        return turn.level == run.levels(number).get(turn.robot)
    assert choice.takes is not None
    return turn.level == choice.takes


# Who


def _told(_: TeamSpec, run: LessonRun, step: LessonStep, words: str) -> set[str]:
    said = (run.messages[one] for one in run.turns[step.turn].said)
    return {one.to for one in said if words in one.words}


def _hears(_: TeamSpec, run: LessonRun, step: LessonStep, words: str) -> set[str]:
    del step
    return {one.to for one in run.messages if f"{words.strip()} " in one.words}


def _knows(team: TeamSpec, run: LessonRun, step: LessonStep, pair: str) -> set[str]:
    del run, step
    files = model_of(team).team
    return {
        robot.name
        for robot in files.robots
        for rule in robot.constraints()
        if {str(name).partition(".")[0] for name in rule.scope} == {*pair.split()}
    }


def _neighbours(team: TeamSpec, run: LessonRun, step: LessonStep, name: str) -> set[str]:
    del run, step
    return {robot for pair in team.apart if name in pair for robot in pair} - {name}


def _children(_: TeamSpec, run: LessonRun, step: LessonStep, name: str) -> set[str]:
    del step
    return {one.to for one in run.messages if one.sender == name and one.kind == "Token"}


_ROBOTS: dict[str, Callable[[TeamSpec, LessonRun, LessonStep, str], set[str]]] = {
    "told": _told, "hears": _hears, "rule": _knows, "neighbours": _neighbours, "children": _children,
}  # fmt: skip


# How much


def _all(team: TeamSpec) -> Iterator[dict[str, int]]:
    for levels in product(*(team.levels(robot) for robot in ROBOTS)):
        yield dict(zip(ROBOTS, levels, strict=True))


def _broken(team: TeamSpec, levels: Mapping[str, int], _: str = "") -> int:
    return sum(levels[one] == levels[other] for one, other in team.apart)


def _cost(team: TeamSpec, levels: Mapping[str, int], _: str = "") -> int:
    return team.broken_costs * _broken(team, levels) + team.low * sum(levels.values())


def _is_best(team: TeamSpec, levels: Mapping[str, int]) -> bool:
    if not team.broken_costs:
        return not _broken(team, levels)
    return _cost(team, levels) == _best(team)


def _best(team: TeamSpec, *_: object) -> int:
    return min(_cost(team, levels) for levels in _all(team))


def _solutions(team: TeamSpec, *_: object) -> int:
    return sum(not _broken(team, levels) for levels in _all(team))


def _least(team: TeamSpec, _: Mapping[str, int], said: str) -> int:
    inside, above = said.split(" | ")
    own = inside.split()
    given = {name: int(level) for name, _, level in (one.partition("=") for one in above.split())}
    rules = [pair for pair in team.apart if {*pair} & {*own} and {*pair} <= {*own, *given}]
    costs = []
    for levels in product(*(team.levels(robot) for robot in own)):
        all_of = {**given, **dict(zip(own, levels, strict=True))}
        broken = sum(all_of[one] == all_of[other] for one, other in rules)
        costs.append(team.broken_costs * broken + team.low * sum(levels))
    return min(costs)


def _gain(team: TeamSpec, levels: Mapping[str, int], robot: str) -> int:
    return _cost(team, levels) - min(_cost(team, {**levels, robot: level}) for level in team.levels(robot))


_NUMBERS: dict[str, Callable[[TeamSpec, Mapping[str, int], str], int]] = {
    "broken": _broken, "cost": _cost, "best": _best, "solutions": _solutions, "least": _least, "gain": _gain,
}  # fmt: skip
