"""The examples in protocols' docstrings, where the protocol's own tests do not run them."""

from __future__ import annotations

import doctest
from importlib import import_module

import pytest

from robochoc.system.compiled_core import docstring


@pytest.mark.parametrize("name", ["aas", "abt_do", "abt_hyb", "afc", "awc", "dynabt", "first_fit", "sbt"])
def test_the_example_shows_what_happens(name: str) -> None:
    module = import_module(f"robochoc.protocols.satisfaction.{name}")
    example = doctest.DocTestParser().get_doctest(docstring(module), {**vars(module)}, name, module.__file__, 0)
    done = doctest.DocTestRunner().run(example)
    assert done.attempted
    assert done.failed == 0
