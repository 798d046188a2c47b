"""The random numbers of robots: the same everywhere, uniform, and independent between robots of similar names."""

from __future__ import annotations

import itertools
import math
import sys
from random import Random

import numpy as np

from robochoc.protocols.chance import Chance, key_and_step
from tests.support.examples import count

BITS = 53
LIMIT = 5.0
"""Statistics are standard normal; the seeds are fixed, so a test that holds once holds for ever."""


KNOWN = ["0x1.c05562a977e66p-2", "0x1.56d872143f184p-2", "0x1.40af92ad85ea0p-3"]


def drawn(seed: int, name: str, many: int) -> list[float]:
    chance = Chance(seed, name)
    return [chance() for _ in range(many)]


def test_a_stream_is_known() -> None:
    """A change of these numbers changes every run of the protocols that draw."""
    assert [number.hex() for number in drawn(0, "drone1.1", 3)] == KNOWN


def test_a_stream_depends_on_seed_and_name_only() -> None:
    assert drawn(7, "A", 20) == drawn(7, "A", 20)
    one, other = Chance(7, "A"), Chance(7, "B")
    mixed = [(one(), other()) for _ in range(20)]
    assert mixed == list(zip(drawn(7, "A", 20), drawn(7, "B", 20), strict=True))
    assert len({tuple(drawn(seed, name, 4)) for seed in range(30) for name in ("A", "B", "A ", "1", "11")}) == 150


def test_steps_are_odd_and_have_many_transitions() -> None:
    for seed, robot in itertools.product((0, -1, 2**70), range(2000)):
        key, step = key_and_step(seed, f"R{robot}")
        assert 0 <= key < 2**64
        assert 0 <= step < 2**64
        assert step % 2
        assert (step ^ step >> 1).bit_count() >= 24


@count("many", 20_000, 1_000_000)
def test_one_stream_and_the_first_numbers_of_many_robots_are_uniform(many: int) -> None:
    """All robots draw their first values at once; their names differ in a digit."""
    assert_uniform(np.array(drawn(1, "A", many)))
    assert_uniform(np.array([Chance(0, f"R{robot}")() for robot in range(many)]))


def assert_uniform(numbers: np.ndarray[tuple[int], np.dtype[np.float64]]) -> None:
    many = len(numbers)
    assert numbers.min() >= 0
    assert numbers.max() < 1
    whole = (numbers * 2**BITS).astype(np.int64)
    assert (whole / 2**BITS == numbers).all()
    assert abs(numbers.mean() - 0.5) * math.sqrt(12 * many) < LIMIT
    for bit in range(BITS):
        ones = (whole >> bit & 1).sum()
        assert abs(2 * ones - many) / math.sqrt(many) < LIMIT, f"bit {bit}"
    for cells in (3, 7, 64, 256):
        expected = many / cells
        chi = (((np.bincount((numbers * cells).astype(int), minlength=cells) - expected) ** 2) / expected).sum()
        assert abs(chi - (cells - 1)) / math.sqrt(2 * (cells - 1)) < LIMIT, f"{cells} cells"
    ordered = np.sort(numbers)
    distance = np.abs(ordered - np.arange(many) / many).max()
    assert distance * math.sqrt(many) < 2, "Kolmogorov and Smirnov"


@count("many", 20_000, 500_000)
def test_streams_of_similar_names_and_draws_in_turn_are_not_correlated(many: int) -> None:
    own = np.array(drawn(0, "drone1.1", many))
    others = [drawn(0, "drone1.2", many), drawn(0, "drone11.1", many), drawn(1, "drone1.1", many)]
    pairs = [(own, np.array(other)) for other in others]
    pairs += [(own[:-lag], own[lag:]) for lag in (1, 2, 3, 8)]
    for one, other in pairs:
        length = len(one)
        assert abs(((one - 0.5) * (other - 0.5)).mean()) * 12 * math.sqrt(length) < LIMIT
        square = np.bincount((one * 8).astype(int) * 8 + (other * 8).astype(int), minlength=64)
        chi = ((square - length / 64) ** 2 / (length / 64)).sum()
        assert abs(chi - 63) / math.sqrt(2 * 63) < LIMIT


def test_choices_by_different_draws_of_all_robots_are_independent() -> None:
    """As DSA draws: whether to move, then where to."""
    streams = [Chance(5, str(robot)) for robot in range(4000)]
    moves = np.array([stream() < 0.7 for stream in streams])
    places = np.array([int(stream() * 4) for stream in streams])
    share = np.bincount(places[moves], minlength=4) / moves.sum()
    assert np.abs(share - 0.25).max() * math.sqrt(moves.sum() / 0.1875) < LIMIT


def test_a_generator_is_small() -> None:
    """A word for the state and one for the step, against 2.5 kB of `random.Random`."""
    one = Chance(0, "A")
    assert not hasattr(one, "__dict__")
    assert sys.getsizeof(one) + 2 * sys.getsizeof(2**64) < sys.getsizeof(Random(0)) / 10
