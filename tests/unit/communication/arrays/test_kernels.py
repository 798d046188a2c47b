"""The compiled functions compute the same runs as numpy: values and clocks in every cycle, costs, counts."""

from __future__ import annotations

import ctypes
from collections.abc import Sequence
from random import Random
from typing import Any

import numpy as np
import pytest

from robochoc.communication.arrays import compiled, kernels
from robochoc.communication.arrays.array_runs import array_run_for
from robochoc.communication.arrays.cycle_run import cycles_of
from robochoc.communication.arrays.description import Description, KnownConstraints
from robochoc.communication.arrays.layout import ArrayLayout
from robochoc.protocols.settings import read_settings
from robochoc.run.registry import protocol_named
from tests.support.array_teams import PROTOCOLS, random_settings
from tests.support.examples import count
from tests.support.program import ROOT

SIZES = (1, 2, 3, 4, 5, 8, 9, 12, 14, 130, 300)
COSTS = ((0, 1), (0, 0, 1, 2, 70_000), (0, 1, 2**40), (0, 3, np.inf), (0, 5, 2**33 - 1, np.inf))


@pytest.fixture(scope="module")
def functions(tmp_path_factory: pytest.TempPathFactory) -> ctypes.CDLL:
    """The functions of the installed wheel, or compiled as for a wheel."""
    installed = compiled.compiled_functions()
    if installed is not None:
        return installed
    from hatch_build import kernels_library, may_compile  # noqa: PLC0415 - it is beside the sources, not in a wheel

    if not may_compile():
        pytest.skip("no C compiler, or no headers of Python")
    return ctypes.CDLL(str(kernels_library(ROOT, tmp_path_factory.mktemp("kernels"))))


def random_description(chance: Random) -> Description:
    """Return a team with domains of several sizes, and with constraints over one to three robots."""
    many = chance.randint(1, 14)
    kinds = chance.sample(SIZES, chance.randint(1, 3))
    sizes = [chance.choice(kinds) for _ in range(many)]
    costs = chance.choice(COSTS)
    shapes: dict[tuple[int, ...], list[tuple[int, Sequence[int], bytes, int]]] = {}
    neighbours: list[set[int]] = [set() for _ in range(many)]
    numbers = [0] * many
    for _ in range(chance.randint(0, 3 * many)):
        scope = sorted(chance.sample(range(many), min(many, chance.choice((1, 2, 2, 2, 2, 3)))))
        if np.prod([sizes[robot] for robot in scope]) > 10_000:
            continue
        shape = [sizes[robot] for robot in scope]
        word = chance.choice((0, 0, chance.random()))
        table = np.array(Random(word).choices(costs, k=int(np.prod(shape))), np.float64).reshape(shape)
        for place, owner in enumerate(scope):
            others = scope[:place] + scope[place + 1 :]
            turned = np.ascontiguousarray(np.moveaxis(table, place, -1))
            shapes.setdefault(turned.shape, []).append((owner, others, turned.tobytes(), numbers[owner]))
            neighbours[owner].update(others)
            numbers[owner] += 1
    charged = np.array(chance.choices(costs, k=sum(sizes)), np.float64) if chance.random() < 0.4 else None
    return Description(
        names=[f"R{robot}" for robot in range(many)],
        sizes=np.array(sizes),
        degrees=np.array([len(found) for found in neighbours]),
        neighbours=np.array([one for found in neighbours for one in sorted(found)], np.int64),
        charges=charged,
        held=[_known(shape, entries) for shape, entries in shapes.items()],
        value_bytes=np.array([chance.randint(5, 9) for _ in range(sum(sizes))]),
        domain_bytes=7,
    )


def _known(shape: tuple[int, ...], entries: list[tuple[int, Sequence[int], bytes, int]]) -> KnownConstraints:
    tables = list(dict.fromkeys(table for _, _, table, _ in entries))
    return KnownConstraints(
        np.array([owner for owner, *_ in entries]),
        np.array([others for _, others, _, _ in entries], np.int64).reshape(len(entries), len(shape) - 1),
        np.stack([np.frombuffer(table).reshape(shape) for table in tables]),
        np.array([tables.index(table) for _, _, table, _ in entries]),
        np.array([number for *_, number in entries]),
    )


def use(monkeypatch: pytest.MonkeyPatch, library: ctypes.CDLL | None) -> None:
    """Use the functions of `library`; None: numpy."""
    monkeypatch.setattr(compiled, "compiled_functions", lambda: library)


def trace(layout: ArrayLayout, protocol: str, settings: dict[str, str], seed: int, *, clocks: bool) -> list[Any]:
    """Return all results of a run."""
    kind = protocol_named(protocol)
    run = array_run_for(kind)(layout, read_settings(kind, settings), seed, clocks=clocks, changes=True)  # type: ignore[arg-type]
    found: list[Any] = [
        (one.values.tolist(), None if one.clocks is None else one.clocks.tolist()) for one in cycles_of(run)
    ]
    changes = [(change.rows.tolist(), change.values.tolist()) for change in run.changes or ()]
    return [*found, changes, run.costs, run.best.tolist(), run.verdict, run.metrics(0)]


@pytest.mark.parametrize("protocol", PROTOCOLS)
@count("many", 60, 3000)
def test_compiled_functions_compute_the_same_runs(
    monkeypatch: pytest.MonkeyPatch, functions: ctypes.CDLL, protocol: str, many: int
) -> None:
    """Rows are shared by one to three threads."""
    monkeypatch.setattr(kernels, "ROWS_PER_THREAD", 1)
    for seed in range(many):
        chance = Random(f"{protocol} {seed}")
        description = random_description(chance)
        settings, clocks = random_settings(protocol, chance), chance.random() < 0.8
        runs = []
        for library, threads in ((None, 1), (functions, chance.randint(1, 3))):
            use(monkeypatch, library)
            monkeypatch.setattr(kernels, "usable_processors", lambda threads=threads: threads)
            runs.append(trace(ArrayLayout(description), protocol, settings, seed, clocks=clocks))
        assert runs[0] == runs[1], seed


def test_random_numbers_and_orders_are_the_same(monkeypatch: pytest.MonkeyPatch, functions: ctypes.CDLL) -> None:
    for seed in range(100):
        chance = Random(seed)
        names = [
            "".join(chance.choices("aZ0 é\U0001f600", k=chance.randint(0, 60))) for _ in range(chance.randint(0, 9))
        ]
        names += ["long" * 40] * (chance.random() < 0.1) + ["\0"] * (chance.random() < 0.1)
        numbers = np.array(
            [chance.randrange(2 ** chance.randint(0, 62)) for _ in range(chance.randint(0, 50))], np.int64
        )
        found = []
        for library in (None, functions):
            use(monkeypatch, library)
            keys = compiled.keys_and_steps(2**seed, names, len(names))
            found.append([[part.tolist() for part in keys], compiled.sort_order(numbers % 1000).tolist()])
            found[-1].append(compiled.sort_order(numbers).tolist())
        assert found[0] == found[1], seed


def test_the_functions_are_loaded_from_the_package(monkeypatch: pytest.MonkeyPatch) -> None:
    compiled.compiled_functions.cache_clear()
    monkeypatch.setenv("ROBOCHOC_PURE", "1")
    assert compiled.compiled_functions() is None
    compiled.compiled_functions.cache_clear()
