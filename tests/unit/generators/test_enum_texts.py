"""Generators accept the names of members of enums, and refuse other texts with the nearest name."""

from __future__ import annotations

from collections.abc import Callable

import pytest

from robochoc.generators.coloring import coloring
from robochoc.generators.meetings import meetings
from robochoc.generators.queens3d import QueensModel, queens3d
from robochoc.generators.scenario import random_scenario
from robochoc.generators.sensors import sensors


def test_texts_are_members() -> None:
    assert queens3d(3, "full") == queens3d(3, QueensModel.FULL)


def test_unknown_texts_are_refused() -> None:
    wrong: list[tuple[Callable[[], object], str]] = [
        (lambda: queens3d(3, "ful"), r"^model='ful' is not allowed; did you mean 'full'\?$"),
        (lambda: queens3d(3, robots="x"), r"^robots='x' is not allowed; expected cells, rows$"),
        (lambda: coloring(3, 3, 1, conflicts="sof"), r"^conflicts='sof' is not allowed; did you mean 'soft'\?$"),
        (lambda: sensors(3, 1, model="target"), r"^model='target' is not allowed; did you mean 'targets'\?$"),
        (lambda: random_scenario(queens3d(3), 1, 0.1, kinds=["x"]), r"^kinds='x' is not allowed; expected "),
        (lambda: meetings(3, 2, 2, 4, model="x"), r"^model='x' is not allowed; expected "),
    ]
    for job, message in wrong:
        with pytest.raises(ValueError, match=message):
            job()
