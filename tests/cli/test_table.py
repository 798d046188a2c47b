"""Tables for people and pipes."""

from __future__ import annotations

import pytest

from robochoc.cli.reports.table import table_lines

HEADINGS = ("name", "messages", "use when")
ROWS = [("abt", "1,053", "no costs: the default"), ("機器人", "7", "\x1b[31mred\n")]


def test_columns_are_aligned_and_nothing_in_them_is_obeyed() -> None:
    assert table_lines(HEADINGS, ROWS, right={"messages"}) == [
        "name    messages  use when",
        "abt        1,053  no costs: the default",
        r"機器人         7  \x1b[31mred\n",
    ]


@pytest.mark.parametrize("width", [10, 40])
def test_prose_is_wrapped_to_the_terminal(width: int) -> None:
    lines = table_lines(HEADINGS, [("dpop", "12", "word " * 12)], right={"messages"}, prose="use when", width=width)
    assert all(len(line) <= max(width, 16 + 20) for line in lines)
    assert [line[:16].split() for line in lines[1:3]] == [["dpop", "12"], []]
    assert " ".join(line[16:].strip() for line in lines[1:]) == ("word " * 12).strip()


def test_a_table_without_rows_has_headings() -> None:
    assert table_lines(HEADINGS, []) == ["name  messages  use when"]
