"""Random variables in files: reading, writing, and errors with their lines."""

from __future__ import annotations

import itertools
import re
import shutil
from dataclasses import replace
from pathlib import Path

import pytest

import robochoc
from robochoc.cli.reports.outcome import outcome_report
from robochoc.formats import check_team
from robochoc.formats.diagnostics import InvalidInputError
from robochoc.formats.result import read_result, result_json
from robochoc.formats.team_reader import read_team
from robochoc.formats.team_writer import write_team
from robochoc.model.policies import Risk
from robochoc.model.random_variable import RandomVariable
from robochoc.model.uncertainty import is_uncertain
from robochoc.run.options import OnLoss, Options, Runtime, Withdrawal
from robochoc.run.orchestrator import prepare, solve
from robochoc.solver.errors import UnsupportedError
from tests.support.cases import looped
from tests.support.examples import drawn
from tests.support.program import ROOT
from tests.support.uncertain import uncertain_problem

GUSTS = ROOT / "docs" / "examples" / "gusts"
WIND = '<random name="wind" seen_by="relay">0.7:0|0.3:3</random>'
SIMULATED = Options(protocol="dpop", runtime=Runtime.SIMULATOR)


def mistakes_in(folder: Path, file: str, *changes: tuple[str, str]) -> list[str]:
    """Return the mistakes of the example after `changes` in one of its files, as line and message."""
    shutil.copytree(GUSTS, folder)
    path = folder / file
    content = path.read_text()
    for before, after in changes:
        assert before in content
        content = content.replace(before, after)
    path.write_text(content)
    with pytest.raises(InvalidInputError) as refused:
        read_team(folder)
    return [f"{Path(one.file).name}:{one.line} {one.message}" for one in refused.value.diagnostics]


MISTAKES = [
    ('seen_by="relay">0.7:0|0.4:3<', "Relay.xml:11 the probabilities of 'wind' have the sum 1.1"),
    ('seen_by="relay">1.0:0|0.0:3<', "Relay.xml:11 the probability of an outcome is not positive"),
    ('seen_by="relay">-0.3:0|1.3:3<', "Relay.xml:11 '-0.3' is not a probability"),
    ('seen_by="relay">nan:0<', "Relay.xml:11 'nan' is not a probability"),
    ('seen_by="relay">0.5:0|0<', "Relay.xml:11 the outcome 0 occurs twice"),
    ('seen_by="relay">3<', "Relay.xml:11 the outcome '3' has no probability"),
    ('seen_by="relay">0.7:0|0.3:gale<', "Relay.xml:11 'gale' is not an integer"),
    ('seen_by="relay">0.0001:1..10001<', "Relay.xml:11 there are more than 10,000 outcomes"),
    ('seen_by="relay">0.5:3..1<', "Relay.xml:11 the range 3..1 is empty"),
    ('seen_by="relay"><', "Relay.xml:11 the outcome '' has no probability"),
    ('seen_by="relay relay">0.7:0|0.3:3<', "Relay.xml:11 a variable occurs twice in seen_by"),
    ('seen_by="relay">0.6:0|0.4:3<', "Relay.xml:11 the random variable 'wind' differs from that of 'Camera'"),
    ('seen_by="relay other">0.7:0|0.3:3<', "Relay.xml:11 the random variable 'wind' differs from that of 'Camera'"),
]


@looped(("written", "message"), MISTAKES)
def test_mistakes_have_their_line(written: str, message: str, tmp_path: Path) -> None:
    folder = tmp_path / str(abs(hash(written)))
    found = mistakes_in(folder, "Relay.xml", ('seen_by="relay">0.7:0|0.3:3<', written))
    assert found[0] == message
    assert not any("private constraint" in one for one in found), "a consequence of the mistake"


def test_a_range_of_outcomes_is_a_uniform_distribution(tmp_path: Path) -> None:
    folder = tmp_path / "t"
    shutil.copytree(GUSTS, folder)
    for path in folder.iterdir():
        path.write_text(path.read_text().replace("0.7:0|0.3:3", "0.7:0|0.1:1..3"))
    wind = read_team(folder)["Relay"].random[0]
    assert (wind.outcomes, wind.weights) == ((0, 1, 2, 3), (7, 1, 1, 1))


