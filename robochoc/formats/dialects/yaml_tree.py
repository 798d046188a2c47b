"""YAML 1.1 as a bounded tree with line numbers: what pyDCOP's loader would see, and nothing that is executed.

PyYAML only finds the events; the tree is made of them here, so that its depth and size, aliases counted in full, are
bounded before they are there.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, field
from fractions import Fraction
from typing import Any

import yaml

from robochoc.formats.diagnostics import MistakeError, shortened

MAX_BYTES = 64 * 1024 * 1024
"""The maximum size of all files together."""
MAX_DEPTH = 32
"""The maximum depth of nested lists and mappings."""
MAX_NODES = 2_000_000
"""The maximum number of values, those behind aliases counted each time."""

Scalar = None | bool | int | Fraction | float | str
"""A value: a float of YAML is the decimal that it shows, as a fraction; only infinities are floats."""

_CORE = "tag:yaml.org,2002:"
_SCALARS = {_CORE + name for name in ("null", "bool", "int", "float", "str", "value")}
_MERGE = _CORE + "merge"


@dataclass(slots=True)
class Node:
    """A value of the file: one of `scalar`, `items` and `entries` holds it.

    Attributes:
        line: Where it begins, from 1 on.
        scalar: A single value.
        items: A list.
        entries: A mapping.
        keys: Where the keys of a mapping stand.
        size: The number of values in it.
    """

    line: int
    scalar: Scalar = None
    items: list[Node] | None = None
    entries: dict[Scalar, Node] | None = None
    keys: dict[Scalar, int] = field(default_factory=dict)
    size: int = 1

    @property
    def is_scalar(self) -> bool:
        """Return whether it is a single value."""
        return self.items is None and self.entries is None


@dataclass(frozen=True)
class Document:
    """A YAML document.

    Attributes:
        root: Its tree.
        repeated: Keys that stand twice in one mapping, with the line of the later one, which counts.
    """

    root: Node
    repeated: tuple[tuple[int, str], ...]


_PROBLEM = "a problem has a name, an objective, domains, variables and constraints"


def read_yaml(text: str, expected: str = _PROBLEM) -> Document:
    """Return the one document in `text`; `expected` says what such a file has.

    Raises:
        MistakeError: It is empty, or not such YAML. It has the line.
    """
    try:
        return _Composer(expected).document(yaml.parse(text, Loader=getattr(yaml, "CSafeLoader", yaml.SafeLoader)))
    except yaml.MarkedYAMLError as error:
        line = error.problem_mark.line + 1 if error.problem_mark else 0
        raise MistakeError(f"is not YAML: {error.problem or error.context}", "mend it there", line) from None
    except (yaml.YAMLError, ValueError) as error:
        raise MistakeError(f"is not YAML: {shortened(str(error))}", "mend the file") from None


class _Composer:
    """Makes the tree of events, with a stack of its own: nesting does not recurse."""

    def __init__(self, expected: str) -> None:
        self._expected = expected
        self._plain = yaml.SafeLoader("")
        self._anchors: dict[str, Node] = {}
        self._open: list[_Open] = []
        self._repeated: list[tuple[int, str]] = []
        self._root: Node | None = None

    def document(self, events: Iterator[Any]) -> Document:
        documents = 0
        for event in events:
            line = event.start_mark.line + 1
            match event:
                case yaml.DocumentStartEvent():
                    documents += 1
                    if documents > 1:
                        raise MistakeError("a second document", "one problem is one document: delete the '---'", line)
                case yaml.AliasEvent():
                    self._add(self._alias(str(event.anchor), line))
                case yaml.ScalarEvent():
                    self._add(self._anchored(event.anchor, Node(line, self._scalar(event, line))), event)
                case yaml.SequenceStartEvent() | yaml.MappingStartEvent():
                    self._begin(event, line)
                case yaml.SequenceEndEvent() | yaml.MappingEndEvent():
                    self._end()
                case _:
                    pass
        if self._root is None:
            raise MistakeError("is empty", self._expected)
        return Document(self._root, tuple(self._repeated))

    def _alias(self, anchor: str, line: int) -> Node:
        node = self._anchors.get(anchor)
        if node is None:
            raise MistakeError(
                f"the alias *{shortened(anchor)} has no anchor before it", "write & before its name", line
            )
        return node

    def _begin(self, event: Any, line: int) -> None:  # noqa: ANN401 - an event of either kind
        is_list = isinstance(event, yaml.SequenceStartEvent)
        if event.tag not in (None, "!", _CORE + ("seq" if is_list else "map")):
            raise _tag_mistake(event.tag, line)
        if len(self._open) == MAX_DEPTH:
            raise MistakeError("is nested too deeply", f"{MAX_DEPTH} levels are allowed", line)
        node = Node(line, items=[]) if is_list else Node(line, entries={})
        self._open.append(_Open(node, event.anchor))

    def _end(self) -> None:
        done = self._open.pop()
        self._add(self._anchored(done.anchor, done.node))

    def _anchored(self, anchor: str | None, node: Node) -> Node:
        if anchor is not None:
            self._anchors[anchor] = node
        return node

    def _add(self, node: Node, event: Any = None) -> None:  # noqa: ANN401 - an event, where it is a scalar's
        """Put a finished value where it belongs."""
        if not self._open:
            self._root = node
            return
        holder = self._open[-1]
        holder.node.size += node.size
        if holder.node.size > MAX_NODES:
            raise MistakeError(
                f"has more than {MAX_NODES} values, counting what aliases repeat", "write fewer", node.line
            )
        if holder.node.items is not None:
            holder.node.items.append(node)
        elif holder.key is None:
            holder.key = (self._key(node), node.line, event is not None and self._is_merge(event))
        else:
            self._enter(holder, node)

    def _enter(self, holder: _Open, node: Node) -> None:
        (key, line, merges), holder.key = holder.key or (None, 0, False), None
        entries = holder.node.entries
        if entries is None:
            return
        if merges:
            for source in node.items if node.items is not None else [node]:
                if source.entries is None:
                    raise MistakeError("'<<' merges something that is no mapping", "let an alias follow it", line)
                holder.merged.update({key: one for key, one in source.entries.items() if key not in holder.merged})
            for known, one in holder.merged.items():
                entries.setdefault(known, one)
            return
        if key in holder.node.keys:
            self._repeated.append((line, shown(key)))
        entries[key] = node
        holder.node.keys[key] = line

    def _key(self, node: Node) -> Scalar:
        if not node.is_scalar:
            raise MistakeError("a list or a mapping as a key", "keys are names and numbers", node.line)
        return node.scalar

    def _is_merge(self, event: Any) -> bool:  # noqa: ANN401 - a scalar's event
        return bool(event.value == "<<" and event.implicit[0] and event.style is None)

    def _scalar(self, event: Any, line: int) -> Scalar:  # noqa: ANN401 - a scalar's event
        tag = event.tag
        if tag is None or tag == "!":
            tag = str(self._plain.resolve(yaml.ScalarNode, event.value, event.implicit))  # type: ignore[no-untyped-call]
        if tag == _MERGE:
            return "<<"
        if tag not in _SCALARS:
            if tag == _CORE + "timestamp":
                raise MistakeError(f"the date {shortened(event.value)}", "write it in quotes", line)
            raise _tag_mistake(tag, line)
        try:
            value = self._made(tag, event.value)
        except (ValueError, KeyError, OverflowError, yaml.YAMLError):
            what = f"'{shortened(event.value)}' is no {tag.removeprefix(_CORE)}"
            raise MistakeError(what, "mend the number, or write it in quotes", line) from None
        if not isinstance(value, float):
            return value
        if math.isnan(value):
            raise MistakeError(".nan is no number", "write a number", line)
        return value if math.isinf(value) else Fraction(repr(value))

    def _made(self, tag: str, text: str) -> bool | int | float | str | None:
        """Return a scalar as PyYAML's safe loader makes it."""
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
    """A list or a mapping that has not ended yet, and the key whose value comes next."""

    node: Node
    anchor: str | None
    key: tuple[Scalar, int, bool] | None = None
    merged: dict[Scalar, Node] = field(default_factory=dict)


def shown(value: Scalar) -> str:
    """Return `value` as pyDCOP compares it with the words of a table: as Python's `str` has it."""
    return repr(float(value)) if isinstance(value, Fraction) else str(value)


def _tag_mistake(tag: str, line: int) -> MistakeError:
    short = tag.replace(_CORE, "!!", 1)
    return MistakeError(f"the tag {shortened(short)} is not allowed", "problems are plain data: delete the tag", line)
