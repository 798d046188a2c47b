"""A run that came in a file: its claims are told as such, its answer is checked, its command is not taken over."""

from __future__ import annotations

import shutil
from pathlib import Path

import msgspec
import pytest

from robochoc.app.flights.answer_check import check, claim_words
from robochoc.app.flights.builder import of_chosen_point
from robochoc.app.flights.flight_map import changed_to
from robochoc.app.flights.saved_state import packed, unpack_run
from robochoc.app.imported.picture import picture_sketch
from robochoc.app.pages.decide.answer import headline
from robochoc.app.runs.options import RunOptions
from robochoc.app.runs.run import CHANGE, Checked, Run, run_of
from robochoc.app.sketch import edits
from robochoc.app.sketch.open_from_disk import ImportedTeam, open_team
from robochoc.app.sketch.sketch import Cell, Decision, DecisionKind, Sketch, SketchRobot, SketchRule
from robochoc.formats import write_team
from robochoc.formats.result import read_result, result_json
from robochoc.model.assembly import assemble
from robochoc.model.expression import Type, parse
from robochoc.model.problem import Constraint, CostUnits, Domain, Function, ProblemKind, Variable
from robochoc.run.options import Options, Runtime
from robochoc.run.orchestrator import solve
from tests.support.cases import looped
from tests.support.kept_runs import cube, kept_run
from tests.support.program import ROOT
from tests.support.run_results import run_epoch


def _opened(folder: Path, **differing: object) -> Run:
    """Return a run with this result, packed and opened again."""
    run = kept_run(folder / "here", cube(), **differing)
    file = folder / "state.zip"
    file.write_bytes(packed(run))
    assert unpack_run(file, folder / "there")
    return run_of(folder / "there" / "runs" / "00001")


def _found(run: Run) -> Checked | None:
    """Return what a check finds of a run."""
    check(run)
    return run.record.checked


LEVELS = {"Drone1.level": 1, "Drone2.level": 2, "Drone3.level": 3}


@looped(
    ("differing", "found", "words"),
    [
        (
            {},
            Checked.KEPT,
            (
                "The opened file claims: All 3 decide. It costs 6: proven the best. Checked here: all rules that"
                " must hold are kept, and the cost is correct. The claim that no answer is better was not checked: let"
                " the team decide again to check it."
            ),
        ),
        (
            {"assignment": {**LEVELS, "Drone3.level": 1}, "cost": 3},
            Checked.BROKEN,
            (
                "The opened file claims: All 3 decide. It costs 3: proven the best. Checked here: this is wrong,"
                " since a rule that must hold is broken. Let the team decide again."
            ),
        ),
        ({"assignment": {**LEVELS, "Drone3.level": 9}}, Checked.BROKEN, None),
        ({"assignment": {**LEVELS, "Drone3.level": "3"}}, Checked.BROKEN, None),
        ({"assignment": {**LEVELS, "Drone4.level": 3}}, Checked.BROKEN, None),
        ({"assignment": {"Drone1.level": 1, "Drone2.level": 2}}, Checked.BROKEN, None),
        (
            {"assignment": {"Drone1.level": 1, "Drone2.level": 2}, "withdrawn": ["Drone3"], "cost": 3},
            Checked.KEPT,
            None,
        ),
        ({"cost": 5}, Checked.COST, "or the worth is wrong"),
        ({"cost": 6.0000000000000001}, Checked.KEPT, None),
        ({"cost": -1e300}, Checked.COST, None),
        (
            {"verdict": "no-solution", "assignment": {}, "cost": None},
            None,
            (
                "The opened file claims: There is no solution: the rules cannot all hold. This was not checked"
                " here: let the team decide again to check it."
            ),
        ),
        ({"verdict": "unknown", "bound": 6}, Checked.KEPT, "No answer costs less than 6. Checked here"),
    ],
)
def test_what_a_file_says_is_held_against_its_team(
    tmp_path: Path, differing: dict[str, object], found: Checked | None, words: str | None
) -> None:
    run = _opened(tmp_path, **differing)
    assert run.record.checked is found
    assert words is None or words in headline(run)


@looped("cost", ["1e999999999", "1e-999999999", "1e400", "-1e-401"])
def test_that_no_number_takes_all_memory(tmp_path: Path, cost: str) -> None:
    run = kept_run(tmp_path, cube())
    file = run.folder / "result.json"
    file.write_bytes(file.read_bytes().replace(b'"cost":6', f'"cost":{cost}'.encode()))
    run.result = None
    check(run)
    assert run.record.checked in {Checked.COST, None}


def test_that_what_the_file_says_of_its_check_does_not_count(tmp_path: Path) -> None:
    run = kept_run(tmp_path / "here", cube(), cost=1)
    run.record.checked, run.record.maximised, run.record.opened = Checked.KEPT, True, False
    run.save()
    file = tmp_path / "state.zip"
    file.write_bytes(packed(run))
    assert unpack_run(file, tmp_path / "there")
    record = run_of(tmp_path / "there" / "runs" / "00001").record
    assert (record.opened, record.checked, record.maximised) == (True, Checked.COST, False)


def test_that_ones_own_run_is_told_as_it_is(tmp_path: Path) -> None:
    run = kept_run(tmp_path, cube())
    assert claim_words(run, "It is so.") == "It is so."