def test_mistakes_between_files(tmp_path: Path) -> None:
    found = mistakes_in(tmp_path / "b", "Camera.xml", ('name="camera"', 'name="wind"'))
    assert found[0] == "Camera.xml:11 'wind' is a random variable and a variable"
    found = mistakes_in(tmp_path / "c", "Relay.xml", ('scope="relay wind"', 'scope="wind wind"'))
    assert found[0] == "Relay.xml:26 the scope 'wind' has random variables only"
    found = mistakes_in(tmp_path / "d", "Camera.xml", ('scope="camera wind"', 'scope="camera gale"'))
    assert found[0].startswith("Camera.xml:24 a private constraint over 'gale'")


def test_the_hint_of_an_unknown_variable_names_random_variables(tmp_path: Path) -> None:
    folder = tmp_path / "t"
    shutil.copytree(GUSTS, folder)
    for file in ("Camera.xml", "Relay.xml"):
        (folder / file).write_text((folder / file).read_text().replace(WIND, ""))
    with pytest.raises(InvalidInputError) as refused:
        read_team(folder)
    hints = [one.hint for one in refused.value.diagnostics if "a private constraint over 'wind'" in one.message]
    assert len(hints) == len(refused.value.diagnostics)
    assert all(hint.endswith("and declare random variables") for hint in hints)


def test_an_undeclared_random_variable_is_named(tmp_path: Path) -> None:
    found = mistakes_in(tmp_path / "t", "Relay.xml", (WIND, ""), ('scope="relay wind"', 'scope="relay 1"'))
    assert found[0] == "Relay.xml:26 the constraint depends on the random variable 'wind'"


def test_a_scenario_cannot_change_what_is_uncertain(tmp_path: Path) -> None:
    folder = tmp_path / "t"
    shutil.copytree(GUSTS, folder)
    event = '<scenario><event after="solved"><remove_value variable="{}" value="4"/></event></scenario>'
    (folder / "scenario.xml").write_text(event.format("relay"))
    with pytest.raises(InvalidInputError, match="'relay' is chosen after wind was observed"):
        read_team(folder)
    (folder / "scenario.xml").write_text(event.format("camera"))
    team = read_team(folder)
    outcome = solve(team, SIMULATED)
    assert [epoch.verdict for epoch in outcome.epochs] == ["optimal", "optimal"]
    with pytest.raises(UnsupportedError, match=r"t has a scenario\.xml"):
        solve(team, replace(SIMULATED, risk=Risk.WORST))


def test_a_robot_that_joins_declares_the_same_random_variables(tmp_path: Path) -> None:
    folder = tmp_path / "t"
    shutil.copytree(GUSTS, folder)
    (folder / "scenario.xml").write_text(
        '<scenario><event after="solved"><add_agent file="late/Extra.xml"/></event></scenario>'
    )
    late = folder / "late" / "Extra.xml"
    late.parent.mkdir()
    extra = (GUSTS / "Relay.xml").read_text()
    extra = re.sub("<agents_neighbours>.*</agents_neighbours>", "<agents_neighbours/>", extra, flags=re.DOTALL)
    extra = extra.replace("relay", "extra").replace('seen_by="extra"', 'seen_by="relay"')
    late.write_text(extra)
    assert [epoch.verdict for epoch in solve(read_team(folder), SIMULATED).epochs] == ["optimal", "optimal"]
    late.write_text(extra.replace("0.7:0|0.3:3", "0.6:0|0.4:3"))
    with pytest.raises(
        InvalidInputError, match=r"Extra\.xml:11: the random variable 'wind' differs from that of the team"
    ):
        read_team(folder)


def test_what_is_written_is_read_again(tmp_path: Path) -> None:
    chance = drawn("written uncertainty")
    teams = [read_team(GUSTS), *(uncertain_problem(chance).team for _ in range(12))]
    for number, team in enumerate(teams):
        folder = tmp_path / str(number) / team.name
        write_team(team, folder)
        again = read_team(folder)
        assert is_uncertain(again) == is_uncertain(team)
        first, second = (solve(one, SIMULATED) for one in (team, again))
        assert (first.cost, first.uncertainty) == (second.cost, second.uncertainty)
        assert ("<random " in "".join(one.read_text() for one in folder.iterdir())) == is_uncertain(team)


