"""The entries of a list of robots and tasks, each read and checked: what is wrong is said with its line."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction

from robochoc.formats.diagnostics import DiagnosticCollector, MistakeError, shortened, suggestion
from robochoc.formats.dialects.yaml_tree import Node, Scalar, shown

Point = tuple[Fraction, ...]

MOST = 10**12
"""No number is larger."""
MAX_PLACES = 9
_PLANE, _SPACE = 2, 3


@dataclass(frozen=True)
class RobotEntry:
    """A robot.

    Attributes:
        line: Where it stands.
        at: Its place; empty: its ways are nothing.
        skills: What it can do.
        capacity: The room that it has. None: for any load.
        most: The number of tasks that it does at most. None: any.
        speed: The way that it makes in a unit of time.
    """

    line: int
    at: Point
    skills: frozenset[str]
    capacity: int | None
    most: int | None
    speed: Fraction


@dataclass(frozen=True)
class TaskEntry:
    """A task.

    Attributes:
        line: Where it stands.
        at: Its place; empty: the way there is nothing.
        needs: The skills that it asks of each robot that does it.
        worth: What it is worth.
        load: The room that it takes.
        deadline: When a robot must be there. None: at any time.
        robots: The number of robots that it asks for.
    """

    line: int
    at: Point
    needs: frozenset[str]
    worth: Fraction
    load: int
    deadline: Fraction | None
    robots: int


@dataclass(frozen=True)
class Synergy:
    """The additional worth of two tasks if the same robot does both; it may be negative."""

    line: int
    tasks: tuple[str, str]
    worth: Fraction


class Entry:
    """A mapping with known keys. Each is read by a method of its type, which raises `MistakeError`."""

    def __init__(self, what: str, node: Node, known: Collection[str]) -> None:
        if node.entries is None:
            raise MistakeError(f"{what} is no mapping", f"write {{{': ..., '.join(known)}: ...}}", node.line)
        self._what = what
        self._line = node.line
        self._entries: Mapping[Scalar, Node] = node.entries
        for key in self._entries:
            if key not in known:
                found = f"{what} has the key '{shortened(str(key))}'"
                raise MistakeError(found, suggestion(str(key), known, "keys"), node.keys.get(key, node.line))

    def point(self, key: str) -> Point:
        """Return a place of two or three coordinates; empty where there is none."""
        node = self._entries.get(key)
        if node is None:
            return ()
        if node.items is None or len(node.items) not in (_PLANE, _SPACE):
            raise self._mistake(key, node, f"write {key}: [X, Y], or {key}: [X, Y, Z]")
        return tuple(self._number(key, one, -MOST) for one in node.items)

    def number(self, key: str, default: Fraction | None, least: int = 0) -> Fraction | None:
        """Return a decimal of at least `least`; `default` where there is none."""
        node = self._entries.get(key)
        return default if node is None else self._number(key, node, least)

    def needed(self, key: str, least: int = 0) -> Fraction:
        """Return a decimal that must be there."""
        node = self._entries.get(key)
        if node is None:
            raise MistakeError(f"{self._what} has no {key}", f"write {key}: and a number", self._line)
        return self._number(key, node, least)

    def whole(self, key: str, default: int | None, least: int = 0) -> int | None:
        """Return an integer of at least `least`; `default` where there is none."""
        node = self._entries.get(key)
        if node is None:
            return default
        if isinstance(node.scalar, bool) or not isinstance(node.scalar, int) or not least <= node.scalar <= MOST:
            raise self._mistake(key, node, f"write a whole number from {least} on")
        return node.scalar

    def flag(self, key: str) -> bool:
        """Return whether `key` says yes; no where there is none."""
        node = self._entries.get(key)
        if node is None:
            return False
        if not isinstance(node.scalar, bool):
            raise self._mistake(key, node, f"write {key}: yes, or {key}: no")
        return node.scalar

    def words(self, key: str) -> tuple[str, ...]:
        """Return a list of words; a single word is a list of one."""
        node = self._entries.get(key)
        if node is None:
            return ()
        items = [node] if node.is_scalar and node.scalar is not None else node.items
        if items is None or any(not one.is_scalar or one.scalar is None for one in items):
            raise self._mistake(key, node, f"write {key}: [ONE, OTHER]")
        return tuple(word_of(one) for one in items)

    def choice(self, key: str, choices: Sequence[str]) -> str | None:
        """Return one of `choices`; None where there is none."""
        node = self._entries.get(key)
        if node is None:
            return None
        if node.scalar not in choices:
            raise self._mistake(key, node, f"write one of {', '.join(choices)}")
        return str(node.scalar)

    def node(self, key: str) -> Node | None:
        """Return what stands at `key`."""
        return self._entries.get(key)

    def _number(self, key: str, node: Node, least: int) -> Fraction:
        scalar = node.scalar
        if isinstance(scalar, bool) or not isinstance(scalar, int | Fraction) or not least <= scalar <= MOST:
            raise self._mistake(key, node, f"write a number from {least} to {MOST}")
        return Fraction(scalar)

    def _mistake(self, key: str, node: Node, hint: str) -> MistakeError:
        value = f"'{shortened(shown(node.scalar))}'" if node.is_scalar else "this value"
        return MistakeError(f"{self._what} cannot have {value} as '{key}'", hint, node.line)


def word_of(node: Node) -> str:
    """Return a name: YAML reads 7 as a number, and yes as true."""
    return "yes" if node.scalar is True else "no" if node.scalar is False else shown(node.scalar)


def names_in(section: Node | None) -> list[str]:
    """Return the names in a section."""
    entries = section.entries if section is not None else None
    return [word_of(Node(0, key)) for key in entries or ()]


def read_robots(node: Node | None, mistakes: DiagnosticCollector) -> dict[str, RobotEntry]:
    """Return the robots in a section; mistakes are noted."""
    found = {}
    for name, one in _named("robots", node):
        with mistakes.at(one.line):
            entry = Entry(f"the robot '{shortened(name)}'", one, ("at", "skills", "capacity", "most", "speed"))
            speed = entry.number("speed", Fraction(1)) or Fraction(0)
            if not speed:
                raise MistakeError(f"the robot '{shortened(name)}' has the speed 0", "write more than 0", one.line)
            has = frozenset(entry.words("skills"))
            room, most = entry.whole("capacity", None), entry.whole("most", None)
            found[name] = RobotEntry(one.line, entry.point("at"), has, room, most, speed)
    return found


def read_tasks(node: Node | None, mistakes: DiagnosticCollector) -> dict[str, TaskEntry]:
    """Return the tasks in a section; mistakes are noted."""
    found = {}
    for name, one in _named("tasks", node):
        with mistakes.at(one.line):
            keys = ("at", "needs", "worth", "load", "deadline", "robots")
            entry = Entry(f"the task '{shortened(name)}'", one, keys)
            needs, worth = frozenset(entry.words("needs")), entry.needed("worth", -MOST)
            load, robots = entry.whole("load", 1) or 0, entry.whole("robots", 1, 1) or 1
            deadline = entry.number("deadline", None)
            found[name] = TaskEntry(one.line, entry.point("at"), needs, worth, load, deadline, robots)
    return found


def read_synergies(node: Node | None, tasks: Collection[str], mistakes: DiagnosticCollector) -> list[Synergy]:
    """Return the synergies in a section; mistakes are noted."""
    if node is None:
        return []
    if node.items is None:
        raise MistakeError(
            "synergies is no list", "write - {tasks: [ONE, OTHER], worth: NUMBER}, one a line", node.line
        )
    found = []
    for one in node.items:
        with mistakes.at(one.line):
            entry = Entry("a synergy", one, ("tasks", "worth"))
            names = entry.words("tasks")
            for name in names:
                if name not in tasks:
                    raise MistakeError(
                        f"a synergy has the task '{shortened(name)}', which is not there",
                        suggestion(name, tasks, "tasks"),
                        one.line,
                    )
            if len(set(names)) != _PLANE or len(names) != _PLANE:
                raise MistakeError("a synergy is not of two tasks", "write tasks: [ONE, OTHER]", one.line)
            found.append(Synergy(one.line, (names[0], names[1]), entry.needed("worth", -MOST)))
    return found


def _named(section: str, node: Node | None) -> Iterator[tuple[str, Node]]:
    if node is None or node.entries is None:
        what = f"has no {section}" if node is None else f"{section} is no mapping"
        raise MistakeError(what, f"write {section}: and, below, NAME: {{at: [X, Y], ...}}", node.line if node else 0)
    if not node.entries:
        raise MistakeError(f"has no {section}", "write at least one", node.line)
    names = set()
    for key, one in node.entries.items():
        name = word_of(Node(one.line, key))
        if name in names:
            raise MistakeError(f"{section} has '{shortened(name)}' twice", "name one otherwise", one.line)
        names.add(name)
        yield name, Node(one.line, entries={}) if _is_empty(one) else one


def _is_empty(node: Node) -> bool:
    return node.is_scalar and node.scalar is None
