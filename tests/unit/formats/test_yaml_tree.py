"""YAML trees: each part of a file is read, left out on purpose, or refused with its line."""

from __future__ import annotations

import pytest

from robochoc.formats.diagnostics import MistakeError
from robochoc.formats.yaml_tree import Node, read_yaml, root_keys
from tests.support.cases import looped

TEXT = """name: n
robots:
  ann: {at: [0, 1], note: {any: thing}}
  bob: &bob {at: [2, 3]}
  cid: *bob
  dan: {<<: *bob, speed: 2}
"""


def _numbers(node: Node | None) -> list[object]:
    return [one.scalar for one in node.items or ()] if node else []


def _read(root: Node) -> object:
    """Read a file as strictly as a reader of robots: places, speeds, and a note that is left out."""
    name, robots = root.get("name"), root.needed("robots", "the file")
    found = {}
    for key, robot in robots.named():
        speed = robot.get("speed")
        if note := robot.get("note"):
            note.skip()
        found[key] = _numbers(robot.get("at")), speed.scalar if speed else None
    return name.scalar if name else None, found


def test_aliases_and_merged_mappings_are_read_in_place() -> None:
    both = [2, 3]
    assert read_yaml(TEXT, _read) == (
        "n",
        {"ann": ([0, 1], None), "bob": (both, None), "cid": (both, None), "dan": (both, 2)},
    )


@looped(
    ("now", "then", "line", "message", "hint"),
    [
        ("name: n", "nam: n", 1, "unknown key 'nam'", "did you mean 'name'?"),
        ("{at: [0, 1],", "{at: [0, 1], sped: 3,", 3, "unknown key 'sped' in robots.ann", "did you mean 'speed'?"),
        ("*bob, speed: 2", "*bob, zzz: 2", 6, "unknown key 'zzz' in robots.dan", "known keys: at note speed"),
        ("{at: [2, 3]}", "{at: [2, 3], aat: 1}", 4, "unknown key 'aat' in robots.bob", "did you mean 'at'?"),
        ("speed: 2", "speed: [2]", 6, "robots.dan.speed: a list does not belong here", "delete it"),
        ("speed: 2", "speed: {}", 6, "robots.dan.speed: a mapping does not belong here", "delete it"),
        ("[0, 1]", "[0, {x: 1}]", 3, "robots.ann.at[1]: a mapping does not belong here", "delete it"),
        ("&bob {at: [2, 3]}\n  cid: *bob\n  dan: {<<: *bob, ", "3\n  dan: {", 4,
         "robots.bob: a value does not belong here", "delete it"),
        ("robots:", "robot:", 2, "unknown key 'robot' in the file", "did you mean 'robots'?"),
        ("robots:", "people:", 1, "the file has no robots", "write robots:"),
        ("name: n", "name: n\nname: m", 2, "duplicate key 'name'", "delete or rename one"),
    ],
)  # fmt: skip
def test_parts_that_no_reader_uses_are_refused(now: str, then: str, line: int, message: str, hint: str) -> None:
    assert now in TEXT
    with pytest.raises(MistakeError) as caught:
        read_yaml(TEXT.replace(now, then, 1), _read)
    assert (caught.value.line, caught.value.message) == (line, message)
    assert caught.value.hint.startswith(hint)


def test_a_part_that_only_aliases_use_needs_no_reader_of_its_own() -> None:
    text = "shared: &shared [0, 1]\nrobots: {ann: {at: *shared}}\n"
    assert read_yaml(text, _read) == (None, {"ann": ([0, 1], None)})
    with pytest.raises(MistakeError, match="unknown key 'shared'"):
        read_yaml(text.replace("*shared", "[0, 1]"), _read)


def test_keys_of_the_root_are_found_in_every_style_and_in_beginnings() -> None:
    for text in (
        "{a: 1, b: {c: 2}, d: [e, {f: g}], h: 1}",
        '{"a": 1, "b": {"c": 2}, "d": [1], "h": 1}',
        "a: 1\nb:\nd:\nh: ",
    ):
        assert root_keys(text) == {"a", "b", "d", "h"}
    assert root_keys("{a: 1, b: {c: ") == {"a", "b"}
    assert root_keys("[" * 100_000) == root_keys("") == set()