def test_a_changed_team_is_written_as_the_problem_that_it_is(tmp_path: Path) -> None:
    team = read_team(GUSTS)
    changed = replace(team, robots=(replace(team["Camera"], weight=3), team["Relay"]))
    assert not is_uncertain(changed)
    write_team(changed, tmp_path / "gusts")
    again = read_team(tmp_path / "gusts")
    assert not is_uncertain(again)
    assert solve(again, SIMULATED).cost == solve(team, SIMULATED).cost


def test_the_result_contains_the_policy() -> None:
    outcome = solve(read_team(GUSTS), SIMULATED)
    report = outcome.uncertainty
    assert report is not None
    assert {(choice.when["wind"], choice.value) for choice in report.policies["relay"]} == {(0, 3), (3, 2)}
    assert (report.scenarios, report.worst_scenario) == (2, {"wind": 3})
    assert read_result(result_json(outcome)).uncertainty == report


def test_a_robot_with_random_variables_must_be_converted() -> None:
    team = read_team(GUSTS)
    wind = RandomVariable("wind", (0, 3), (7, 3), 1)
    raw = replace(team, robots=(replace(team["Camera"], random=(wind,), declared=None), team["Relay"]))
    with pytest.raises(InvalidInputError, match="expected_robot"):
        check_team(raw)


def test_the_worst_case_is_limited_and_needs_random_variables() -> None:
    with pytest.raises(UnsupportedError, match="scouts has no random variables"):
        solve(read_team(ROOT / "docs" / "examples" / "scouts"), replace(SIMULATED, risk=Risk.WORST))


def test_robots_stay_in_the_worst_case() -> None:
    worst = replace(SIMULATED, risk=Risk.WORST)
    for options in (replace(worst, withdraw=Withdrawal.MINIMUM), replace(worst, on_loss=OnLoss.WITHDRAW)):
        with pytest.raises(UnsupportedError, match="robots cannot withdraw, be lost or leave"):
            prepare(read_team(GUSTS), options)


def test_a_report_names_costs_only_if_there_are_any() -> None:
    model = robochoc.Model("calm")
    place = model.robot("one").variable("place", range(3))
    model.add(place + model.random("wind", {0: 0.5, 1: 0.5}) < 3)
    assert "expected cost" not in outcome_report(model.team, solve(model.team, SIMULATED))
    model.minimize(3 - place)
    assert "expected cost 2; worst case 2 (the same)" in outcome_report(model.team, solve(model.team, SIMULATED))


def test_a_message_about_many_random_variables_is_short() -> None:
    model = robochoc.Model("coins")
    place = model.robot("one").variable("place", range(2))
    coins = [model.random(f"coin{number}", {0: 0.5, 1: 0.5}) for number in range(40)]
    for one, other in itertools.pairwise(coins):
        model.add(one + other != place, cost=1)
    with pytest.raises(UnsupportedError, match=r"coin8 coin9 and 30 more has 2 combinations of 1 variable, in 1,099,"):
        solve(model.team, replace(SIMULATED, risk=Risk.WORST))


def test_too_many_outcomes_are_refused(tmp_path: Path) -> None:
    more = "".join(f'<random name="r{number}">0.5:0|0.5:1</random>' for number in range(13))
    formals = [f"X{number}" for number in range(13)]
    scope = " ".join(f"r{number}" for number in range(13))
    parameters = f"<parameters>{' '.join(f'int {name}' for name in formals)} int H</parameters>"
    total = f"add({','.join(formals)},H)"
    body = "<expression><functional>{}</functional></expression>"
    function = f'<function name="f">{parameters}{body.format(f"div(1,{total})")}</function></functions>'
    predicate = f'<predicate name="p">{parameters}{body.format(f"ge({total},0)")}</predicate></predicates>'
    declared = ("</random_variables>", f"{more}</random_variables>")
    for file, own, definition, reference, message in (
        ("Camera.xml", "camera", ("</functions>", function), "blur", "24 the constraint sharp depends on 8,192 joint"),
        ("Relay.xml", "relay", ("</predicates>", predicate), "calm", "26 the constraint safe depends on 16,384 joint"),
    ):
        name = "f" if reference == "blur" else "p"
        applied = (f'reference="{reference}" scope="{own} wind"', f'reference="{name}" scope="{scope} {own}"')
        found = mistakes_in(tmp_path / file, file, declared, definition, applied)
        assert found[0].startswith(f"{file}:{message}")
