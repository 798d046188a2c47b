"""Public names and their parameters change only on purpose."""

from __future__ import annotations

import warnings
from pathlib import Path

import pytest

from robochoc.run import Options, Withdrawal
from robochoc.system.deprecation import deprecated
from tests.support.public_api import STABLE, public_api

SNAPSHOT = Path(__file__).with_name("public_api.txt")


def test_public_names_are_those_of_the_snapshot() -> None:
    found, expected = [*public_api()], SNAPSHOT.read_text(encoding="utf-8").splitlines()
    removed = [line for line in expected if line not in found]
    added = [line for line in found if line not in expected]
    again = "python -m tests.support.public_api > tests/repository/public_api.txt"
    assert found == expected, (
        f"removed {removed}, added {added}; if that is intended (docs/reference/stability.md): {again}"
    )


def test_the_stability_page_names_the_stable_modules() -> None:
    page = (Path(__file__).parents[2] / "docs/reference/stability.md").read_text(encoding="utf-8")
    assert all(f"`{module}`" in page for module in STABLE)


def test_a_deprecated_function_warns_its_caller() -> None:
    @deprecated("new()", removed_in="2.0")
    def old(number: int) -> int:
        """Return the double."""
        return 2 * number

    with pytest.warns(
        DeprecationWarning, match=r"old\(\) is deprecated and will be removed in robochoc 2.0; use new\(\)"
    ) as seen:
        assert old(3) == 6
    assert seen[0].filename == __file__
    assert old.__doc__ == "Return the double."


def test_a_former_value_of_an_option_warns() -> None:
    with pytest.warns(DeprecationWarning, match="withdraw='fewest' is deprecated"):
        assert Options(withdraw="fewest").withdraw is Withdrawal.MINIMUM  # type: ignore[arg-type] # the former name
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert Options(withdraw="minimum").withdraw is Withdrawal.MINIMUM  # type: ignore[arg-type] # as in a notebook
