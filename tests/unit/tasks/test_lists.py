"""Lists of robots and tasks: how they are read and told, and what is wrong has its line."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from random import Random

import pytest
import yaml

from robochoc.cli.reports.outcome import outcome_report
from robochoc.formats import InvalidInputError, read_team, write_team
from robochoc.formats.dialects.dialect import ImportOptions
from robochoc.formats.dialects.registry import read_foreign, recognise
from robochoc.formats.problems import read_problem
from robochoc.model.problem import RemoveAgent, ScenarioEvent, Team
from robochoc.run import Options, Runtime, solve
from robochoc.run.defaults import CENTRAL
from tests.support.cases import looped
from tests.support.task_lists import LIST, imported, mistakes


def test_both_models_solve_alike_from_a_folder(tmp_path: Path) -> None:
    for most in (1, 2):
        text = LIST.replace("capacity: 3", f"most: {most}").replace("capacity: 2", f"most: {most}")
        read = imported(text.replace("most: 2", f"most: {most}").replace("robots: 2", "robots: 1"), tmp_path)
        write_team(read.team, tmp_path / f"team{most}")
        team = read_team(tmp_path / f"team{most}")
        assert len(team["ann"].variables) == (1 if most == 1 else 3)
        costs = [solve(one, Options(protocol=CENTRAL)).cost for one in (team, read.team)]
        assert costs[0] == costs[1] is not None


def test_it_is_recognised_by_what_it_has(tmp_path: Path) -> None:
    path = tmp_path / "any.yaml"
    for text, name in (
        (LIST, "tasks"),
        ("robots: {a: }\ntasks: {t: {worth: 1}}", "tasks"),
        ("robots: {a: }", "tasks"),
        ("name: x\nobjective: min\ndomains: {}\nvariables: {}\nagents: {}", "pydcop"),
    ):
        path.write_text(text)
        dialect = recognise(path)
        assert dialect is not None
        assert dialect.name == name
    (tmp_path / "any.txt").write_text(LIST)
    assert recognise(tmp_path / "any.txt") is None


def test_who_does_which_task_is_a_table(tmp_path: Path) -> None:
    team = imported(LIST, tmp_path).team
    told = outcome_report(team, solve(team, Options(protocol="dpop", runtime=Runtime.SIMULATOR)))
    assert told.splitlines()[1:5] == [
        "    robot  does",
        "    ann    fetch, carry",
        "    bob    survey, inspect",
        "    cid    carry",
    ]


def test_a_robot_of_one_task_has_it_as_its_value(tmp_path: Path) -> None:
    text = "robots: {ann: {most: 1}, bob: {most: 1}}\ntasks: {dig: {worth: 3}, lay-1: {worth: -1}}"
    team = imported(text, tmp_path).team
    assert [one.name for one in team["ann"].variables] == ["ann.task"]
    outcome = solve(team, Options(protocol="dpop", runtime=Runtime.SIMULATOR))
    assert sorted(map(str, outcome.labelled(outcome.assignment).values())) == ["dig", "none"]
    assert "    not assigned: lay-1" in outcome_report(team, outcome)


def test_names_that_are_not_allowed_here_come_back(tmp_path: Path) -> None:
    path = tmp_path / "tasks.yaml"
    path.write_text("robots: {r-1: , r-2: }\ntasks: {pick up: {worth: 3}, 7: {worth: 1}}")
    read = read_problem(path)
    assert read.names == {
        "r_1": "r-1",
        "r_2": "r-2",
        **{f"r_{n}.{now}": f"r-{n}.{was}" for n in (1, 2) for now, was in (("pick_up", "pick up"), ("v7", "7"))},
    }


def test_what_nobody_can_do_is_told(tmp_path: Path) -> None:
    told = LIST.replace("tasks:\n", "  dan: {skills: dance}\ntasks:\n", 1)
    assert [note.text for note in imported(told, tmp_path).notes] == [
        "the robot dan, which can do none of the tasks",
        "the task paint, which no robot can do",
    ]


@looped(
    ("now", "then", "told"),
    [
        ("skills: [camera]", "skill: [camera]", "3: unknown key 'skill' in robots.bob (did you mean 'skills'?)"),
        ("most: 2", "most: 2.5", "3: the robot 'bob' cannot have '2.5' as 'most' (write an integer"),
        ("most: 2", "most: yes", "3: the robot 'bob' cannot have 'yes' as 'most'"),
        ("most: 2", "speed: 0", "3: the robot 'bob' has the speed 0 (write a number above 0)"),
        ("at: [8, 1]", "at: [8]", "3: the robot 'bob' cannot have this value as 'at' (write at: [X, Y]"),
        ("at: [8, 1]", "at: [8, x]", "3: the robot 'bob' cannot have 'x' as 'at'"),
        ("at: [8, 1]", "at: [8, 1, 0]", "3: a place has a different number of coordinates than the places before it"),
        (", worth: 10", "", "6: the task 'survey' has no worth (write worth:"),
        ("worth: 10", "worth: .inf", "6: the task 'survey' cannot have 'inf' as 'worth'"),
        ("robots: 2", "robots: 3", "9: the worth 20 of 'carry' cannot be divided by its 3 robots"),
        (
            "[survey, inspect]",
            "[survey, inspct]",
            "a synergy has the task 'inspct', which is not in the list (did you mean",
        ),
        ("[survey, inspect]", "[survey, survey]", "12: a synergy does not have two different tasks"),
        ("streets", "street", "13: the file cannot have 'street' as 'distance' (did you mean 'streets'?)"),
        (
            "distance: streets",
            "model: severl",
            "13: the file cannot have 'severl' as 'model' (did you mean 'several'?)",
        ),
        ("distance: streets", "tour: yes", "13: unknown key 'tour' (did you mean 'tours'?)"),
        (", worth: 10", ", wort: 10", "6: unknown key 'wort' in the task 'survey' (did you mean 'worth'?)"),
        ("distance: streets", "model: assignment", "may do 2 tasks; the model assignment allows one"),
        ("distance: streets", "places: 10", "has costs with 10 decimal places"),
        ("  bob:", "  ann:", "3: duplicate key 'ann'"),
        ("tasks:\n", "task:\n", "5: unknown key 'task' in the file (did you mean 'tasks'?)"),
        ("robots:\n", "robots: []\nrobot:\n", "1: robots is not a mapping"),
        ("fetch: {", "fetch: !!python/object:os.system {", "8: the tag"),
        ("  cid:", "  a.b: {skills: eye}\n  a: {skills: eye}\n  cid:", None),
    ],
)
def test_what_is_wrong_is_told_with_its_line(now: str, then: str, told: str | None, tmp_path: Path) -> None:
    assert now in LIST
    text = LIST.replace(now, then, 1)
    if told is None:
        text = text.replace("tasks:\n", "tasks:\n  c: {needs: eye, worth: 1}\n  b.c: {needs: eye, worth: 1}\n", 1)
        told = "the robots a.b and a would both have a variable a.b.c"
    assert told in mistakes(text, tmp_path)


def test_all_mistakes_are_told_at_once(tmp_path: Path) -> None:
    text = LIST.replace("most: 2", "most: -1").replace("worth: 12", "worth: much").replace("load: 2", "load: 2")
    assert len(mistakes(text, tmp_path).splitlines()) == 2


def test_errors_of_all_kinds_are_reported_together(tmp_path: Path) -> None:
    text = """radius: 0.3
