"""DPOP's tables: what they say, how they travel, and that they take no more memory than was told before."""

from __future__ import annotations

import itertools
import math
import tracemalloc
from random import Random
from typing import Literal

import numpy as np
import pytest

from robochoc.communication.processes import queues
from robochoc.communication.processes.robot_process import QueueRobot
from robochoc.journal.events import AnyEvent, Sent
from robochoc.model.expression import Type, parse
from robochoc.model.problem import Constraint, Predicate, Team
from robochoc.protocols.inference import dpop_tables
from robochoc.protocols.inference.dpop_tables import (
    CoarseTable,
    Extent,
    IncomingTable,
    Result,
    Table,
    aligned,
    are_all_infinite,
    bytes_of,
    coarse,
    expanded,
    packed_costs,
    project,
)
from robochoc.protocols.inference.dpop_tables import width_of as width_for
from robochoc.run import Options, Runtime, solve
from tests.support.cases import looped
from tests.support.cost_problems import with_costs
from tests.support.problems import ON_ONE_MACHINE, team_of

SMALL = ((1, 1), (4, 2), (12, 1), (40, 3), (1 << 17, 16))
"""Blocks of a few cells, so that there are many of them; and how many of them may be one."""


def random_table(chance: np.random.Generator, shape: list[int], most: int, *, coded: bool) -> Table:
    """Costs up to `most`, some of them `inf`; as they are, or as codes."""
    costs = chance.integers(0, most + 1, shape).astype(np.float64)
    broken = chance.random(shape) < 0.2
    if not coded:
        costs[broken] = np.inf
        return costs
    width = width_for(most)
    codes = costs.astype(f"<u{width}")
    codes[broken] = 2 ** (8 * width) - 1
    return codes


def random_coarse_table(chance: np.random.Generator, shape: list[int], most: int) -> Table | CoarseTable:
    """A random table that does not distinguish all indices on some of its axes."""
    stored = [int(chance.integers(1, size + 1)) if size > 1 and chance.random() < 0.3 else size for size in shape]
    table = random_table(chance, stored, most, coded=bool(chance.random() < 0.5))
    return coarse(
        table,
        [None if there == size else chance.integers(0, there, size) for there, size in zip(stored, shape, strict=True)],
    )


def plain(table: Table) -> np.ndarray[tuple[int, ...], np.dtype[np.float64]]:
    """Costs as they are."""
    costs = table.astype(np.float64)
    if table.dtype.kind == "u":
        costs[table == 2 ** (8 * table.itemsize) - 1] = np.inf
    return costs


@looped("small", (0, 20, 1 << 12))
@looped(("block", "longest"), SMALL)
@pytest.mark.parametrize("seeds", [range(60), pytest.param(range(60, 1000), marks=pytest.mark.more)], ids=str)
def test_a_projection_is_the_least_of_the_sum(
    monkeypatch: pytest.MonkeyPatch, block: int, longest: int, small: int, seeds: range
) -> None:
    """With `small` = 0 all numbers are integers, with the largest one all joins here are of floats."""
    monkeypatch.setattr(dpop_tables, "BLOCK", block)
    monkeypatch.setattr(dpop_tables, "LONGEST", longest)
    monkeypatch.setattr(dpop_tables, "SMALL", small)
    for seed in seeds:
        chance = np.random.default_rng(seed)
        most = int(chance.choice([3, 80, 20_000, 2_000_000, 10**14]))
        shape = [int(size) for size in chance.integers(2, 5, chance.integers(0, 5))]
        own = int(chance.integers(1, 5))
        charges = [math.inf if chance.random() < 0.1 else float(chance.integers(0, most)) for _ in range(own)]
        tables = []
        for _ in range(chance.integers(0, 4)):
            lengths = [own, *(size if chance.random() < 0.6 else 1 for size in shape)]
            tables.append(random_coarse_table(chance, lengths, most))
        costs, choices = project(shape, charges, tables, most * (len(tables) + 1))
        start = np.array(charges).reshape(-1, *(1 for _ in shape))
        joined = np.broadcast_to(sum((plain(expanded(table)) for table in tables), start=start), (own, *shape))
        np.testing.assert_array_equal(plain(costs), joined.min(axis=0))
        np.testing.assert_array_equal(choices, joined.argmin(axis=0))
        assert are_all_infinite(costs) == bool(np.isinf(joined).all())


def test_axes_are_turned_and_added_and_those_of_one_value_go() -> None:
    table = np.arange(24.0).reshape(2, 3, 1, 4)
    view = aligned(table, ("B", "A", "one", "me"), ("me", "A", "far", "B"))
    assert view.shape == (4, 3, 1, 2)
    assert view[3, 2, 0, 1] == table[1, 2, 0, 3]
    assert np.shares_memory(view, table)


