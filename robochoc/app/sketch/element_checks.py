"""Checks of names, sizes and numbers in a sketch. Edits respect these bounds, but files may not."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator, Sequence

from robochoc.app.sketch import sketch as limits
from robochoc.app.sketch.sketch import NUMBERED, Decision, DecisionKind, Setting, Sketch
from robochoc.app.sketch.troubles import About, Severity, Trouble, shortened
from robochoc.formats.names import MAX_WEIGHT, RESERVED, is_name

MAX_NUMBER = 1_000_000
"""The largest absolute value of a number in a decision."""

_FURTHEST = 10**12
"""The largest absolute value of any number in a readable sketch. Browsers represent such numbers exactly."""
_LONGEST = 10_000
"""The maximum length of any text in a readable sketch."""


def check_bounds(sketch: Sketch) -> Iterator[Trouble]:
    """Yield the exceeded bounds in a sketch. The other checks require that the sketch is within the bounds."""
    if not is_label(sketch.name):
        yield Trouble(About.TEAM, "team", "trouble.team-name", {"name": shortened(sketch.name)})
    area = sketch.area
    if not (1 <= area.columns <= limits.MAX_SIDE and 1 <= area.rows <= limits.MAX_SIDE):
        yield Trouble(About.MAP, "map", "trouble.map-size", {"most": limits.MAX_SIDE})
    counts = (
        ("robots", len(sketch.robots), limits.MAX_ROBOTS),
        ("decisions", len(sketch.decisions), limits.MAX_DECISIONS),
        ("rules", len(sketch.rules), limits.MAX_RULES),
    )
    for what, count, most in counts:
        if count > most:
            sizes: dict[str, str | int] = {"count": count, "most": most}
            yield Trouble(About.TEAM, "team", f"trouble.too-many-{what}", sizes)
    for decision in sketch.decisions:
        if len(decision.values) > limits.MAX_VALUES:
            named: dict[str, str | int] = {"name": shortened(decision.name), "most": limits.MAX_VALUES}
            yield Trouble(About.DECISION, decision.name, "trouble.too-many-values", named)


def is_label(name: str) -> bool:
    """Return whether `name` is a valid name of a team, a robot, a decision, or a rule."""
    return is_name(name) and name != RESERVED and len(name) <= limits.MAX_LABEL


def check_names(sketch: Sketch) -> Iterator[Trouble]:
    """Yield invalid and duplicate names."""
    groups: tuple[tuple[About, list[str]], ...] = (
        (About.ROBOT, [robot.name for robot in sketch.robots]),
        (About.DECISION, [decision.name for decision in sketch.decisions]),
        (About.RULE, [rule.id for rule in sketch.rules]),
    )
    for about, names in groups:
        for name, count in Counter(names).items():
            if not is_label(name):
                yield Trouble(about, name, f"trouble.{about}-name", {"name": shortened(name)})
            if count > 1:
                yield Trouble(about, name, f"trouble.{about}-twice", {"name": shortened(name)})
    yield from _clashes(sketch)


def _clashes(sketch: Sketch) -> Iterator[Trouble]:
    """Yield decisions whose variable names are ambiguous: `C` for robot `A.B`, and `B.C` for robot `A`."""
    if not any("." in decision.name for decision in sketch.decisions):
        return
    known: set[str] = set()
    for decision in sketch.decisions:
        own = {f"{name}.{decision.name}" for name in sketch.deciders(decision)}
        if own & known:
            yield Trouble(About.DECISION, decision.name, "trouble.decision-clash", {"name": shortened(decision.name)})
        known |= own


def check_robots(sketch: Sketch) -> Iterator[Trouble]:
    """Yield errors in robots."""
    if not sketch.robots:
        yield Trouble(About.MAP, "map", "trouble.no-robots")
    elif not sketch.decisions:
        yield Trouble(About.TEAM, "team", "trouble.no-decisions")
    busy = {name for decision in sketch.decisions for name in sketch.deciders(decision)}
    for robot in sketch.robots:
        named: dict[str, str | int] = {"name": shortened(robot.name)}
        if sketch.decisions and robot.name not in busy:
            yield Trouble(About.ROBOT, robot.name, "trouble.robot-idle", named)
        if not 1 <= robot.weight <= MAX_WEIGHT:
            yield Trouble(About.ROBOT, robot.name, "trouble.robot-weight", named | {"most": MAX_WEIGHT})
        if abs(robot.rank) > MAX_WEIGHT:
            yield Trouble(About.ROBOT, robot.name, "trouble.robot-rank", named | {"most": MAX_WEIGHT})
        if not sketch.area.has(robot.at):
            yield Trouble(About.ROBOT, robot.name, "trouble.robot-outside", named)
        elif robot.at in sketch.area.blocked:
            yield Trouble(About.ROBOT, robot.name, "trouble.robot-blocked", named, Severity.HINT)
    if any(not sketch.area.has(cell) for cell in sketch.area.blocked):
        yield Trouble(About.MAP, "map", "trouble.map-blocked")


def check_decisions(sketch: Sketch) -> Iterator[Trouble]:
    """Yield errors in decisions, including their robots and values."""
    known = {robot.name for robot in sketch.robots}
    for decision in sketch.decisions:
        named: dict[str, str | int] = {"name": shortened(decision.name)}
        for key, found in (
            ("unknown", first_unknown(decision.robots, known)),
            ("twice", first_repeated(decision.robots)),
        ):
            if found is not None:
                with_robot = named | {"robot": shortened(found)}
                yield Trouble(About.DECISION, decision.name, f"trouble.decision-robot-{key}", with_robot)
        if not sketch.values(decision):
            key = "trouble.decision-no-cell" if decision.kind == DecisionKind.PLACE else "trouble.decision-empty"
            yield Trouble(About.DECISION, decision.name, key, named)
        yield from _check_values(sketch, decision)


def _check_values(sketch: Sketch, decision: Decision) -> Iterator[Trouble]:
    """Yield the first invalid value of a decision, or its first duplicate value."""
    named: dict[str, str | int] = {"name": shortened(decision.name)}
    for value in decision.values:
        key = _value_error(sketch, decision.kind, value)
        if key:
            yield Trouble(About.DECISION, decision.name, key, named | {"value": shortened(value), "most": MAX_NUMBER})
            return
    twice = first_repeated(decision.values)
    if twice is not None:
        with_value = named | {"value": shortened(twice)}
        yield Trouble(About.DECISION, decision.name, "trouble.decision-value-twice", with_value)


def _value_error(sketch: Sketch, kind: DecisionKind, value: int | str) -> str | None:
    if kind not in NUMBERED:
        if isinstance(value, int):
            return "trouble.decision-no-text"
        is_text = value.isprintable() and value.strip() == value and 1 <= len(value) <= limits.MAX_LABEL
        return None if is_text else "trouble.decision-text"
    if isinstance(value, str):
        return "trouble.decision-no-number"
    if kind != DecisionKind.PLACE:
        return None if abs(value) <= MAX_NUMBER else "trouble.decision-large"
    if not 0 <= value < sketch.area.columns * sketch.area.rows:
        return "trouble.decision-outside"
    return "trouble.decision-blocked" if sketch.area.cell(value) in sketch.area.blocked else None


def first_unknown(names: Iterable[str], known: set[str]) -> str | None:
    """Return the first unknown name, or None if all names are known."""
    return next((name for name in names if name not in known), None)


def first_repeated(items: Sequence[int | str]) -> int | str | None:
    """Return the first item that occurs more than once, or None if there is no such item."""
    return next((item for item, count in Counter(items).items() if count > 1), None)


def is_sound(sketch: Sketch) -> bool:
    """Return whether a sketch from a file can be shown: its sizes, texts and numbers are within the widest limits."""
    area = sketch.area
    sizes = (
        (len(sketch.robots), limits.MAX_ROBOTS),
        (len(sketch.decisions), limits.MAX_DECISIONS),
        (len(sketch.rules), limits.MAX_RULES),
        (max((len(decision.values) for decision in sketch.decisions), default=0), limits.MAX_VALUES),
        (len(area.blocked), limits.MAX_SIDE**2),
    )
    names = (
        [one.name for one in sketch.robots],
        [one.name for one in sketch.decisions],
        [one.id for one in sketch.rules],
    )
    return (
        1 <= area.columns <= limits.MAX_SIDE
        and 1 <= area.rows <= limits.MAX_SIDE
        and all(size <= most for size, most in sizes)
        and all(len(set(some)) == len(some) for some in names)
        and all(_is_sound(item) for item in _items(sketch))
    )


def _is_sound(item: int | str) -> bool:
    return len(item) <= _LONGEST if isinstance(item, str) else abs(item) <= _FURTHEST


def _items(sketch: Sketch) -> Iterator[int | str]:
    """Yield all texts and numbers in a sketch."""
    yield from (sketch.name, sketch.story)
    for cell in sketch.area.blocked:
        yield from (cell.x, cell.y)
    for robot in sketch.robots:
        yield from (robot.name, robot.at.x, robot.at.y, robot.weight, robot.rank)
    for decision in sketch.decisions:
        yield decision.name
        yield from decision.values
        yield from decision.robots
    for rule in sketch.rules:
        yield from (rule.id, rule.kind, rule.decision, rule.cost or 0)
        yield from rule.robots
        for name, setting in rule.settings.items():
            yield name
            yield from _flat(setting)


def _flat(setting: Setting) -> Iterator[int | str]:
    for one in setting if isinstance(setting, list) else [setting]:
        yield from one if isinstance(one, list) else [one]