map: ""
tours: 1
robots:
  ann: {at: [0, 0], topic: yes}
  bob: {at: [0, 0], topic: /bob/x?y}
  cid: {at: [0, 0, 1]}
tasks:
  a: {worth: 4, after: a, window: [1, 5]}
  b: {worth: 4, window: [.nan, 5]}
  c: {worth: 4, after: [zz, b], window: [1, 5]}
synergies: [{tasks: [a, b], worth: 2020-01-01}]
"""
    lines = mistakes(text, tmp_path).splitlines()
    assert [(line.partition(":")[0], line.partition(": ")[2].partition(" (")[0]) for line in lines] == [
        ("2", "the file cannot have '' as 'map'"),
        ("3", "the file cannot have '1' as 'tours'"),
        ("5", "the robot 'ann' cannot have 'yes' as 'topic'"),
        ("6", "the robot 'bob' cannot have the topic '/bob/x?y'"),
        ("7", "a place has a different number of coordinates than the places before it"),
        ("9", "the order of tasks is a cycle: a, a"),
        ("10", ".nan is not a number"),
        ("11", "the task 'c' is after 'zz', which is not in the list"),
        ("12", "2020-01-01 is a date, which is not supported"),
    ]


@looped(
    ("text", "told"),
    [
        ("robots: {a: }\ntasks: {none: {worth: 1}}\nmodel: assignment", "2: the name 'none' is reserved"),
        ("robots: {a: }\ntasks: {t t: {worth: 1}}\nmodel: assignment", "2: 't t'"),
        ("robots: {a: }", "has no tasks"),
        ("robots: 3\ntasks: 4", "1: robots is not a mapping"),
        ("robots: {}\ntasks: {t: {worth: 1}}", "1: has no robots (write robots:"),
        ("robots: {a: }\ntasks: {t: 3}", "2: the task 't' is not a mapping"),
        ("robots: {7: , '7': }\ntasks: {t: {worth: 1}}", "robots has '7' twice"),
        ("robots: {a: {most: 0}}\ntasks: {t: {worth: 1}}", "no robot can do any of the tasks"),
        ("robots: {a: }\ntasks: {t: {worth: 1}}\nsynergies: 3", "3: synergies is not a list"),
    ],
)
def test_what_cannot_be_a_list_is_refused(text: str, told: str, tmp_path: Path) -> None:
    assert told in mistakes(text, tmp_path)


def test_aliases_are_counted_in_full(tmp_path: Path) -> None:
    bomb = "robots:\n  a: {skills: &a [x, x, x, x, x, x, x, x, x, x]}\n"
    bomb += "".join(f"  b{n}: &{chr(98 + n)} {{skills: [{', '.join([f'*{chr(97 + n)}'] * 10)}]}}\n" for n in range(8))
    assert "values, counting what aliases repeat" in mistakes(bomb + "tasks: {t: {worth: 1}}", tmp_path)


def test_too_much_is_refused(tmp_path: Path) -> None:
    robots = "".join(f"  r{number}: {{}}\n" for number in range(17))
    assert "and 17 robots can do it" in mistakes(f"robots:\n{robots}tasks: {{t: {{worth: 4, robots: 2}}}}", tmp_path)
    tasks = "".join(f"  t{number}: {{worth: 1}}\n" for number in range(1001))
    assert "has 1001 tasks (write at most 1000)" in mistakes(f"robots: {{a: }}\ntasks:\n{tasks}", tmp_path)
    with pytest.raises(InvalidInputError, match="whose import does not support --infinity"):
        imported(LIST, tmp_path, infinity=3)


def test_random_changes_of_a_list_are_read_or_refused(tmp_path: Path) -> None:
    """Nothing but `InvalidInputError` comes out."""
    chance = Random("bytes")
    read = refused = 0
    for _ in range(60):
        text = list(LIST)
        for _ in range(chance.randrange(1, 4)):
            text[chance.randrange(len(text))] = chance.choice("{}[]:,-&*!0a \n'")
        try:
            read += bool(imported("".join(text), tmp_path).team.robots)
        except InvalidInputError:
            refused += 1
    assert read
    assert refused


def test_flow_style_and_json_are_lists_too(tmp_path: Path) -> None:
    block = imported(LIST, tmp_path).team
    whole = yaml.safe_load(LIST)
    for name, text in (
        ("tasks.json", json.dumps(whole, indent=1)),
        ("tasks.yaml", f"# tasks\n---\n{yaml.safe_dump(whole, default_flow_style=True, sort_keys=False)}"),
        ("tasks.yml", json.dumps(whole)),
    ):
        path = tmp_path / name
        path.write_text(text)
        assert recognise(path) is not None, name
        assert read_foreign([path], ImportOptions()).team == block, name


def test_ways_cost_the_same_with_tours_where_a_robot_does_one_task(tmp_path: Path) -> None:
    text = LIST.replace("capacity: 3", "most: 1").replace("most: 2", "most: 1").replace(", robots: 2", "")
    text = f"model: assignment\n{text}"
    assert imported(f"tours: yes\n{text}", tmp_path).team == imported(text, tmp_path).team


@pytest.mark.usefixtures("shared_solvers")
@pytest.mark.parametrize("head", ["model: assignment", "tours: no", "tours: yes"])
def test_when_a_robot_leaves_the_others_do_its_tasks(head: str, tmp_path: Path) -> None:
    """The team decides as if the robot had never been in the list."""
    robots = {"ann": "{at: [0, 0]}", "bob": "{at: [9, 0]}", "cid": "{at: [5, 5]}"}
    tasks = (
        "tasks:\n  left: {at: [1, 1], worth: 20}\n  right: {at: [8, 1], worth: 20}\n  middle: {at: [4, 4], worth: 9}\n"
    )

    def listed(names: list[str]) -> Team:
        lines = "".join(f"  {name}: {robots[name]}\n" for name in names)
        return imported(f"{head}\nrobots:\n{lines}{tasks}", tmp_path).team

    options = Options(protocol="dpop", runtime=Runtime.SIMULATOR)
    for name in robots:
        event = ScenarioEvent((RemoveAgent(name),))
        outcome = solve(replace(listed([*robots]), scenario=(event,)), options)
        assert outcome.cost == solve(listed([one for one in robots if one != name]), options).cost
