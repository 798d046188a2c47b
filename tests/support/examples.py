"""How many random examples there are, and which Hypothesis draws.

`make test` draws the same ones each time (profile `same`), `make test-more` as many new ones (`fresh`), and
`make test-slow` ten times as many new ones (`new`). The last two print the seed that repeats them.

Tests that draw with `random.Random` use `drawn`: their problems follow the same seed. Those marked `fresh` are run in
`make test`, and again in `make test-more`.
"""

from __future__ import annotations

from random import Random

import pytest
from hypothesis import HealthCheck, settings

SAME, FRESH, NEW = "same", "fresh", "new"
_BUSY = (HealthCheck.too_slow,)  # how long an example takes says something of the machine alone


def register_profiles() -> None:
    """Register the profiles for `--hypothesis-profile`; load `same`."""
    settings.register_profile(
        SAME, deadline=None, derandomize=True, database=None, max_examples=50, suppress_health_check=_BUSY
    )
    settings.register_profile(FRESH, deadline=None, print_blob=True, max_examples=50, suppress_health_check=_BUSY)
    settings.register_profile(NEW, deadline=None, print_blob=True, max_examples=500, suppress_health_check=_BUSY)
    settings.load_profile(SAME)


def examples(fast: int, slow: int = 0, also_suppress: tuple[HealthCheck, ...] = ()) -> settings:
    """Return a decorator: draw `fast` examples, or `slow` (ten times as many) in `make test-slow`."""
    count = (slow or 10 * fast) if settings.get_current_profile_name() == NEW else fast
    return settings(max_examples=count, suppress_health_check=(*_BUSY, *also_suppress))


def count(name: str, fast: int, slow: int) -> pytest.MarkDecorator:
    """Return a decorator: the parameter `name` is `fast` in `make test`, and `slow` in `make test-slow`."""
    return pytest.mark.parametrize(name, [fast, pytest.param(slow, marks=pytest.mark.slow)])


_seed = ""


def use_seed(seed: str | None) -> None:
    """Let `drawn` draw other problems for each seed; None: the same ones each time."""
    global _seed  # noqa: PLW0603 - one seed for all tests of a process
    _seed = seed or ""


def drawn(name: str) -> Random:
    """Return a generator for the random problem of this name: it depends on the name and on the seed of all tests."""
    return Random(f"{name} {_seed}" if _seed else name)


def are_the_same() -> bool:
    """Return whether all problems are the same each time: their proportions can be asserted then, without any luck."""
    return not _seed
