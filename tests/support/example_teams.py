"""Teams in docs/examples, read once for all tests of a process that need them."""

from __future__ import annotations

from functools import cache

from robochoc.formats import read_team
from robochoc.model.problem import Team
from tests.support.program import ROOT


@cache
def example(name: str) -> Team:
    return read_team(ROOT / "docs" / "examples" / name)


def hangar() -> Team:
    return example("hangar")