@looped(("dearest", "width"), [(0, 1), (254, 1), (255, 2), (65534, 2), (65535, 4), (2**32 - 2, 4), (2**32 - 1, 8)])
@looped("piece", [8, 24, 1 << 24])
def test_a_table_comes_as_it_went(
    monkeypatch: pytest.MonkeyPatch, dearest: int, width: Literal[1, 2, 4, 8], piece: int
) -> None:
    """Though its costs take fewer bytes on the way than where it was kept."""
    monkeypatch.setattr(dpop_tables, "PIECE", piece)
    assert width_for(dearest) == width
    costs = np.full((5, 7), 2**64 - 1, "<u8")
    costs[1:4, 2:] = np.arange(15).reshape(3, 5) % (dearest + 1)
    costs[0, 3] = dearest
    arriving = IncomingTable((5, 7), 2**50)
    for told, costs_told in packed_costs(costs):
        assert told == width
        assert len(costs_told) <= piece
        assert not arriving.complete
        arriving.add(told, costs_told)
    assert arriving.complete
    np.testing.assert_array_equal(plain(arriving.costs), plain(costs))


def test_pieces_that_do_not_fit_are_refused_before_any_memory_is_taken() -> None:
    arriving = IncomingTable((1000, 1000), 300)
    for width, piece in ((2, bytes(3)), (1, b""), (1, bytes(1_000_001)), (4, bytes(4)), (2, b"\x2d\x01")):
        with pytest.raises(ValueError, match=r"do not fit|above the announced|not as many"):
            arriving.add(width, piece)  # type: ignore[arg-type]
    with pytest.raises(ValueError, match="no piece of the table has arrived"):
        _ = arriving.costs
    arriving.add(2, bytes(2))
    with pytest.raises(ValueError, match="not as many as the other pieces"):
        arriving.add(1, bytes(1))


@looped("seed", range(8))
def test_arrays_never_hold_more_than_was_told_before(seed: int) -> None:
    """As numpy reports to tracemalloc; a little room for Python's own objects."""
    chance = Random(seed)
    own = chance.choice((2, 5, 10, 300))
    shape = [chance.randint(2, 12) for _ in range(chance.choice((3, 4, 5)))]
    lengths = [[own, *(size if chance.random() < 0.8 else 1 for size in shape)] for _ in range(3)]
    most = chance.choice((50, 10_000))
    width = width_for(3 * most)
    inputs = [Extent(math.prod(length), 8 if number == 0 else width_for(most)) for number, length in enumerate(lengths)]
    told = bytes_of([Result(shape, own, width)], inputs)
    tracemalloc.start()
    try:
        kinds = (np.dtype(np.float64), *[np.dtype(f"<u{width_for(most)}")] * 2)
        tables: list[Table] = [np.full(length, most, kind) for length, kind in zip(lengths, kinds, strict=True)]
        tracemalloc.reset_peak()
        costs, choices = project(shape, [0.0] * own, tables, 3 * most)
        tables.clear()
        pieces = list(packed_costs(costs))
        peak = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    assert choices.shape == costs.shape == tuple(shape)
    assert pieces
    assert peak <= told + 50_000


def large() -> tuple[Team, int]:
    """A team whose last robot has two values, and 130^3 combinations above it; and its least cost."""
    test = Predicate("p", ("X", "Y"), parse("gt(mod(add(mul(X, 7), mul(Y, 3)), 11), 3)", ("X", "Y"), Type.BOOLEAN))
    chance = Random("large")
    names = ("A", "B", "C", "D")
    pairs = {pair: chance.randint(200, 400) for pair in itertools.combinations(names, 2)}
    constraints = [Constraint("C", test, pair, pair, cost=cost) for pair, cost in pairs.items()]
    domains = {name: range(2 if name == "D" else 130) for name in names}
    axes = dict(zip(names, np.ogrid[:130, :130, :130, :2], strict=True))
    total = sum(cost * ((axes[one] * 7 + axes[other] * 3) % 11 <= 3) for (one, other), cost in pairs.items())
    return with_costs(team_of(domains, constraints)), int(np.min(total))


@looped("runtime", ON_ONE_MACHINE)
def test_tables_of_several_mib_travel(runtime: Runtime) -> None:
    team, least = large()
    outcome = solve(team, Options(protocol="dpop", runtime=runtime))
    assert outcome.cost == least
    assert outcome.metrics.bytes > 2 * 130**3


def test_tables_larger_than_a_queue_takes_travel_in_pieces(monkeypatch: pytest.MonkeyPatch) -> None:
    """And the journal of such a run is kept, over a pipe that takes no more either."""
    monkeypatch.setattr(queues, "LARGEST_BODY", 1 << 20)
    monkeypatch.setattr(QueueRobot, "bundle_bytes", 1 << 18)
    monkeypatch.setattr(dpop_tables, "PIECE", 1 << 18)
    team, least = large()
    events: list[AnyEvent] = []
    outcome = solve(team, Options(protocol="dpop"), observer=events.append)
    assert outcome.cost == least
    assert outcome.metrics.messages["UTIL"] == 17 + 2
    told = sum(event.type == "UTIL" for event in events if isinstance(event, Sent))
    assert told == outcome.metrics.messages["UTIL"]
