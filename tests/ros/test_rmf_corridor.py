"""docs/examples/corridor: two patrols swap places through one corridor without a deadlock, in every order of moves."""

from __future__ import annotations

import importlib.util
import itertools
import sys
from functools import cache
from random import Random
from types import ModuleType

import pytest

from tests.support.program import ROOT

PATH = ROOT / "docs" / "examples" / "corridor" / "corridor.py"


@pytest.fixture(scope="module")
def corridor() -> ModuleType:
    spec = importlib.util.spec_from_file_location("corridor", PATH)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.mark.parametrize("robots", [2, 3, 4])
def test_no_order_of_moves_ends_in_a_deadlock(corridor: ModuleType, robots: int) -> None:
    """All of them end in the other halls after as many moves as the ways have cells; so swaps can go on for ever."""
    for start in itertools.product(corridor.HALLS, repeat=robots):
        goals = corridor.opposite(start)
        for turns in itertools.permutations(range(1, robots + 1)):
            found = corridor.reachable(start, turns)
            assert [positions for positions, following in found.items() if not following] == [goals]
            assert all(corridor.in_corridor(positions) <= 1 for positions in found)


def test_without_different_turns_there_are_deadlocks_or_collisions(corridor: ModuleType) -> None:
    """If both may enter at any time, they meet in the corridor: the constraint is what prevents it."""
    found = corridor.reachable(corridor.HALLS, (1, 1))
    assert any(corridor.in_corridor(positions) == 2 for positions in found)


def test_robots_decide_on_different_turns_and_the_nearer_one_is_first(corridor: ModuleType) -> None:
    for distances in itertools.product(range(3), repeat=2):
        turns = corridor.decide(distances)
        assert sorted(turns) == [1, 2]
        if distances[0] != distances[1]:
            assert (turns[0] == 1) == (distances[0] < distances[1])
    assert corridor.decide((5, 1, 3)) == (3, 1, 2)


def swapped(corridor: ModuleType, swaps: int, *, cached: bool) -> None:
    decide = cache(corridor.decide) if cached else corridor.decide
    chance = Random(7)
    positions = corridor.HALLS
    for number in range(swaps):
        positions = corridor.swap(positions, decide(tuple(chance.randrange(10) for _ in positions)), chance)
        assert positions == (corridor.HALLS if number % 2 else corridor.opposite(corridor.HALLS))


def test_ten_thousand_swaps(corridor: ModuleType) -> None:
    swapped(corridor, 10_000, cached=True)


@pytest.mark.slow
def test_ten_thousand_swaps_each_with_a_decision_of_its_own(corridor: ModuleType) -> None:
    swapped(corridor, 10_000, cached=False)


def test_the_program(capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys, "argv", ["corridor.py", "100"])
    with pytest.MonkeyPatch.context():
        import runpy  # noqa: PLC0415 - only here

        runpy.run_path(str(PATH), run_name="__main__")
    assert capsys.readouterr().out.startswith("100 swaps, robot0 first in ")
