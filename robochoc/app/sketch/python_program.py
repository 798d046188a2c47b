"""A sketch as a readable Python program that uses `robochoc.Model`.

The program builds the same team as `building.model_of`. Names given by users are always quoted, so that they cannot
become code.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from typing import NamedTuple

from robochoc.app.sketch.building import WAYPOINT, applied
from robochoc.app.sketch.palette import Applied, Links
from robochoc.app.sketch.python_text import Each, PythonText, python_literal, text_with
from robochoc.app.sketch.rules import PALETTE
from robochoc.app.sketch.sentences import sentence
from robochoc.app.sketch.sketch import Decision, DecisionKind, Sketch, SketchRule

_WIDE = 110
"""The maximum length of a line. Longer lists are split."""
_A, _B = PythonText("a"), PythonText("b")


def python_source(sketch: Sketch) -> str:
    """Return a program that builds and solves the model of a sketch, which must have no errors (`checks.troubles`)."""
    body = [*_lines(sketch)]
    imports = ["import itertools", ""] if any("in itertools." in line for line in body) else []
    return "\n".join([*imports, "import robochoc", "", *body]) + "\n"


def names_in_python(sketch: Sketch) -> dict[str, str]:
    """Return the names of the dictionaries that contain the variables of each decision.

    The names are unique, and differ from Python's keywords and from other names in the program.
    """
    found: dict[str, str] = {}
    for decision in sketch.decisions:
        stem = re.sub(r"[^A-Za-z0-9_]", "_", decision.name)
        stem = f"_{stem}" if stem[:1].isdigit() else stem
        while f"{stem}_of" in found.values():
            stem += "_"
        found[decision.name] = f"{stem}_of"
    return found


def _lines(sketch: Sketch) -> Iterator[str]:
    names = names_in_python(sketch)
    yield f"model = robochoc.Model({python_literal(sketch.name)})"
    yield from _robots(sketch)
    for decision in sketch.decisions:
        yield ""
        yield from _decision(sketch, decision, names[decision.name])
    waypoints = [*_waypoints(sketch, names)]
    if waypoints:
        yield ""
        yield from waypoints
    for rule in sketch.rules:
        if rule.on:
            yield ""
            yield f"# {_on_one_line(sentence(sketch, rule))}"
            yield from _rule(sketch, rule, names[rule.decision])
    yield ""
    yield "outcome = model.solve()"
    yield "print(outcome.verdict, outcome.cost, outcome.values)"


def _on_one_line(text: str) -> str:
    return "".join(letter if letter.isprintable() else " " for letter in text)


def _robots(sketch: Sketch) -> Iterator[str]:
    if all(robot.weight == 1 and not robot.rank for robot in sketch.robots):
        yield from _broken("robots = {name: model.robot(name) for name in ", [one.name for one in sketch.robots], "}")
        return
    yield "robots = {"
    for robot in sketch.robots:
        name = python_literal(robot.name)
        extra = (f", priority={robot.rank}" if robot.rank else "") + (f", weight={robot.weight}" * (robot.weight != 1))
        yield f"    {name}: model.robot({name}{extra}),"
    yield "}"


def _broken(before: str, parts: Sequence[object], after: str) -> Iterator[str]:
    """Yield a list on one line, or on several lines if it is too long."""
    texts = [python_literal(part) for part in parts]
    line = f"{before}[{', '.join(texts)}]{after}"
    if len(line) <= _WIDE:
        yield line
        return
    indent = " " * (len(before) - len(before.lstrip()))
    yield f"{before}["
    row = ""
    for text in texts:
        if row and len(row) + len(text) > _WIDE:
            yield f"{indent}    {row.strip()}"
            row = ""
        row += f" {text},"
    yield f"{indent}    {row.strip()}"
    yield f"{indent}]{after}"


def _decision(sketch: Sketch, decision: Decision, dictionary: str) -> Iterator[str]:
    if decision.kind == DecisionKind.PLACE:
        yield f"# cells of a map of {sketch.area.columns} columns, row by row from the south-west"
    deciders, values = sketch.deciders(decision), sketch.values(decision)
    begin = f"    name: robots[name].variable({python_literal(decision.name)}, "
    yield f"{dictionary} = {{"
    numbers = [value for value in values if isinstance(value, int)]
    if len(numbers) == len(values) > 1 and numbers == [*range(numbers[0], numbers[-1] + 1)]:
        yield f"{begin}range({numbers[0]}, {numbers[-1] + 1}))"
    else:
        yield from _broken(begin, values, ")")
    if len(deciders) == len(sketch.robots):
        yield "    for name in robots"
    else:
        yield from _broken("    for name in ", deciders, "")
    yield "}"


def _waypoints(sketch: Sketch, names: dict[str, str]) -> Iterator[str]:
    """Yield the waypoints of the robots, in one loop for all robots with the same decisions."""
    groups: dict[tuple[str | None, str | None], list[str]] = {}
    for robot in sketch.robots:
        own: dict[DecisionKind, str] = {}
        for decision in sketch.decisions:
            if robot.name in sketch.deciders(decision):
                own.setdefault(decision.kind, f"{names[decision.name]}[name]")
        groups.setdefault((own.get(DecisionKind.PLACE), own.get(DecisionKind.LEVEL)), []).append(robot.name)
    columns = sketch.area.columns
    standing = {robot.name: robot.at for robot in sketch.robots}
    for (place, level), robots in groups.items():
        if place:
            yield from _broken("for name in ", robots, ":")
            x, y = f"{place} % {columns} + 1", f"{place} // {columns} + 1"
        elif level:
            at = [(name, standing[name].x + 1, standing[name].y + 1) for name in robots]
            yield from _broken("for name, x, y in ", at, ":")
            x, y = "x", "y"
        else:
            continue
        yield f'    robots[name].topic(f"{{name}}/{WAYPOINT}", x={x}, y={y}, z={level or 1})'


class _Loop(NamedTuple):
    """A loop over the links of a rule: the text before and after a list, the list, and the robots in a link."""

    before: str
    names: Sequence[object]
    after: str
    robots: Sequence[str | PythonText]


def _rule(sketch: Sketch, rule: SketchRule, dictionary: str) -> Iterator[str]:
    entry, links = PALETTE[rule.kind], [*applied(sketch, rule)]
    bound = sketch.bound(rule)
    one_line = 1
    if entry.links == Links.GROUP:
        few = 2
        names = bound if len(bound) == few else ()
        each = Each(f"{dictionary}[a]", _variables_of(sketch, rule, dictionary))
        terms = [each] if not rule.private else [_variable(dictionary, name) for name in bound]
        yield from _statements(sketch, rule, terms, bound if rule.private else (), [rule.id, *names])
    elif len(links) <= one_line:
        for _, robots in links:
            yield from _statements(
                sketch, rule, [_variable(dictionary, one) for one in robots], robots, [rule.id, *robots]
            )
    else:
        loop = _loop(entry.links, bound, [robots for _, robots in links])
        if loop.names == bound == sketch.deciders(_decision_of(sketch, rule)):
            yield f"{loop.before}{dictionary}{loop.after}"
        else:
            yield from _broken(loop.before, loop.names, loop.after)
        terms = [_variable(dictionary, one) for one in loop.robots]
        for line in _statements(sketch, rule, terms, loop.robots, [rule.id, *loop.robots]):
            yield f"    {line}"


def _loop(links: Links, bound: tuple[str, ...], pairs: list[tuple[str, ...]]) -> _Loop:
    match links:
        case Links.EACH:
            return _Loop("for a in ", bound, ":", [_A])
        case Links.STAR:
            return _Loop("for b in ", bound[1:], ":", [bound[0], _B])
        case Links.PAIRS:
            return _Loop("for a, b in itertools.combinations(", bound, ", 2):", [_A, _B])
        case Links.CHAIN:
            return _Loop("for a, b in itertools.pairwise(", bound, "):", [_A, _B])
        case _:
            return _Loop("for a, b in ", pairs, ":", [_A, _B])


def _decision_of(sketch: Sketch, rule: SketchRule) -> Decision:
    decision = sketch.decision(rule.decision)
    assert decision is not None, "the checks reject a rule without a decision"  # noqa: S101
    return decision


def _variables_of(sketch: Sketch, rule: SketchRule, dictionary: str) -> str:
    bound = sketch.bound(rule)
    return dictionary if bound == sketch.deciders(_decision_of(sketch, rule)) else python_literal([*bound])


def _variable(dictionary: str, robot: str | PythonText) -> PythonText:
    return PythonText(f"{dictionary}[{python_literal(robot)}]")


def _statements(
    sketch: Sketch,
    rule: SketchRule,
    terms: Sequence[PythonText],
    robots: Sequence[str | PythonText],
    name: list[str | PythonText],
) -> Iterator[str]:
    """Yield the statement that adds a rule for one link. A private rule is added to the first robot in the link."""
    entry = PALETTE[rule.kind]
    term = entry.condition(Applied(sketch, rule), terms)
    cost = "" if rule.cost is None else f", cost={rule.cost}"
    pair = 2
    if entry.graded:
        yield f"model.minimize({term})"
    elif rule.private and len(robots) == pair:
        yield f"robots[{python_literal(robots[0])}].knows({term}{cost}, name={text_with(name)})"
    else:
        yield f"model.add({term}{cost}, name={text_with(name)})"
