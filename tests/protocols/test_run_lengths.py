"""Run lengths against plain lists."""

from __future__ import annotations

from random import Random

from robochoc.protocols.optimization.run_lengths import Columns, RunLengths, appended, expanded, fits, prepended
from tests.support.examples import count
from tests.support.sfb_robots import grouped


@count("lists", 300, 5000)
def test_lists_in_runs_are_those_lists(lists: int) -> None:
    chance = Random("runs")
    for _ in range(lists):
        items = chance.choices("abcd", (9, 2, 1, 1), k=chance.randrange(12))
        distinct, runs = grouped(items)
        assert fits(len(distinct), runs, len(items))
        assert expanded(distinct, runs) == items
        other = chance.choice("abcde")
        assert appended(distinct, runs, other) == grouped([*items, other])
        assert prepended(other, distinct, runs) == grouped([other, *items])
        assert (distinct, runs) == grouped(items), "the given lists stay as they are"
        known = RunLengths(distinct, runs)
        assert [known[place] for place in range(len(known))] == items
        start, stop = sorted(chance.choices(range(len(items) + 1), k=2))
        part = known.counted(start, stop)
        assert [item for item, times in part for _ in range(times)] == items[start:stop]
        more = known.followed_by(*grouped(items[start:]))
        assert expanded(more.distinct, more.runs) == items + items[start:]


@count("lists", 100, 1000)
def test_columns_are_counted_by_runs(lists: int) -> None:
    chance = Random("columns")
    for _ in range(lists):
        widths = chance.choices((1, 2, 7), (5, 1, 1), k=chance.randrange(12))
        columns = Columns(RunLengths(*grouped(widths)).counted(0, len(widths)))
        assert [columns.start(place) for place in range(len(widths))] == [sum(widths[:p]) for p in range(len(widths))]
        assert columns.total == sum(widths)
