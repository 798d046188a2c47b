"""Read YAML 1.1 as a tree with line numbers. The values are those of pyDCOP's loader. Nothing is executed.

PyYAML only parses the events. This module builds the tree, so that the depth and the size (with aliases counted in
full) are limited before the tree exists.
"""

from __future__ import annotations

import difflib
import math
from collections import deque
from collections.abc import Callable, Iterator, Mapping
from dataclasses import field
from fractions import Fraction
from typing import Any, TypeVar

import yaml  # noqa: TID251 - here, and nowhere else

from robochoc.formats.diagnostics import MistakeError, shortened, suggestion
from robochoc.system.lazy_dataclass import dataclass

MAX_BYTES = 64 * 1024 * 1024
"""The maximum size of all files together, in bytes."""
MAX_DEPTH = 32
"""The maximum depth of nested lists and mappings."""
MAX_NODES = 2_000_000
"""The maximum number of values. Values repeated by aliases count each time."""

Scalar = None | bool | int | Fraction | float | str
"""A single value. YAML floats are exact fractions; only infinities are floats."""

_LOADER = getattr(yaml, "CSafeLoader", yaml.SafeLoader)
_CORE = "tag:yaml.org,2002:"
_SCALARS = {_CORE + name for name in ("null", "bool", "int", "float", "str", "value")}
_MERGE = _CORE + "merge"


Read = TypeVar("Read")
_NOTHING_ASKED: frozenset[Scalar] = frozenset()
_ALIKE = 0.75
"""Keys with a higher similarity are treated as misspellings of each other."""
_Path = tuple["_Path", str | int] | None
"""The path from the root to a value: the path to its parent, and the value's key or index in the parent."""


