"""What is compared: protocols that fit, a family that is like the team, and the study that says it."""

from __future__ import annotations

import tomllib
from collections.abc import Callable
from pathlib import Path

import pytest

from robochoc.app.runs.fitting import fitting
from robochoc.app.runs.prepared_team import TeamFiles
from robochoc.app.sketch.building import model_of
from robochoc.app.sketch.sketch import Area, Cell, Decision, DecisionKind, Sketch, SketchRobot, SketchRule
from robochoc.app.sketch.troubles import NotReadyError
from robochoc.app.studies.families import family_of
from robochoc.app.studies.question import StudyQuestion, number_of_runs, possible, study_of
from robochoc.app.texts import say
from robochoc.experiments.plan import plan_of
from robochoc.experiments.study import read_study
from robochoc.formats import write_team
from tests.support.cases import looped
from tests.support.small_teams import pkc_team

ROBOTS = tuple(SketchRobot(name, Cell(place, 0)) for place, name in enumerate("ABCD"))
SLOT = Decision("slot", DecisionKind.SLOT, (1, 2, 3, 4))
DIFFERENT = SketchRule("R1", "different", "slot")
APART = SketchRule("R2", "apart", "slot", ("A", "B"), {"gap": 2})
LITTLE = SketchRule("R3", "little", "slot", (), {"step": 1})


def team(*rules: SketchRule, ranks: int = 0) -> Sketch:
    robots = tuple(SketchRobot(robot.name, robot.at, 1, ranks) for robot in ROBOTS)
    return Sketch("team", Area(4, 1), robots, (SLOT,), rules)


def test_only_protocols_that_fit_are_offered() -> None:
    plain, costly = possible(team(DIFFERENT)), possible(team(DIFFERENT, LITTLE))
    assert ("abt", True) in plain.protocols
    assert "abt" not in dict(costly.protocols)
    assert ("dpop", True) in costly.protocols
    for found in (plain, costly):
        assert len(set(found.usual)) == 2
        assert {*found.usual} <= {*dict(found.protocols)}
    assert (plain.costs, costly.costs) == (False, True)


@pytest.mark.parametrize("look", [possible, fitting])
def test_a_team_that_is_not_ready_is_told_what_to_mend(look: Callable[[Sketch], object]) -> None:
    with pytest.raises(NotReadyError, match=r"R1 .*value of slot\. Choose one"):
        look(team(SketchRule("R1", "prefers", "slot", settings={})))


def test_all_different_is_a_colouring() -> None:
    family = family_of(team(DIFFERENT))
    assert family is not None
    assert (family.name, family.points) == ("coloring", 3)
    assert family.options == {"agents": 4, "degree": 3.0, "colors": [3, 4, 5], "conflicts": "hard"}


def test_other_rules_are_random_problems_of_their_size() -> None:
    """Two of six pairs are linked. Of 16 pairs of values, 10 are less than 2 apart."""
    family = family_of(team(APART, SketchRule("R3", "apart", "slot", ("C", "D"), {"gap": 2})))
    assert family is not None
    assert family.options == {"agents": 4, "domain": 4, "density": 0.333, "tightness": [0.52, 0.62, 0.72]}


def test_rules_of_a_pair_count_together() -> None:
    """Values that one of them forbids are those that the other one does: pairs that are equal are too close, too."""
    family = family_of(team(DIFFERENT, APART))
    assert family is not None
    assert family.options["tightness"] == [0.21, 0.31, 0.41]  # a pair of 10/16, five of 4/16: 0.3125 on average


@looped("sketch", [team(), team(LITTLE), Sketch("team", robots=ROBOTS[:1], decisions=(SLOT,))])
def test_without_links_there_is_no_family(sketch: Sketch) -> None:
    assert family_of(sketch) is None


@looped("rules", [(DIFFERENT,), (DIFFERENT, APART), (APART, LITTLE)])
@pytest.mark.parametrize("of_family", [True, False])
def test_a_study_is_what_the_command_takes(tmp_path: Path, rules: tuple[SketchRule, ...], *, of_family: bool) -> None:
    sketch = team(*rules)
    found = possible(sketch)
    question = StudyQuestion(found.usual, family=of_family, runs=2, timeout=5)
    text = study_of(sketch, question, found.family)
    (tmp_path / "study.toml").write_text(text, encoding="utf-8")
    model_of(sketch).save(tmp_path / "team")
    plan = plan_of(read_study(tmp_path / "study.toml"))
    assert len(plan) == number_of_runs(question, found.family) == 2 * 2 * (3 if of_family else 1)


def test_ranks_are_heeded() -> None:
    question = StudyQuestion(("abt", "afc-ng"))
    assert "order" in tomllib.loads(study_of(team(DIFFERENT), question, None))["runs"]
    assert "order" not in tomllib.loads(study_of(team(DIFFERENT, ranks=2), question, None))["runs"]


def test_the_words_of_families_are_filled_in() -> None:
    soft = SketchRule("R1", "different", "slot", cost=4)
    for rules in ((DIFFERENT,), (APART,), (soft,), (APART, LITTLE)):
        family = family_of(team(*rules))
        assert family is not None
        assert "{" not in say(family.key, **family.named)


def test_a_team_of_files_is_compared_without_a_family_and_keeps_its_order_where_parts_are_known(tmp_path: Path) -> None:
    write_team(pkc_team(), tmp_path / "pkc")
    found = possible(Sketch("pkc"), TeamFiles(tmp_path / "pkc"))
    assert found.family is None
    assert found.ordered
    assert {name for name, _ in found.protocols} >= {"abt", "disfc"}
    runs = [
        tomllib.loads(study_of(Sketch("pkc"), StudyQuestion(("abt", "disfc"), ordered=ordered), None))["runs"]
        for ordered in (True, False)
    ]
    assert ["order" in one for one in runs] == [False, True]
