"""The garbage collector is put off, and left as it was found."""

import gc
import weakref
from collections.abc import Iterator

import pytest

from robochoc.system.garbage import (
    BLOCKS_BEFORE_COLLECTION,
    RARE_THRESHOLD,
    collection_paused,
    collection_seldom,
    garbage_frozen,
)


class Looped:
    """An object that refers to itself: only the collector finds it."""

    def __init__(self) -> None:
        self.itself = self


@pytest.fixture(autouse=True)
def as_found() -> Iterator[None]:
    """Leave the collector as it was."""
    thresholds, enabled = gc.get_threshold(), gc.isenabled()
    yield
    gc.set_threshold(*thresholds)
    (gc.enable if enabled else gc.disable)()


def test_what_was_made_meanwhile_is_not_young_afterwards() -> None:
    gc.enable()
    with collection_paused():
        made = [Looped() for _ in range(1000)]
        assert not gc.isenabled()
    assert gc.isenabled()
    young = {id(one) for one in gc.get_objects(generation=0)}
    assert not young & {id(one) for one in made}
    assert not gc.get_freeze_count()


def test_cyclic_garbage_of_many_blocks_is_freed() -> None:
    """A program that solves for days must not grow."""
    gc.enable()
    freed: list[int] = []
    most = 0
    for number in range(10 * BLOCKS_BEFORE_COLLECTION):
        with collection_paused():
            made = [Looped() for _ in range(1000)]
            weakref.finalize(made[0], freed.append, number)
            del made
        most = max(most, number + 1 - len(freed))
    assert most < 5 * BLOCKS_BEFORE_COLLECTION


def test_frozen_objects_stay_frozen() -> None:
    gc.enable()
    gc.freeze()
    try:
        with collection_paused():
            pass
        assert gc.get_freeze_count()
    finally:
        gc.unfreeze()


def test_frozen_objects_are_not_counted_while_a_search_goes_on(monkeypatch: pytest.MonkeyPatch) -> None:
    """To count them is to visit each: it would be done for every improvement of a search."""
    gc.enable()
    monkeypatch.setattr("robochoc.system.garbage.gc.get_freeze_count", lambda: pytest.fail("counted"))
    made = Looped()
    with garbage_frozen():
        with collection_paused():
            pass
        assert not any(each is made for each in gc.get_objects()), "still frozen"
    assert any(each is made for each in gc.get_objects())


def test_where_it_is_off_it_stays_off() -> None:
    gc.disable()
    with collection_paused(), collection_paused():
        pass
    assert not gc.isenabled()


@pytest.mark.parametrize(
    ("before", "meanwhile"),
    [(700, RARE_THRESHOLD), (RARE_THRESHOLD + 1, RARE_THRESHOLD + 1), (0, 0)],
    ids=["usual", "rarer", "never"],
)
def test_looks_are_seldom_and_then_as_before(before: int, meanwhile: int) -> None:
    gc.set_threshold(before, 10, 10)
    with collection_seldom():
        assert gc.get_threshold() == (meanwhile, 10, 10)
    assert gc.get_threshold() == (before, 10, 10)


def test_searches_in_threads_restore_the_thresholds() -> None:
    """The first search ends before the second one."""
    gc.set_threshold(700, 10, 10)
    first, second = collection_seldom(), collection_seldom()
    first.__enter__()
    second.__enter__()
    first.__exit__(None, None, None)
    assert gc.get_threshold() == (RARE_THRESHOLD, 10, 10)
    second.__exit__(None, None, None)
    assert gc.get_threshold() == (700, 10, 10)