def test_that_values_of_two_words_are_checked(tmp_path: Path) -> None:
    sketch = Sketch("Home", robots=(SketchRobot("Ada", Cell(0, 0)), SketchRobot("Ben", Cell(1, 0))))
    sketch = edits.with_decision(sketch, Decision("task", DecisionKind.TASK, ("wash up", "dry")))
    sketch = edits.with_rule(sketch, SketchRule("", "different", "task"))
    run = kept_run(tmp_path, sketch, assignment={"Ada.task": "wash_up", "Ben.task": "dry"}, cost=None)
    run.record.labels, run.result = {"wash_up": "wash up"}, None
    assert _found(run) is Checked.KEPT
    run.record.labels, run.result = {"wash_up": "dry"}, None  # as it would be shown
    assert _found(run) is Checked.BROKEN


def test_that_the_team_after_what_has_happened_is_the_one_that_counts(tmp_path: Path) -> None:
    after = edits.without_robot(cube(), "Drone2")
    left = {"Drone1.level": 1, "Drone3.level": 3}
    run = kept_run(tmp_path, cube(), assignment=left, cost=3, epochs=[run_epoch("solution"), run_epoch("solution")])
    (run.folder / CHANGE).write_bytes(msgspec.json.encode({"after": after, "happened": ["Drone2 fails."]}))
    assert changed_to(run) == after
    assert _found(run) is Checked.KEPT
    (run.folder / CHANGE).unlink()
    assert _found(run) is Checked.BROKEN


def test_that_too_large_a_team_is_not_checked(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("robochoc.app.flights.answer_check.CHECK_S", -1.0)
    assert _opened(tmp_path).record.checked is None


@pytest.mark.parametrize("wrong", [False, True])
@looped("example", ["rescue", "hangar", "patrol"])
def test_that_teams_of_files_are_checked(tmp_path: Path, example: str, *, wrong: bool) -> None:
    files = ROOT / "docs/examples" / example
    found = open_team(files)
    assert isinstance(found, ImportedTeam)
    outcome = solve(found.team, Options())
    assert outcome.assignment
    run = kept_run(tmp_path, picture_sketch(found))
    shutil.copytree(files, run.team)
    told = msgspec.json.decode(result_json(outcome))
    if wrong:
        told["assignment"].popitem()
    (run.folder / "result.json").write_bytes(msgspec.json.encode(told) + b"\n")
    run.result = None
    check(run)
    assert run.record.checked is (Checked.BROKEN if wrong else Checked.KEPT)


def test_each_point_of_a_front_is_checked_and_the_chosen_one_is_flown(tmp_path: Path) -> None:
    files = ROOT / "docs/examples/survey"
    found = open_team(files)
    assert isinstance(found, ImportedTeam)
    outcome = solve(found.team, Options(runtime=Runtime.SIMULATOR))
    run = kept_run(tmp_path, picture_sketch(found))
    shutil.copytree(files, run.team)
    told = msgspec.json.decode(result_json(outcome))
    (run.folder / "result.json").write_bytes(msgspec.json.encode(told) + b"\n")
    run.result = None
    assert _found(run) is Checked.KEPT
    for place in (-1, 8, 5):  # the last one exists
        run.choose_point(place)
    result = run_of(run.folder).result
    assert result is not None
    assert (result.point, result.cost, result.objectives) == (5, 23, {"energy": 23, "risk": 14})
    assert result.assignment == outcome.front[5].assignment
    assert "point 6 of 8 on the Pareto front: energy 23 and risk 14" in result.point_in_words
    flown = read_result(of_chosen_point(run) or b"")
    assert flown is not None
    assert (flown.assignment, flown.cost) == (result.assignment, 23)
    told["front"][7]["objectives"]["risk"] = 9
    (run.folder / "result.json").write_bytes(msgspec.json.encode(told) + b"\n")
    run.result = None
    assert _found(run) is Checked.COST


@looped(("cost", "found"), [(3.5, Checked.KEPT), (3, Checked.COST), (-3.5, Checked.COST)])
def test_that_a_worth_is_checked_in_the_users_numbers(tmp_path: Path, cost: float, found: Checked) -> None:
    product = Function("product", ("X", "Y"), parse("sub(mul(X,Y),1)", ("X", "Y"), Type.INTEGER))
    values = Domain("D", (range(3),))
    team = assemble(
        "utilities",
        {"a": [Variable("x", values)], "b": [Variable("y", values)]},
        [Constraint("C", product, ("x", "y"), ("x", "y"))],
        kind=ProblemKind.DISWCSP,
        costs=CostUnits(maximize=True, places=1, constant=5),
    )
    run = kept_run(tmp_path, picture_sketch(ImportedTeam(tmp_path, team)), assignment={"x": 2, "y": 2}, cost=cost)
    run.record.opened = True
    write_team(team, run.team)
    check(run)
    assert (run.record.checked, run.record.maximised) == (found, True)
    right = "and the worth is correct" if run.record.checked is Checked.KEPT else "or the worth is wrong"
    assert right in claim_words(run, "")


@looped(
    "options",
    [
        RunOptions(protocol="$(reboot)"),
        RunOptions(runtime="network"),
        RunOptions(seed=-1),
        RunOptions(timeout=float("inf")),
        RunOptions(timeout=-1.0),
        RunOptions(more=("--html", "/home/me/.profile")),
    ],
)
def test_that_a_command_is_made_from_options_that_can_be_set_here_alone(tmp_path: Path, options: RunOptions) -> None:
    run = kept_run(tmp_path, cube())
    run.record.arguments = ["solve", "; reboot"]
    assert "reboot" in run.command
    run.record.opened = True
    assert run.command.startswith("robochoc solve Cube --json")
    assert "reboot" not in run.command
    run.record.options = options
    assert run.command == ""
