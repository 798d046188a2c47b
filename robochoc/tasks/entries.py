"""Read and check the entries in a list of robots and tasks. Errors are reported with their line."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping
from contextlib import contextmanager
from enum import StrEnum
from fractions import Fraction
from typing import TypeVar

from robochoc.formats.diagnostics import DiagnosticCollector, MistakeError, shortened, suggestion
from robochoc.formats.yaml_tree import Node, Scalar, scalar_text
from robochoc.system.lazy_dataclass import dataclass

Point = tuple[Fraction, ...]

MOST = 10**12
"""The maximum of every number."""
MAX_PLACES = 9
MAX_TEAM = 16
"""The maximum number of robots of a team."""
MAX_TEAM_SKILLS = 6
"""The maximum number of different skills of a team, since all sets of them are compared."""
_PLANE, _SPACE = 2, 3
_Choice = TypeVar("_Choice", bound=StrEnum)


@dataclass(frozen=True)
class RobotEntry:
    """A robot.

    Attributes:
        line: Its line in the file.
        at: Its position; empty: the length of each of its ways is 0.
        skills: Its skills.
        capacity: The maximum sum of the loads of its tasks. None: unlimited.
        most: The maximum number of its tasks. None: unlimited.
        speed: The distance that it covers per unit of time.
        radius: The radius of the robot on a map, in metres.
        has_radius: True if the entry has its own radius.
        topic: The name of the topic of its waypoints; empty: its name and `/waypoint`.
    """

    line: int
    at: Point
    skills: frozenset[str]
    capacity: int | None
    most: int | None
    speed: Fraction
    radius: Fraction
    has_radius: bool
    topic: str


@dataclass(frozen=True)
class TaskEntry:
    """A task.

    Attributes:
        line: Its line in the file.
        at: Its position; empty: all ways to it have length 0.
        needs: The skills required of each of its robots.
        worth: The worth of doing it.
        load: The part of a robot's capacity that it requires.
        deadline: The latest time of arrival. None: no deadline.
        window: The earliest and the latest beginning; a robot that arrives earlier waits. None: no latest beginning.
        duration: The time for which the task occupies each of its robots.
        robots: The number of robots required.
        team: The number of these robots that have a skill, by skill. Empty: any robots.
        is_joint: True if its robots start it at the same time.
        after: The tasks that end before this one begins, of which each must be done.
    """

    line: int
    at: Point
    needs: frozenset[str]
    worth: Fraction
    load: int
    deadline: Fraction | None
    window: tuple[Fraction, Fraction | None]
    duration: Fraction
    robots: int
    team: Mapping[str, int]
    is_joint: bool
    after: tuple[str, ...]

    @property
    def is_timed(self) -> bool:
        """True if the task occupies a robot, or can only begin at certain times, or together with other robots."""
        earliest, latest = self.window
        return bool(self.duration or earliest or latest is not None or self.after or self.is_joint)

    @property
    def latest(self) -> Fraction | None:
        """The latest time of arrival; None if there is none."""
        return min((time for time in (self.deadline, self.window[1]) if time is not None), default=None)


@dataclass(frozen=True)
class Synergy:
    """The additional worth of two tasks if the same robot does both. It may be negative."""

    line: int
    tasks: tuple[str, str]
    worth: Fraction


class EntryReader:
    """Reads the keys of a mapping by the type of their values. All methods raise `MistakeError`."""

    def __init__(self, what: str, node: Node) -> None:
        if not node.is_mapping:
            raise MistakeError(f"{what} is not a mapping", "write KEY: VALUE, one a line, or {KEY: VALUE}", node.line)
        self._what = what
        self._node = node

    def point(self, key: str) -> Point:
        """Return a position with two or three coordinates; empty if the key is missing."""
        node = self.node(key)
        if node is None:
            return ()
        if node.items is None or len(node.items) not in (_PLANE, _SPACE):
            raise self._mistake(key, node, f"write {key}: [X, Y], or {key}: [X, Y, Z]")
        return tuple(self._number(key, one, -MOST) for one in node.items)

    def window(self, key: str) -> tuple[Fraction, Fraction | None]:
        """Return an earliest and a latest time; `(0, None)` if the key is missing."""
        node = self.node(key)
        if node is None:
            return Fraction(0), None
        hint = f"write {key}: [EARLIEST, LATEST]"
        if node.items is None or len(node.items) != _PLANE:
            raise self._mistake(key, node, hint)
        earliest, latest = (self._number(key, one, 0) for one in node.items)
        if latest < earliest:
            raise MistakeError(f"{self._what} has a {key} whose end is before its beginning", hint, node.line)
        return earliest, latest

    def word(self, key: str, form: str = "WORD") -> str:
        """Return a word, which messages call `form`; empty if the key is missing."""
        node = self.node(key)
        if node is None:
            return ""
        if not isinstance(node.scalar, str) or not node.scalar:
            raise self._mistake(key, node, f"write {key}: {form}")
        return node.scalar

    def number(self, key: str, default: Fraction | None, least: int = 0) -> Fraction | None:
        """Return a decimal of at least `least`; `default` if the key is missing."""
        node = self.node(key)
        return default if node is None else self._number(key, node, least)

    def required_number(self, key: str, least: int = 0) -> Fraction:
        """Return a decimal of at least `least`; the key must be present."""
        return self._number(key, self.required_node(key), least)

    def integer(self, key: str, default: int | None, least: int = 0) -> int | None:
        """Return an integer of at least `least`; `default` if the key is missing."""
        node = self.node(key)
        if node is None:
            return default
        value = node.scalar
        if isinstance(value, bool) or not isinstance(value, int) or not least <= value <= MOST:
            raise self._mistake(key, node, f"write an integer from {least} to {MOST}")
        return value

    def team(self, key: str) -> tuple[int, dict[str, int]] | None:
        """Return the size of a team and its number of robots for each skill; None if the key is missing."""
        node = self.node(key)
        if node is None:
            return None
        if not node.is_mapping:
            number = _team_number(node)
            if number is None:
                hint = f"write {key}: {{SKILL: NUMBER}}, or {key}: NUMBER, for 1 to {MAX_TEAM} robots"
                raise self._mistake(key, node, hint)
            return number, {}
        numbers = {name_text(name): self._place(key, name_text(name), one) for name, one in node.named()}
        size = sum(numbers.values())
        for what, is_wrong, hint in (
            ("without skills", not numbers, f"write {key}: {{SKILL: NUMBER}}"),
            (f"of {size} robots", size > MAX_TEAM, f"write at most {MAX_TEAM}"),
            (f"with {len(numbers)} skills", len(numbers) > MAX_TEAM_SKILLS, f"write at most {MAX_TEAM_SKILLS}"),
        ):
            if is_wrong:
                raise MistakeError(f"{self._what} has a {key} {what}", hint, node.line)
        return size, numbers

    def _place(self, key: str, skill: str, node: Node) -> int:
        """Return the number of robots with `skill` in a team."""
        if not skill.strip():
            raise MistakeError(f"{self._what} has a {key} with an empty skill", "write its name", node.line)
        number = _team_number(node)
        if number is None:
            what = f"{self._what} cannot have {_shown(node)} as the number of robots with '{shortened(skill)}'"
            raise MistakeError(what, f"write an integer from 1 to {MAX_TEAM}", node.line)
        return number

    def flag(self, key: str) -> bool:
        """Return a truth value; False if the key is missing."""
        node = self.node(key)
        if node is None:
            return False
        value = node.scalar
        if not isinstance(value, bool):
            raise self._mistake(key, node, f"write {key}: yes, or {key}: no")
        return value

    def words(self, key: str) -> tuple[str, ...]:
        """Return a list of words; a single word is a list of one word."""
        node = self.node(key)
        if node is None:
            return ()
        items = [node] if node.is_scalar and not node.is_empty else node.items
        if items is None or any(not one.is_scalar or one.is_empty for one in items):
            raise self._mistake(key, node, f"write {key}: [ONE, OTHER]")
        return tuple(name_text(one.scalar) for one in items)

    def choice(self, key: str, kind: type[_Choice]) -> _Choice | None:
        """Return a member of the enum `kind`; None if the key is missing."""
        node = self.node(key)
        if node is None:
            return None
        for member in kind:
            if node.scalar == member.value:
                return member
        raise self._mistake(key, node, suggestion(scalar_text(node.scalar), [one.value for one in kind], "words"))

    def node(self, key: str) -> Node | None:
        """Return the value of `key`; None if the key is missing."""
        return self._node.get(key)

    def required_node(self, key: str) -> Node:
        """Return the value of `key`, which must be present."""
        return self._node.needed(key, self._what)

    def _number(self, key: str, node: Node, least: int) -> Fraction:
        scalar = node.scalar
        if isinstance(scalar, bool) or not isinstance(scalar, int | Fraction) or not least <= scalar <= MOST:
            raise self._mistake(key, node, f"write a number from {least} to {MOST}")
        return Fraction(scalar)

    def _mistake(self, key: str, node: Node, hint: str) -> MistakeError:
        return MistakeError(f"{self._what} cannot have {_shown(node)} as '{key}'", hint, node.line)


def _shown(node: Node) -> str:
    """Return a value for messages, as written in the file."""
    if not node.is_scalar:
        return "this value"
    if node.is_empty and not node.written:
        return "an empty value"
    return f"'{shortened(node.written or name_text(node.scalar))}'"


def _team_number(node: Node) -> int | None:
    """Return a number of robots in a team; None if it is invalid."""
    value = node.scalar
    if isinstance(value, bool) or not isinstance(value, int) or not 1 <= value <= MAX_TEAM:
        return None
    return value


def name_text(value: Scalar) -> str:
    """Return a name as text, even if YAML reads it as a number (7) or a truth value (yes)."""
    return "yes" if value is True else "no" if value is False else scalar_text(value)


def read_robots(node: Node, radius: Fraction, mistakes: DiagnosticCollector) -> dict[str, RobotEntry]:
    """Return the robots in a section, with a default radius; add mistakes to `mistakes`."""
    found = {}
    for name, one in _named("robots", node):
        with _collecting(one, mistakes):
            entry = EntryReader(f"the robot '{shortened(name)}'", one)
            speed = entry.number("speed", Fraction(1)) or Fraction(0)
            if not speed:
                raise MistakeError(f"the robot '{shortened(name)}' has the speed 0", "write a number above 0", one.line)
            has = frozenset(entry.words("skills"))
            room, most = entry.integer("capacity", None), entry.integer("most", None)
            own, has_own = entry.number("radius", radius) or Fraction(0), entry.node("radius") is not None
            topic = entry.word("topic", "NAME")
            found[name] = RobotEntry(one.line, entry.point("at"), has, room, most, speed, own, has_own, topic)
    return found


def read_tasks(node: Node, mistakes: DiagnosticCollector) -> dict[str, TaskEntry]:
    """Return the tasks in a section; add mistakes to `mistakes`."""
    found = {}
    for name, one in _named("tasks", node):
        with _collecting(one, mistakes):
            found[name] = _task(f"the task '{shortened(name)}'", one)
    return found


def _task(what: str, node: Node) -> TaskEntry:
    entry = EntryReader(what, node)
    robots, team = entry.integer("robots", None, 1), entry.team("team")
    if robots is not None and team is not None:
        raise MistakeError(
            f"{what} has robots: and team:", "delete robots:, since a team has its own number", node.line
        )
    size, places = team or (robots or 1, {})
    return TaskEntry(
        node.line,
        entry.point("at"),
        frozenset(entry.words("needs")),
        entry.required_number("worth", -MOST),
        entry.integer("load", 1) or 0,
        entry.number("deadline", None),
        entry.window("window"),
        entry.number("duration", None) or Fraction(0),
        size,
        places,
        team is not None and size > 1,
        entry.words("after"),
    )


def read_synergies(node: Node | None, tasks: Collection[str], mistakes: DiagnosticCollector) -> list[Synergy]:
    """Return the synergies in a section; add mistakes to `mistakes`."""
    if node is None:
        return []
    if node.items is None:
        raise MistakeError(
            "synergies is not a list", "write - {tasks: [ONE, OTHER], worth: NUMBER}, one a line", node.line
        )
    found = []
    for one in node.items:
        with _collecting(one, mistakes):
            entry = EntryReader("a synergy", one)
            names, worth = entry.words("tasks"), entry.required_number("worth", -MOST)
            for name in names:
                if name not in tasks:
                    raise MistakeError(
                        f"a synergy has the task '{shortened(name)}', which is not in the list",
                        suggestion(name, tasks, "tasks"),
                        one.line,
                    )
            if len(set(names)) != _PLANE or len(names) != _PLANE:
                raise MistakeError("a synergy does not have two different tasks", "write tasks: [ONE, OTHER]", one.line)
            found.append(Synergy(one.line, (names[0], names[1]), worth))
    return found


@contextmanager
def _collecting(entry: Node, mistakes: DiagnosticCollector) -> Iterator[None]:
    """Add a mistake in an entry to `mistakes`, and skip the rest of the entry."""
    with mistakes.at(entry.line):
        try:
            yield
        except MistakeError:
            entry.skip()
            raise


def _named(section: str, node: Node) -> Iterator[tuple[str, Node]]:
    hint = f"write {section}: and, below, NAME: {{at: [X, Y], ...}}"
    if not node.is_mapping:
        raise MistakeError(f"{section} is not a mapping", hint, node.line)
    names = set()
    for key, one in node.named():
        name = name_text(key)
        if name in names:
            raise MistakeError(f"{section} has '{shortened(name)}' twice", "rename one of them", one.line)
        names.add(name)
        yield name, Node(one.line, {}) if one.is_empty else one
    if not names:
        raise MistakeError(f"has no {section}", hint, node.line)
