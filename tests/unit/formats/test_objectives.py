"""Several objectives in files and in models: files are read as they were written, and errors are reported."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

import robochoc
from robochoc.formats import InvalidInputError, read_robot, read_team, write_team
from robochoc.model.costs import SeveralObjectivesError, normalized
from robochoc.model.problem import Team
from robochoc.modelling.errors import ModelError

FILE = """\
<instance>
  <presentation type="{kind}" {presentation}/>
  <domains><domain name="D">1..3</domain></domains>
  <variables><variable name="A" domain="D"/></variables>
  <functions>
    <function name="far"><parameters>int X</parameters><expression><functional>sub(3, X)</functional></expression>
    </function>
  </functions>
  <constraints>
    <constraint name="C" reference="{reference}" scope="{scope}" {attributes}/>
  </constraints>
  <agents_neighbours><agents_parent/><agents_children/></agents_neighbours>
</instance>
"""


def mistakes(tmp_path: Path, **parts: str) -> list[str]:
    given = {"kind": "DisWCSP", "presentation": "", "reference": "far", "scope": "A", "attributes": ""} | parts
    (tmp_path / "R.xml").write_text(FILE.format(**given))
    with pytest.raises(InvalidInputError) as invalid:
        read_robot(tmp_path / "R.xml")
    return [f"{one.line}: {one.message} ({one.hint})" for one in invalid.value.diagnostics]


BOTH = 'objectives="energy risk"'


@pytest.mark.parametrize(
    ("parts", "expected"),
    [
        ({"presentation": BOTH}, '10: the costs of the constraint belong to no objective (write objective="energy"'),
        ({"presentation": BOTH, "attributes": 'objective="rsk"'}, "10: unknown objective 'rsk' (did you mean 'risk'?)"),
        ({"attributes": 'objective="risk"'}, "10: the objective 'risk' is not listed in the presentation"),
        (
            {"presentation": BOTH, "reference": "lt", "scope": "A 2", "attributes": 'objective="risk"'},
            "10: a hard constraint cannot have an objective",
        ),
        ({"presentation": 'objectives="energy"'}, "2: 1 objective is listed (list 2 or 3"),
        ({"presentation": 'objectives="a b c d"'}, "2: 4 objectives are listed (list 2 or 3"),
        ({"presentation": 'objectives="a b a"'}, "2: the objective 'a' is listed twice"),
        ({"presentation": 'objectives="a 1,"'}, "2: '1,' cannot be the name of an objective"),
        ({"presentation": BOTH + ' constant="3"'}, "2: the constant of the costs belongs to no objective"),
        ({"presentation": BOTH, "kind": "DisCSP"}, "2: a DisCSP cannot have objectives"),
    ],
)
def test_mistakes_are_named_with_their_line(tmp_path: Path, parts: dict[str, str], expected: str) -> None:
    assert any(one.startswith(expected) for one in mistakes(tmp_path, **parts))


def drones() -> robochoc.Model:
    model = robochoc.Model("drones")
    one, two = (model.robot(f"drone{number}").variable("height", range(3)) for number in (1, 2))
    model.minimize(one + 2 * two, objective="energy")
    model.minimize(abs(one - two) * 3, objective="risk")
    model.add(one != 0, cost=4, objective="risk")
    model.add(one + two >= 1)
    return model


def objectives_of(team: Team) -> list[str]:
    return sorted(constraint.objective for constraint in team.constraints())


def test_a_model_has_the_objectives_that_its_costs_name() -> None:
    team = drones().team
    assert team.objectives == ("energy", "risk")
    assert objectives_of(team) == ["", "energy", "energy", "risk", "risk"]


def test_files_keep_the_objectives(tmp_path: Path) -> None:
    drones().save(tmp_path / "drones")
    team = read_team(tmp_path / "drones")
    assert team.objectives == ("energy", "risk")
    assert objectives_of(team) == objectives_of(drones().team)
    write_team(team, tmp_path / "again")
    assert read_team(tmp_path / "again").robots == team.robots
    assert objectives_of(robochoc.Model.of(team).team) == objectives_of(team)


def test_robots_of_a_team_have_the_same_objectives(tmp_path: Path) -> None:
    drones().save(tmp_path / "drones")
    file = tmp_path / "drones" / "drone2.xml"
    file.write_text(file.read_text().replace('objectives="energy risk"', 'objectives="risk energy"'))
    with pytest.raises(InvalidInputError) as invalid:
        read_team(tmp_path / "drones")
    assert "the robot has the objectives risk energy, but 'drone1' has the objectives energy risk" in str(invalid.value)


def test_a_model_with_objectives_has_no_other_costs() -> None:
    model = drones()
    model.minimize(model["drone1.height"])
    with pytest.raises(ModelError, match="belong to no objective"):
        _ = model.team
    model = drones()
    with pytest.raises(ModelError, match="has a constant"):
        model.minimize(model["drone1.height"] + 1, objective="energy")


@pytest.mark.parametrize(
    ("given", "cost", "message"),
    [
        (3, 1, "invalid objective 3 (expected the name of an objective)"),
        ("low cost", 1, "invalid objective 'low cost' (a letter, then letters"),
        ("risk", None, "a hard constraint belongs to the objective risk (add a cost"),
    ],
)
def test_invalid_objectives_of_a_model_are_named_with_their_line(given: object, cost: int | None, message: str) -> None:
    model = drones()
    with pytest.raises(ModelError, match=rf"test_objectives\.py:\d+: {re.escape(message)}"):
        model.add(model["drone1.height"] == 1, cost=cost, objective=given)  # type: ignore[arg-type]


def test_a_single_cost_is_required_where_objectives_were_not_combined() -> None:
    with pytest.raises(SeveralObjectivesError, match=r"several objectives \(energy, risk\)"):
        normalized(drones().team)