class Node:
    """A value in the file, with a record of the parts that a reader has used.

    Readers access the parts only by `scalar`, `items`, `get` and `named`. Each of these marks its results as read, and
    `read_yaml` rejects a file with unread parts. `skip` marks everything below a value as ignored on purpose.

    Attributes:
        line: The line where the value begins, from 1.
        size: The number of values it contains.
        is_named: True if it has an anchor that an alias refers to.
        written: The text of a truth value or of null in the file, such as `true`; empty for other values.
    """

    __slots__ = ("_asked", "_is_read", "_is_skipped", "_key_lines", "_value", "is_named", "line", "size", "written")

    def __init__(
        self,
        line: int,
        value: Scalar | MistakeError | list[Node] | dict[Scalar, Node] = None,
        key_lines: dict[Scalar, int] | None = None,
        written: str = "",
    ) -> None:
        self.line = line
        self.size = 1
        self.written = written
        self.is_named = False
        self._value = value
        self._is_read = self._is_skipped = False
        self._asked: set[Scalar] | frozenset[Scalar] = _NOTHING_ASKED
        self._key_lines = key_lines

    @property
    def is_scalar(self) -> bool:
        """Return whether it is a single value."""
        return not isinstance(self._value, (list, dict))

    @property
    def is_empty(self) -> bool:
        """Return whether the value is empty."""
        return self._value is None

    @property
    def is_mapping(self) -> bool:
        """Return whether it is a mapping."""
        return isinstance(self._value, dict)

    @property
    def scalar(self) -> Scalar:
        """Return a single value, or None for an empty value, a list or a mapping.

        Raises:
            MistakeError: The value is invalid, such as `.nan`. A reader may catch it, and continue with other values.
        """
        if isinstance(self._value, (list, dict, MistakeError)):
            if isinstance(self._value, MistakeError):
                self._is_read = True
                raise self._value
            return None
        self._is_read = True
        return self._value

    @property
    def items(self) -> list[Node] | None:
        """Return the values in a list, or None for anything else."""
        if not isinstance(self._value, list):
            return None
        self._is_read = True
        return self._value

    def get(self, key: str) -> Node | None:
        """Return the value of a key, or None if it is missing or this value is not a mapping."""
        if not isinstance(self._value, dict):
            return None
        self._is_read = True
        if not isinstance(self._asked, set):
            self._asked = set(self._asked)
        self._asked.add(key)
        return self._value.get(key)

    def named(self) -> Iterator[tuple[Scalar, Node]]:
        """Yield the keys and values of a mapping whose keys the author of the file chooses; nothing if it is none."""
        if isinstance(self._value, dict):
            self._is_read = True
            self._asked = frozenset(self._value)
            yield from self._value.items()

    def skip(self) -> None:
        """Ignore this value and everything below it."""
        self._is_read = self._is_skipped = True

    def key_line(self, key: Scalar) -> int:
        """Return the line of a key."""
        return (self._key_lines or {}).get(key, self.line)

    def needed(self, key: str, owner: str, hint: str = "") -> Node:
        """Return the value of a key that a mapping must have.

        Args:
            key: The key.
            owner: The name of the mapping in messages.
            hint: A suggestion to the user.

        Raises:
            MistakeError: if the key is missing. The message names a key that may be a misspelling.
        """
        found = self.get(key)
        if found is not None:
            return found
        keys = {scalar_text(one)[:40]: one for one in self._value} if isinstance(self._value, dict) else {}
        for close in difflib.get_close_matches(key, [one for one in keys if one != key], n=1, cutoff=_ALIKE):
            message = f"unknown key '{shortened(close)}' in {owner}"
            raise MistakeError(message, f"did you mean '{key}'?", self.key_line(keys[close]))
        raise MistakeError(f"{owner} has no {key}", hint or f"write {key}:", self.line)

    def copy(self, line: int) -> Node:
        """Return a node for an alias in `line`, with the same parts."""
        alias = Node(line, self._value, self._key_lines, self.written)
        alias.size = self.size
        return alias

    @property
    def is_done(self) -> bool:
        """Return whether this is a single value that a reader has used."""
        return self._is_read and self.is_scalar

    def unread(self, path: _Path) -> Iterator[MistakeError | tuple[Node, _Path]]:
        """Yield an error for each part that no reader has used, and the remaining parts, which must still be checked.

        Args:
            path: The path to this value.
        """
        if self._is_skipped:
            return
        if not self._is_read:
            if self._value is not None:
                yield self._unused(path)
        elif isinstance(self._value, list):
            yield from ((one, (path, number)) for number, one in enumerate(self._value) if not one.is_done)
        elif isinstance(self._value, dict):
            for key, one in self._value.items():
                if key in self._asked:
                    if not one.is_done:
                        yield one, (path, scalar_text(key))
                elif not one.is_named:  # a part repeated by an alias need not be read here
                    yield self._unknown(key, path)

    def _unused(self, path: _Path) -> MistakeError:
        if isinstance(self._value, MistakeError):
            return self._value
        what = "a list" if isinstance(self._value, list) else "a mapping" if self.is_mapping else "a value"
        return MistakeError(
            f"{_written(path)}: {what} does not belong here", "delete it, or check the format", self.line
        )

    def _unknown(self, key: Scalar, path: _Path) -> MistakeError:
        where = f" in {_written(path)}" if path else ""
        known = sorted(str(one) for one in self._asked)
        return MistakeError(
            f"unknown key '{shortened(scalar_text(key))}'{where}",
            suggestion(scalar_text(key), known, "keys"),
            self.key_line(key),
        )

    def append(self, node: Node) -> None:
        """Add a value to a list."""
        if isinstance(self._value, list):
            self._value.append(node)

    def enter(self, key: Scalar, node: Node, line: int) -> bool:
        """Add a key and its value to a mapping. Return whether the key is new there; merged keys do not count."""
        if isinstance(self._value, dict):
            self._value[key] = node
        if self._key_lines is None:
            self._key_lines = {}
        is_new = key not in self._key_lines
        self._key_lines[key] = line
        return is_new

    def merge(self, entries: Mapping[Scalar, Node]) -> None:
        """Add those keys of another mapping that are not yet present."""
        if isinstance(self._value, dict):
            self._value.update({key: one for key, one in entries.items() if key not in self._value})


def _written(path: _Path) -> str:
    steps = []
    while path:
        path, step = path
        steps.append(f"[{step}]" if isinstance(step, int) else f".{shortened(step)}")
    return "".join(reversed(steps)).removeprefix(".") or "the file"


_PROBLEM = "a problem has a name, an objective, domains, variables and constraints"
Repeated = Callable[[int, str], None]
"""A function called for each duplicate key, with the line and the key. The later value counts."""


def read_yaml(
    text: str, read: Callable[[Node], Read], expected: str = _PROBLEM, repeated: Repeated | None = None
) -> Read:
    """Return the result of `read` for the single document in `text`.

    Args:
        text: The file.
        read: Reads the root and all its parts.
        expected: The usual content of such a file.
        repeated: Called for each duplicate key. None: duplicate keys are errors.

    Raises:
        MistakeError: if the text is empty, is not valid YAML, or has a part that `read` did not use. It contains the
            line.
    """
    root = _tree(text, expected, repeated or _refuse_repeated)
    found = read(root)
    for mistake in unread_parts(root):
        raise mistake
    return found


