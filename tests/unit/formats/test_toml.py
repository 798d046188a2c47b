"""TOML is read as Python reads it, within bounds."""

from __future__ import annotations

import tomllib

import pytest

from robochoc.formats.toml import MAX_PARTS, toml_tables
from tests.support.cases import looped


@looped("line", ["{key} = 1", "[{key}]", "[[{key}]]", "x = {{ y = 1, {key} = 2 }}", "x = [{{{key} = 2}}]"])
@looped("part", ["a", '"a.b\\""', "'a b'", "a "])
def test_keys_of_many_parts_are_refused_at_once(line: str, part: str) -> None:
    with pytest.raises(ValueError, match=r"a key of more than 16 parts \(at line 2\)"):
        toml_tables("\n" + line.format(key=".".join([part] * 50_000)))
    text = line.format(key=".".join([part] * MAX_PARTS))
    assert toml_tables(text) == tomllib.loads(text)


def test_dots_in_texts_are_no_keys_and_deep_lists_are_refused() -> None:
    dots = ".".join("a" * 100)
    for text in (f'x = "{dots}"', f"x = '''\nso {dots} on'''", f"# {dots}", "x = [1.5, 2.5]"):
        assert toml_tables(text) == tomllib.loads(text)
    with pytest.raises(ValueError, match="nested too deeply"):
        toml_tables(f"x = {'[' * 20_000}")
