"""The contents of the board for a sketch: robots with their marks, and rules as links."""

from __future__ import annotations

from collections.abc import Iterable
from itertools import chain, islice
from typing import TypedDict

import msgspec

from robochoc.app.sketch.palette import Links
from robochoc.app.sketch.rules import PALETTE
from robochoc.app.sketch.sentences import sentence, short, weight_of
from robochoc.app.sketch.sketch import Sketch, SketchRobot, SketchRule
from robochoc.app.sketch.troubles import About, Trouble
from robochoc.app.texts import say

COLOURS = 8
"""The number of colours for rules (`--rule-0`, ... in the style), which are used in turn."""
MOST_LINKS = 12_000
"""The maximum number of links drawn, for readability. The list of rules marks the rules that are not drawn."""
MOST_NEIGHBOURS = 300
"""The maximum number of robots in a rule about neighbours that is drawn."""

MOST_PAIRS = 300
"""The maximum number of lines for a rule about pairs. With more, the rule is drawn as a hull around its robots."""

_PAIR = 2
_SHAPES = {Links.EACH: "dots", Links.GROUP: "hull"}


class DrawnRobot(TypedDict):
    """A robot on the board."""

    name: str
    x: int
    y: int
    mark: str
    says: str
    trouble: bool


class DrawnLink(TypedDict):
    """A rule on the board. `of` contains the indices of its robots among all robots, in pairs if lines are drawn."""

    rule: str
    color: int
    shape: str
    of: list[int]
    words: str
    sentence: str
    soft: bool


class LinksDrawn(msgspec.Struct, frozen=True):
    """The links in a sketch, and the rules that are not drawn because they have too many links."""

    drawn: list[DrawnLink]
    left_out: frozenset[str]


def colour_of(rule: SketchRule) -> int:
    """Return the number of a rule's colour, which is always the same."""
    digits = "".join(letter for letter in rule.id[1:6] if letter.isascii() and letter.isdigit())
    return (int(digits or "1") - 1) % COLOURS


def robots_of(sketch: Sketch, troubles: Iterable[Trouble] = ()) -> list[DrawnRobot]:
    """Return the robots to draw. Robots with errors or hints are marked."""
    bad: dict[str, list[str]] = {}
    for trouble in troubles:
        if trouble.about == About.ROBOT:
            bad.setdefault(trouble.element, []).append(f"{trouble.text} {trouble.remedy}")
    return [_robot(robot, bad.get(robot.name, [])) for robot in sketch.robots]


def _robot(robot: SketchRobot, bad: list[str]) -> DrawnRobot:
    at = say("value.place", column=robot.at.x + 1, row=robot.at.y + 1)
    facts = [robot.name, at]
    facts += [say("model.says-weight", weight=robot.weight)] if robot.weight != 1 else []
    facts += [say("model.says-rank", rank=robot.rank)] if robot.rank else []
    says = ". ".join([", ".join(facts), *bad])
    return DrawnRobot(name=robot.name, x=robot.at.x, y=robot.at.y, mark=mark_of(robot), says=says, trouble=bool(bad))


def mark_of(robot: SketchRobot) -> str:
    """Return the mark of a robot: its weight and rank, if they differ from the defaults."""
    weight = f"\N{MULTIPLICATION SIGN}{robot.weight}" if robot.weight != 1 else ""
    rank = f"{'▲' if robot.rank > 0 else '▼'}{abs(robot.rank)}" if robot.rank else ""
    return " ".join(filter(None, (weight, rank)))


def links_of(sketch: Sketch) -> LinksDrawn:
    """Return the rules as links. Inactive and incomplete rules have no links."""
    place = {robot.name: index for index, robot in enumerate(sketch.robots)}
    drawn: list[DrawnLink] = []
    left_out: set[str] = set()
    room = MOST_LINKS
    for rule in sketch.rules:
        if not rule.on or rule.kind not in PALETTE or sketch.decision(rule.decision) is None:
            continue
        groups = _groups(sketch, rule, room)
        if groups is None:
            left_out.add(rule.id)
        elif groups:
            room -= len(groups)
            drawn.append(_link(sketch, rule, [place[name] for name in chain(*groups)], is_whole=len(groups[0]) > _PAIR))
    return LinksDrawn(drawn, frozenset(left_out))


def _groups(sketch: Sketch, rule: SketchRule, room: int) -> list[tuple[str, ...]] | None:
    """Return the groups of robots that a rule links, or None if there are too many."""
    entry, bound = PALETTE[rule.kind], sketch.bound(rule)
    if entry.links == Links.PAIRS and len(bound) * (len(bound) - 1) // 2 > MOST_PAIRS:
        return [bound]
    if entry.links == Links.NEIGHBOURS and len(bound) > MOST_NEIGHBOURS:
        return None
    groups = [*islice(entry.groups(sketch, rule), room + 1)]
    return groups if len(groups) <= room else None


def _link(sketch: Sketch, rule: SketchRule, of: list[int], *, is_whole: bool) -> DrawnLink:
    entry = PALETTE[rule.kind]
    return DrawnLink(
        rule=rule.id,
        color=colour_of(rule),
        shape="hull" if is_whole else _SHAPES.get(entry.links, "arrows" if entry.has_order else "lines"),
        of=of,
        words=short(sketch, rule),
        sentence=f"{sentence(sketch, rule)} {weight_of(rule)}".strip(),
        soft=rule.cost is not None or entry.graded,
    )
