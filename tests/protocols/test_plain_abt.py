"""The counts of `abt` are those of an ABT that was written apart from it: messages and NCCCs (`plain_abt.py`)."""

from __future__ import annotations

from statistics import geometric_mean

import pytest

from robochoc.communication.simulator.schedule import Concurrent
from robochoc.communication.simulator.simulator import Simulation
from robochoc.generators.random_csp import random_csp
from robochoc.model.outcome import Verdict
from robochoc.model.problem import Relation, Team
from robochoc.protocols.satisfaction.abt import ABT
from tests.support.plain_abt import Conflicts, search

WITHIN = 0.02
"""The mean ratio may differ from 1 by so much. Which of two agents that are ready is first differs, and so do runs: a
single one by up to a fifth, so that in a sum the largest problem would drown all others."""


def conflicts(team: Team) -> Conflicts:
    """The team's problem in the other's terms; robots and values are counted from 1."""
    found = {}
    for constraint in team.constraints():
        assert isinstance(constraint.definition, Relation)
        higher, lower = (int(variable.removeprefix("V")) - 1 for variable in constraint.variables)
        found[higher, lower] = frozenset((first - 1, second - 1) for first, second in constraint.definition.tuples)
    return found


@pytest.mark.parametrize(
    ("agents", "values", "density", "tightness", "problems"),
    [
        (10, 6, 0.4, 0.5, 20),
        pytest.param(20, 10, 0.2, 0.65, 100, marks=pytest.mark.slow),
        pytest.param(20, 10, 0.2, 0.7, 100, marks=pytest.mark.slow),
        pytest.param(15, 10, 0.4, 0.55, 100, marks=pytest.mark.slow),
    ],
)
def test_messages_and_ncccs_are_those_of_another_abt(
    agents: int, values: int, density: float, tightness: float, problems: int
) -> None:
    messages: list[float] = []
    ncccs: list[float] = []
    for seed in range(problems):
        team = random_csp(agents, values, density, tightness, seed, connected=True)
        ours = Simulation(team, ABT, Concurrent(seed)).search()
        theirs = search(agents, values, conflicts(team), seed)
        assert ours.verdict is (Verdict.SOLUTION if theirs.solvable else Verdict.NO_SOLUTION)
        messages.append(sum(ours.metrics.messages.values()) / theirs.messages)
        ncccs.append(ours.metrics.ncccs / theirs.ncccs)
    assert geometric_mean(messages) == pytest.approx(1, abs=WITHIN)
    assert geometric_mean(ncccs) == pytest.approx(1, abs=WITHIN)