def unread_parts(root: Node) -> list[MistakeError]:
    """Return an error for each part below `root`, at any depth, that no reader has used."""
    found: list[MistakeError] = []
    left: deque[tuple[Node, _Path]] = deque([(root, None)])
    while left:
        node, path = left.popleft()
        for part in node.unread(path):
            if isinstance(part, MistakeError):
                found.append(part)
            else:
                left.append(part)
    return sorted(found, key=lambda one: one.line)


def root_keys(text: str) -> set[str]:
    """Return the keys of the root mapping in `text`, which may be just the beginning of a file."""
    keys, depth, is_key = set(), 0, True
    try:
        for event in yaml.parse(text, Loader=_LOADER):
            if isinstance(event, (yaml.MappingStartEvent, yaml.SequenceStartEvent)):
                depth += 1
                is_key = depth == 1
            elif isinstance(event, (yaml.MappingEndEvent, yaml.SequenceEndEvent)):
                depth -= 1
                is_key = True
            elif isinstance(event, (yaml.ScalarEvent, yaml.AliasEvent)) and depth == 1:
                if is_key and isinstance(event, yaml.ScalarEvent):
                    keys.add(event.value)
                is_key = not is_key
            if depth > MAX_DEPTH:
                break
    except (yaml.YAMLError, ValueError):
        pass  # the error is reported when the whole file is read
    return keys


def _refuse_repeated(line: int, key: str) -> None:
    raise MistakeError(f"duplicate key '{shortened(key)}'", "delete or rename one of them", line)


def _tree(text: str, expected: str, repeated: Repeated) -> Node:
    try:
        events = yaml.parse(text, Loader=_LOADER)
        return _Composer(expected, repeated).root(events)
    except yaml.MarkedYAMLError as error:
        line = error.problem_mark.line + 1 if error.problem_mark else 0
        raise MistakeError(f"is not YAML: {error.problem or error.context}", "correct it there", line) from None
    except (yaml.YAMLError, ValueError) as error:
        raise MistakeError(f"is not YAML: {shortened(str(error))}", "correct the file") from None


