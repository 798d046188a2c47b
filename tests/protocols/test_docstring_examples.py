"""The examples in protocols' docstrings, where the protocol's own tests do not run them."""

from __future__ import annotations

import doctest
from importlib import import_module

import pytest


@pytest.mark.parametrize("name", ["abt_do", "afc", "awc", "dynabt", "first_fit", "sbt"])
def test_the_example_shows_what_happens(name: str) -> None:
    done = doctest.testmod(import_module(f"robochoc.protocols.{name}"))
    assert done.attempted
    assert done.failed == 0
