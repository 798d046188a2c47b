"""Ising models: fields and couplings in their ranges, and the energy that physics says."""

from __future__ import annotations

import itertools
from decimal import Decimal
from fractions import Fraction

from hypothesis import given
from hypothesis import strategies as st

from robochoc.formats import check_team
from robochoc.generators.ising import ising
from robochoc.model.problem import Constraint, Team
from robochoc.run.options import Options, Runtime
from robochoc.run.orchestrator import solve
from tests.support.binary_problems import relation_of, shared_constraints
from tests.support.cases import looped
from tests.support.evaluation import digest
from tests.support.examples import examples


def strength(one: Constraint) -> int:
    """Return a field or a coupling, of which equal spins cost as much as different ones bring."""
    relation = relation_of(one)
    strength = int(relation.cost((0,) * relation.arity))
    for row in itertools.product((0, 1), repeat=relation.arity):
        assert relation.cost(row) == strength * (-1) ** sum(row)
    return strength


def least_energy(team: Team) -> Fraction:
    """Return the least sum of k_ij s_i s_j and k_i s_i over spins of +1 and -1."""
    terms = [(strength(one), one.variables) for one in team.constraints()]
    energies = []
    for row in itertools.product((1, -1), repeat=len(team.variables)):
        spins = dict(zip(team.variables, row, strict=True))
        total = 0
        for k, names in terms:
            product = k
            for name in names:
                product *= spins[name]
            total += product
        energies.append(total)
    return Fraction(min(energies), 10 ** team.robots[0].costs.places)


def test_a_seed_is_one_problem_everywhere() -> None:
    """Fixed for good: who publishes figures names seeds."""
    assert {team.name: digest(team) for team in (ising(3, 4, 1), ising(2, 2, places=9, coupling=1, field=0.5))} == {
        "ising-3x4-1.6-0.05-1": "eb44b50245fd9bef",
        "ising-2x2-1.0-0.5-9-0": "9724fc4eafa43647",
    }


@given(st.integers(2, 5), st.integers(2, 5), st.floats(0, 3), st.integers(0, 4), st.integers(0, 2**32))
@examples(25)
def test_the_torus(rows: int, columns: int, coupling: float, places: int, seed: int) -> None:
    team = ising(rows, columns, seed, coupling=coupling, field=0.1, places=places)
    check_team(team)
    around = (rows if rows > 2 else 1) * columns + (columns if columns > 2 else 1) * rows
    assert len(shared_constraints(team)) == around
    assert sum(len(robot.private) for robot in team.robots) == rows * columns
    most = Decimal(str(coupling)).scaleb(places) + Decimal("0.5")
    assert all(abs(strength(one)) <= most for one in shared_constraints(team))


@looped("seed", range(3))
def test_the_least_energy_of_a_small_torus(seed: int) -> None:
    team = ising(3, 3, seed)
    wanted = least_energy(team)
    for protocol in ("dpop", "central"):
        outcome = solve(team, Options(protocol=protocol, runtime=Runtime.SIMULATOR))
        assert outcome.cost is not None
        assert Fraction(outcome.cost) == wanted < 0


def test_couplings_are_uniform_in_their_range() -> None:
    found = [strength(one) for seed in range(10) for one in shared_constraints(ising(8, 8, seed, places=1))]
    assert (min(found), max(found)) == (-16, 16)
    assert len(set(found)) == 33
    assert abs(sum(found)) < 4 * 9.5 * len(found) ** 0.5  # four standard deviations