class _Composer:
    """Builds the tree from events. It uses an explicit stack instead of recursion."""

    def __init__(self, expected: str, repeated: Repeated) -> None:
        self._expected = expected
        self._repeated = repeated
        self._plain = yaml.SafeLoader("")
        self._anchors: dict[str, Node] = {}
        self._open: list[_Open] = []
        self._root: Node | None = None

    def root(self, events: Iterator[Any]) -> Node:
        documents = 0
        for event in events:
            line = event.start_mark.line + 1
            match event:
                case yaml.DocumentStartEvent():
                    documents += 1
                    if documents > 1:
                        raise MistakeError(
                            "the file has a second document", "keep one document: delete the '---'", line
                        )
                case yaml.AliasEvent():
                    self._add(self._alias(str(event.anchor), line))
                case yaml.ScalarEvent():
                    value = self._scalar(event, line)
                    written = event.value if value is None or isinstance(value, bool) else ""
                    self._add(self._anchored(event.anchor, Node(line, value, written=written)), event)
                case yaml.SequenceStartEvent() | yaml.MappingStartEvent():
                    self._begin(event, line)
                case yaml.SequenceEndEvent() | yaml.MappingEndEvent():
                    self._end()
                case _:
                    pass
        if self._root is None:
            raise MistakeError("is empty", self._expected)
        return self._root

    def _alias(self, anchor: str, line: int) -> Node:
        node = self._anchors.get(anchor)
        if node is None:
            raise MistakeError(
                f"the alias *{shortened(anchor)} has no anchor before it",
                f"define the anchor &{shortened(anchor)} above",
                line,
            )
        node.is_named = True
        return node.copy(line)

    def _begin(self, event: Any, line: int) -> None:  # noqa: ANN401 - an event of either kind
        is_list = isinstance(event, yaml.SequenceStartEvent)
        if event.tag not in (None, "!", _CORE + ("seq" if is_list else "map")):
            raise _tag_mistake(event.tag, line)
        if len(self._open) == MAX_DEPTH:
            raise MistakeError("is nested too deeply", f"use at most {MAX_DEPTH} levels", line)
        node = Node(line, []) if is_list else Node(line, {})
        self._open.append(_Open(node, event.anchor))

    def _end(self) -> None:
        done = self._open.pop()
        self._add(self._anchored(done.anchor, done.node))

    def _anchored(self, anchor: str | None, node: Node) -> Node:
        if anchor is not None:
            self._anchors[anchor] = node
        return node

    def _add(self, node: Node, event: Any = None) -> None:  # noqa: ANN401 - an event, where it is a scalar's
        """Add a finished value to the list or mapping that contains it."""
        if not self._open:
            self._root = node
            return
        holder = self._open[-1]
        holder.node.size += node.size
        if holder.node.size > MAX_NODES:
            raise MistakeError(
                f"has more than {MAX_NODES} values, counting what aliases repeat", "write fewer", node.line
            )
        if not holder.node.is_mapping:
            holder.node.append(node)
        elif holder.key is None:
            holder.key = (self._key(node), node.line, event is not None and self._is_merge(event))
        else:
            self._enter(holder, node)

    def _enter(self, holder: _Open, node: Node) -> None:
        (key, line, merges), holder.key = holder.key or (None, 0, False), None
        if merges:
            for source in node.items or [node]:
                if not source.is_mapping:
                    raise MistakeError("'<<' merges a value that is not a mapping", "write an alias after it", line)
                holder.merged.update({key: one for key, one in source.named() if key not in holder.merged})
            holder.node.merge(holder.merged)
        elif not holder.node.enter(key, node, line):
            self._repeated(line, scalar_text(key))

    def _key(self, node: Node) -> Scalar:
        if not node.is_scalar:
            raise MistakeError("a key is a list or a mapping", "use a name or a number", node.line)
        return node.scalar

    def _is_merge(self, event: Any) -> bool:  # noqa: ANN401 - a scalar's event
        return bool(event.value == "<<" and event.implicit[0] and not event.style)  # libyaml has "" for None

    def _scalar(self, event: Any, line: int) -> Scalar | MistakeError:  # noqa: ANN401 - a scalar's event
        """Return the value, or the error for an invalid one, which `Node.scalar` raises."""
        tag = event.tag
        if tag is None or tag == "!":
            tag = str(self._plain.resolve(yaml.ScalarNode, event.value, event.implicit))  # type: ignore[no-untyped-call]
        if tag == _MERGE:
            return "<<"
        if tag not in _SCALARS:
            if tag == _CORE + "timestamp":
                what = f"{shortened(event.value)} is a date, which is not supported"
                return MistakeError(what, "write it in quotes", line)
            raise _tag_mistake(tag, line)
        try:
            value = self._constructed(tag, event.value)
        except (ValueError, KeyError, OverflowError, yaml.YAMLError):
            what = f"'{shortened(event.value)}' is not a valid {tag.removeprefix(_CORE)}"
            return MistakeError(what, "correct the number, or write it in quotes", line)
        if not isinstance(value, float):
            return value
        if math.isnan(value):
            return MistakeError(".nan is not a number", "write a number", line)
        return value if math.isinf(value) else Fraction(repr(value))

    def _constructed(self, tag: str, text: str) -> bool | int | float | str | None:
        """Return the value that PyYAML's safe loader constructs for a scalar."""
        node = yaml.ScalarNode(tag, text)
        match tag.removeprefix(_CORE):
            case "null":
                return None
            case "bool":
                return bool(self._plain.construct_yaml_bool(node))
            case "int":
                return int(self._plain.construct_yaml_int(node))
            case "float":
                return float(self._plain.construct_yaml_float(node))
            case _:
                return text


@dataclass(slots=True)
class _Open:
    """An incomplete list or mapping, and the key of the next value."""

    node: Node
    anchor: str | None
    key: tuple[Scalar, int, bool] | None = None
    merged: dict[Scalar, Node] = field(default_factory=dict)


def scalar_text(value: Scalar) -> str:
    """Return `value` formatted like Python's `str`, because pyDCOP compares this text with the words in a table."""
    return repr(float(value)) if isinstance(value, Fraction) else str(value)


def _tag_mistake(tag: str, line: int) -> MistakeError:
    short = tag.replace(_CORE, "!!", 1)
    return MistakeError(f"the tag {shortened(short)} is not allowed", "delete it: only plain data is read", line)
