"""PC-SyncBB: shares, comparisons, the optimum, and the view of a minority."""

from __future__ import annotations

import itertools
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import replace
from random import Random

import pytest

from robochoc.model.outcome import Verdict
from robochoc.model.problem import INFINITE, Team
from robochoc.protocols.private.pc_syncbb import Search
from robochoc.protocols.private.shamir import FIELD_BITS, Field, field_of
from robochoc.protocols.private.shared_comparison import Comparison, products_per_comparison
from robochoc.run import Options, Runtime, solve
from robochoc.solver.errors import UnsupportedError
from tests.support.cost_problems import random_cost_team, with_costs
from tests.support.encrypted_problems import affordable
from tests.support.examples import count, drawn
from tests.support.loose_problems import minimum_cost
from tests.support.private_problems import priced
from tests.support.problems import random_team, team_of

FAST = {"bits": "31"}


def secret_of(chance: Random) -> Callable[[int], int]:
    return chance.getrandbits


def constant(number: int) -> Callable[[int], int]:
    return lambda _: number


# Shares


@pytest.mark.parametrize("bits", FIELD_BITS)
def test_one_share_more_than_the_degree_gives_the_secret(bits: int) -> None:
    chance, field = Random(bits), Field(bits)
    for robots in range(1, 8):
        for degree in range(robots):
            secrets = field.draw(5, secret_of(chance))
            shares = field.share(secrets, degree, robots, secret_of(chance))
            assert field.combine(shares[: degree + 1]) == field.combine(shares) == secrets


def test_fewer_shares_look_the_same_for_every_secret() -> None:
    """All polynomials over a small field, counted: two shares of three have the same distribution for every secret."""
    field, size = Field(5), 31
    seen = []
    for secret in (0, 1, 17):
        shares = Counter[tuple[int, ...]]()
        for first, second in itertools.product(range(size), repeat=2):
            one = field.share([secret], 2, 5, constant(first | second << 5))
            shares[one[1][0], one[4][0]] += 1
        seen.append(shares)
    assert seen[0] == seen[1] == seen[2]
    assert {*seen[0].values()} == {1}


def test_a_multiplication_looks_the_same_for_all_factors() -> None:
    """The first of three robots sees its own shares and all masked products: equally often with any factors."""
    field, prime = Field(3), 7
    seen = []
    for one, two in ((0, 0), (3, 5)):
        views = Counter[tuple[int, ...]]()
        for slope, other, mask, low, high, square in itertools.product(range(prime), repeat=6):
            shares = [((one + slope * place) * (two + other * place)) for place in (1, 2, 3)]
            masked = [share + mask + high * place + square * place**2 for place, share in enumerate(shares, 1)]
            views[
                (one + slope) % prime, (two + other) % prime, (mask + low) % prime, *(each % prime for each in masked)
            ] += 1
        seen.append(views)
        assert field.combine([[(one + slope) % prime], [(one + 2 * slope) % prime]]) == [one]
    assert seen[0] == seen[1]


def test_shares_that_are_not_elements_are_refused() -> None:
    field = field_of(31)
    with pytest.raises(ValueError, match="expected 8"):
        field.unpack(b"1234", 2)
    with pytest.raises(ValueError, match="not an element"):
        field.unpack(field.prime.to_bytes(4, "little"), 1)
    with pytest.raises(ValueError, match=r"2\^6 - 1"):
        Field(6)


# Comparisons


@pytest.mark.parametrize("bits", [5, 7])
def test_comparisons_are_right_for_all_numbers_and_masks(bits: int) -> None:
    field = Field(bits)
    masks = [*itertools.product((0, 1), repeat=bits)]
    for number in range(field.prime):
        comparison = Comparison(field, [number] * len(masks), masks)
        comparison.begin(comparison.masked)
        products = 0
        while comparison.products:
            products += len(comparison.products)
            comparison.advance(comparison.products)
        assert comparison.results == [number < field.prime / 2] * len(masks)
        assert products == products_per_comparison(bits) * len(masks)


def test_the_opened_number_can_be_any_for_every_secret_and_is_almost_uniform() -> None:
    field = Field(5)
    masks = [*itertools.product((0, 1), repeat=5)]
    for number in range(field.prime):
        opened = Counter(Comparison(field, [number] * len(masks), masks).masked)
        assert len(opened) == field.prime
        assert sorted(opened.values()) == [1] * (field.prime - 1) + [2]


# The optimum


def options_of(**settings: str) -> Options:
    return Options(protocol="pc-syncbb", runtime=Runtime.SIMULATOR, cache=False, settings={**FAST, **settings})


def small_teams(number: int) -> Iterator[tuple[int, Team]]:
    for one in range(number):
        chance = drawn(f"pc-syncbb {one}")
        make = random_cost_team if one % 2 else random_team
        yield one, affordable("pc-syncbb", lambda: make(chance), 300)  # noqa: B023 - called at once


@count("number", fast=12, slow=400)
def test_both_searches_find_the_optimum_of_brute_force(number: int) -> None:
    for one, team in small_teams(number):
        least = minimum_cost(team)
        search = [*Search][one % 3 == 0]
        outcome = solve(team, replace(options_of(search=search), seed=one))
        assert (INFINITE if outcome.cost is None else outcome.cost) == least


TRIANGLE = with_costs(
    team_of(
        {"A": (1, 2), "B": (1, 2), "C": (1, 2)},
        [priced(one, two, {(1, 1): 3, (1, 2): 1, (2, 1): 2, (2, 2): 5}) for one, two in ("AB", "BC", "AC")],
    )
)


@pytest.mark.more
@pytest.mark.parametrize("search", Search)
def test_processes_find_it_too(search: Search) -> None:
    outcome = solve(TRIANGLE, replace(options_of(search=search), runtime=Runtime.PROCESSES))
    assert outcome.verdict == Verdict.OPTIMAL
    assert outcome.cost == minimum_cost(TRIANGLE)


# Limits


def test_a_hidden_search_that_is_too_large_is_refused_before_it_begins() -> None:
    with pytest.raises(UnsupportedError, match=r"needs 8 comparisons.*--set comparisons=N"):
        solve(TRIANGLE, options_of(search="hidden", comparisons="7"))


def test_an_open_search_ends_at_the_limit() -> None:
    with pytest.raises(UnsupportedError, match="needs 2 comparisons or more"):
        solve(TRIANGLE, options_of(comparisons="1"))


def test_costs_too_large_for_the_field_are_refused() -> None:
    far = with_costs(team_of({"A": (1,), "B": (1,), "C": (1,)}, [priced("A", "B", {(1, 1): 2**20})]))
    with pytest.raises(UnsupportedError, match=r"too much for a field of 31 bits.*--set bits=N"):
        solve(far, options_of())
    assert solve(far, options_of(bits="61")).cost == 2**20
