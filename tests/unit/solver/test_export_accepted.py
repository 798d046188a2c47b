"""What `export` writes is accepted by ACE, with brute force's answer; what ACE cannot read is refused."""

from __future__ import annotations

import re
from pathlib import Path
from random import Random

import pytest

from robochoc.formats import PREDEFINED, write_team
from robochoc.formats.dialects.xcsp3.writer import xcsp3
from robochoc.generators.queens3d import queens3d
from robochoc.model.problem import INFINITE, Constraint, ProblemKind, Relation, Semantics, Team
from robochoc.solver.ace import AceProcess
from robochoc.solver.errors import UnsupportedError
from tests.support.brute_force import least_cost, solutions
from tests.support.complex_problems import complex_team, random_complex_team
from tests.support.cost_problems import random_complex_cost_team, random_cost_team, with_costs
from tests.support.problems import random_team, team_of
from tests.support.program import robochoc_within
from tests.support.xcsp3_ace import ace_said

pytestmark = pytest.mark.usefixtures("shared_solvers")

TWO = {"A": (1, 2), "B": (1, 2)}
NOTHING_FITS = Relation("none", 1, Semantics.SUPPORTS, ((9,),))
ALWAYS = Relation("always", 2, Semantics.SOFT, (), (), 7)
LEAST, MOST = -(2**31) + 10, 2**31 - 11
"""Of what ACE reads."""
WIDEST = 2**31 - 1
"""So far apart may the values of a variable be."""


def special_teams() -> tuple[Team, ...]:
    return (
        team_of(TWO, []),
        team_of({"A": (4,)}, []),
        with_costs(team_of(TWO, [])),
        with_costs(team_of(TWO, [Constraint("C", ALWAYS, ("A", "B"), ("A", "B"))])),
        with_costs(team_of({**TWO, "C": (1, 2)}, [Constraint("C", PREDEFINED["ne"], ("A", "B"), ("A", "B"))])),
        team_of(TWO, [Constraint("C", NOTHING_FITS, ("A",), ("A",))]),
        with_costs(team_of(TWO, [Constraint("C", NOTHING_FITS, ("A",), ("A",))])),
        team_of({"A": (LEAST, 0), "B": (-1, 0, MOST)}, [Constraint("C", PREDEFINED["lt"], ("A", "B"), ("A", "B"))]),
        team_of({"A": (-WIDEST // 2, WIDEST // 2), "B": (MOST,)}, []),
        complex_team({"R": ["A", "B"]}, {**TWO, "B": range(1000)}, []),
        queens3d(3),
    )


def check(teams: list[Team], folder: Path) -> None:
    """ACE finds of every exported team what brute force finds."""
    files = [folder / f"{number}.xml" for number in range(len(teams))]
    with AceProcess() as writer:
        for file, team in zip(files, teams, strict=True):
            file.write_bytes(xcsp3(team, writer))
    said = ace_said(files)
    assert len(said) == len(teams), f"ACE gives up on {teams[len(said)]}: {files[len(said)].read_text()}"
    for team, answer in zip(teams, said, strict=True):
        if team.kind is ProblemKind.DISWCSP:
            least = least_cost(team)
            bound = re.search(r"^d BOUND +(\d+)", answer, re.MULTILINE)
            assert (float(bound[1]) if bound else INFINITE) == least, (team, answer)
            expected = "s UNSATISFIABLE" if least == INFINITE else "s OPTIMUM FOUND"
        else:
            expected = "s SATISFIABLE" if any(solutions(team)) else "s UNSATISFIABLE"
        assert expected in answer.splitlines(), (team, answer)


def drawn(chance: Random) -> Team:
    """Any team, sometimes with a variable that no constraint looks at."""
    make = chance.choice((random_team, random_complex_team, random_cost_team, random_complex_cost_team))
    return make(chance)


@pytest.mark.usefixtures("warm_ace")
@pytest.mark.parametrize("batch", [0, *(pytest.param(batch, marks=pytest.mark.slow) for batch in range(1, 6))])
def test_ace_accepts_what_is_exported(batch: int, tmp_path: Path) -> None:
    chance = Random(f"accepted {batch}")
    check([*special_teams(), *(drawn(chance) for _ in range(100 if batch else 12))], tmp_path)


@pytest.mark.parametrize("values", [(LEAST - 1,), (MOST + 1,), (10**17, 10**17 + 1), (-(10**17), 0), (0, LEAST, MOST)])
def test_integers_that_ace_cannot_read_are_refused(values: tuple[int, ...]) -> None:
    team = team_of({"A": tuple(sorted(values)), "B": (1, 2)}, [])
    with pytest.raises(UnsupportedError, match=r"has a variable A with the value .* ACE supports values from"):
        xcsp3(team)


def test_what_is_refused_is_not_half_written(tmp_path: Path) -> None:
    team = team_of({"A": (10**17,), "B": (1, 2)}, [])
    write_team(team, tmp_path / "far")
    done = robochoc_within("export", tmp_path / "far", "-o", tmp_path / "far.xml")
    assert done.returncode == 2
    (line,) = done.stderr.splitlines()
    assert "ACE supports values from -2,147,483,638 to 2,147,483,637" in line
    assert not (tmp_path / "far.xml").exists()


def test_values_that_a_unary_constraint_forbids_may_be_far() -> None:
    below = Constraint("C", PREDEFINED["lt"], ("A", 10), ("A", 10))
    assert "1" in xcsp3(team_of({"A": (1, 10**17), "B": (1, 2)}, [below])).decode()
