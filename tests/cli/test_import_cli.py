"""`robochoc import` and `export`, and files of other tools in `validate` and `solve`."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from robochoc import load
from robochoc.cli.options.problems import READ, WRITTEN
from robochoc.formats import InvalidInputError, read_team
from robochoc.formats.dialects.registry import NAMES
from tests.support.cases import cases
from tests.support.program import robochoc_within

FRODO = """<instance><presentation name="p" format="XCSP 2.1_FRODO" maximize="{maximize}"/>
  <agents><agent name="r-1"/><agent name="r-2"/></agents><domains><domain name="d">1..3</domain></domains>
  <variables><variable name="x#1" domain="d" agent="r-1"/><variable name="x#2" domain="d" agent="r-2"/></variables>
  <relations><relation name="r" semantics="soft" arity="2" defaultCost="{default}">0.5: 1 2|2 1 | 2: 3 1</relation>
  </relations><constraints><constraint name="c" scope="x#1 x#2" reference="r"/></constraints></instance>"""


@pytest.fixture
def problem(tmp_path: Path) -> Path:
    path = tmp_path / "problem.xml"
    path.write_text(FRODO.format(maximize="false", default="infinity"))
    return path


def test_names_of_formats() -> None:
    assert {*READ, *WRITTEN} == {*NAMES}


def test_import_tells_what_it_changed(problem: Path, tmp_path: Path) -> None:
    team, report = tmp_path / "team", tmp_path / "report.json"
    done = robochoc_within("import", problem, "-o", team, "--report", report)
    assert done.returncode == 0, done.stderr
    assert f"{team}: 2 robots, 2 variables, 1 constraint, from frodo; next: robochoc solve {team}" in done.stdout
    assert "  renamed: r-1 is r_1\n" in done.stdout
    assert "  renamed: and 1 more" in done.stdout
    assert "  scale: costs are decimals" in done.stdout
    (entry,) = json.loads(report.read_text())
    assert (entry["imported"], entry["format"], entry["type"]) == (True, "frodo", "DisWCSP")
    assert entry["names"] == {"r_1": "r-1", "r_2": "r-2", "x_1": "x#1", "x_2": "x#2"}
    assert {note["kind"] for note in entry["notes"]} == {"renamed", "scale"}
    assert read_team(team).order == ("r_1", "r_2")
    listed = robochoc_within("import", problem, "-o", tmp_path / "other", "--report", "-")
    assert json.loads(listed.stdout)[0]["names"] == entry["names"]


def test_import_replaces_nothing_unless_told(problem: Path, tmp_path: Path) -> None:
    team = tmp_path / "team"
    assert robochoc_within("import", problem, "-o", team).returncode == 0
    again = robochoc_within("import", problem, "-o", team)
    assert (again.returncode, "the folder exists already" in again.stderr) == (1, True)
    assert robochoc_within("import", problem, "-o", team, "--force", "--order", "lexicographic").returncode == 0
    (team / "notes.txt").write_text("mine")
    other = robochoc_within("import", problem, "-o", team, "--force")
    assert "it contains 'notes.txt'" in other.stderr


def test_import_of_a_folder_makes_a_team_of_each_problem(problem: Path, tmp_path: Path) -> None:
    folder, teams = tmp_path / "problems", tmp_path / "teams"
    (folder / "below").mkdir(parents=True)
    (folder / "one.xml").write_text(problem.read_text())
    (folder / "one.xcsp").write_text(problem.read_text())
    (folder / "broken.xml").write_text(problem.read_text().replace("0.5: 1", "0.5: x"))
    (folder / "notes.txt").write_text("no problem")
    for name in ("r-1", "r-2"):
        (folder / "below" / f"{name}.xml").write_text(
            problem.read_text().replace("<agents>", f'<agents self="{name}">')
        )
    done = robochoc_within("import", folder, "-o", teams)
    assert done.returncode == 1
    assert done.stdout.endswith("3 of 4 problems imported\n")
    assert "broken.xml:4: 'x' is not an integer" in done.stderr
    assert sorted(str(path.relative_to(teams)) for path in teams.rglob("names.json")) == [
        "below/names.json",
        "one-xml/names.json",
        "one/names.json",
    ]
    assert "has an unknown format" not in done.stderr
    nothing = robochoc_within("import", teams, "-o", tmp_path / "more")
    assert "no file with a known format (a team's folder needs no import" in nothing.stderr


def test_wrong_usage(problem: Path, tmp_path: Path) -> None:
    mixed = robochoc_within("import", problem, tmp_path, "-o", tmp_path / "team")
    assert (mixed.returncode, "Give either the files of one problem, or folders." in mixed.stderr) == (2, True)
    pattern = robochoc_within("import", problem, "--owner", "(", "-o", tmp_path / "team")
    assert (pattern.returncode, "is not a regular expression" in pattern.stderr) == (2, True)
    unknown = tmp_path / "notes.txt"
    unknown.write_text("notes")
    told = robochoc_within("import", unknown, "-o", tmp_path / "team")
    assert (told.returncode, "has an unknown format" in told.stderr) == (1, True)
    checked = robochoc_within("validate", unknown)
    assert (checked.returncode, "has an unknown format" in checked.stdout) == (1, True)
    for command in ("import", "validate", "solve"):
        missing = robochoc_within(command, tmp_path / "nothing.yaml")
        assert (missing.returncode, "does not exist (check its name)" in missing.stdout + missing.stderr) == (1, True)


@pytest.mark.parametrize(("maximize", "cost"), [("false", 0.5), ("true", 2.0)])
def test_solve_takes_the_file_and_tells_original_names(maximize: str, cost: float, problem: Path) -> None:
    default = "infinity" if maximize == "false" else "-infinity"
    problem.write_text(FRODO.format(maximize=maximize, default=default))
    words = ["solve", problem, "--protocol", "dpop", "--runtime", "simulator"]
    done = robochoc_within(*words, "--json")
    assert done.returncode == 0, done.stderr
    told = json.loads(done.stdout)
    assert (told["verdict"], told["cost"], {*told["assignment"]}) == ("optimal", cost, {"x#1", "x#2"})
    assert "names" not in told
    assert "r-1: x#1 = " in robochoc_within(*words).stdout


def test_solve_of_an_imported_team_tells_both_names(problem: Path, tmp_path: Path) -> None:
    team = tmp_path / "team"
    assert robochoc_within("import", problem, "-o", team).returncode == 0
    words = ["solve", team, "--protocol", "dpop", "--runtime", "simulator"]
    told = json.loads(robochoc_within(*words, "--json").stdout)
    assert ({*told["assignment"]}, told["names"]["x_1"]) == ({"x_1", "x_2"}, "x#1")
    assert "r-1: x#1 = " in robochoc_within(*words).stdout


PYDCOP = """name: pairs
objective: min
domains: {d: {values: [1, 2]}}
variables: {a1: {domain: d}, a2: {domain: d}, b1: {domain: d}}
constraints:
  differ: {type: intention, function: 1000 if a1 == b1 or a2 == b1 else 0}
  same: {type: intention, function: 1000 if a1 != a2 else 3}
  low: {type: intention, function: b1}
"""


def test_files_are_read_with_the_options_of_an_import(tmp_path: Path) -> None:
    file = tmp_path / "pairs.yaml"
    file.write_text(PYDCOP)
    asked = ("--infinity", 1000, "--owner", "[a-z]")
    (sizes, *_) = robochoc_within("validate", file, *asked).stdout.splitlines()
    assert sizes == f"{file}: 2 robots, 3 variables, 3 constraints: ok"
    words = ["solve", file, "--protocol", "central", "--json", "--with", "ortools"]
    told = json.loads(robochoc_within(*words, *asked).stdout)
    assert (told["verdict"], told["cost"], told["assignment"]) == ("optimal", 4, {"a1": 2, "a2": 2, "b1": 1})
    impossible = json.loads(robochoc_within(*words, "--infinity", 3).stdout)
    assert (impossible["verdict"], impossible["cost"]) == ("no-solution", None)
    dot = [robochoc_within("export", file, "--format", "dot", *more).stdout for more in ((), asked)]
    assert [words.count("values)") for words in dot] == [3, 3]
    assert ['"a" [label' in words for words in dot] == [False, True]


def test_solve_and_validate_read_a_file_in_the_format_that_is_named(tmp_path: Path) -> None:
    file = tmp_path / "list.txt"
    file.write_text("robots: {ann: {at: [0, 0]}, bob: {}}\ntasks: {dig: {at: [1, 1], worth: 3}}\n")
    for command in ("solve", "validate"):
        unknown = robochoc_within(command, file)
        assert (unknown.returncode, "has an unknown format" in unknown.stdout + unknown.stderr) == (1, True)
    done = robochoc_within("validate", file, "--format", "tasks", "--json")
    assert json.loads(done.stdout)["format"] == "tasks"
    words = ["--format", "tasks", "--protocol", "dpop", "--runtime", "simulator", "--json"]
    assert json.loads(robochoc_within("solve", file, *words).stdout)["verdict"] == "optimal"
    wrong = robochoc_within("solve", file, "--format", "wcsp")
    assert (wrong.returncode, len(wrong.stderr.splitlines())) == (1, 1)


@pytest.mark.parametrize("command", ["solve", "validate", "export"])
def test_the_options_of_an_import_are_not_for_teams(command: str, problem: Path, tmp_path: Path) -> None:
    team = tmp_path / "team"
    assert robochoc_within("import", problem, "-o", team).returncode == 0
    done = robochoc_within(command, team, "--infinity", 5)
    assert done.returncode == 1
    assert f"{team}: is the folder of a team, and 'infinity' is for files of other tools" in done.stdout + done.stderr


DYNAMIC = """name: dynamic
objective: min
domains: {d: {values: [R, G]}}
variables: {_a: {domain: d}, _b: {domain: d}}
constraints: {differ: {type: intention, function: 2 if _a == _b else 1}}
agents: [r-1, r-2]
"""
SCENARIO = "events: [{id: leaves, actions: [{type: remove_agent, agent: r-2}]}]\n"


def test_epochs_of_an_imported_scenario_have_original_names(tmp_path: Path) -> None:
    files = [tmp_path / "dynamic.yaml", tmp_path / "scenario.yaml"]
    for file, text in zip(files, (DYNAMIC, SCENARIO), strict=True):
        file.write_text(text)
    team = tmp_path / "team"
    assert robochoc_within("import", *files, "-o", team).returncode == 0
    words = ["solve", team, "--protocol", "sfb", "--runtime", "simulator"]
    shown = robochoc_within(*words).stdout
    assert "1  -r-2            1  optimal" in shown
    assert "    r-1: _a = R\n" in shown
    told = json.loads(robochoc_within(*words, "--json").stdout)
    assert (told["assignment"], told["names"]["v_a"]) == ({"v_a": "R"}, "_a")
    solution = load(*files).solve("sfb", runtime="simulator")
    assert solution.values == {"_a": "R"}
    assert [(one.opened_by, *one.robots, *one.assignment) for one in solution.epochs] == [
        ("the start", "r-1", "r-2", "_a", "_b"),
        ("-r-2", "r-1", "_a"),
    ]
    assert "-r-2" in solution._repr_html_()
    for wrong, message in ((team, "is the folder of a team, and"), (tmp_path / "none.yaml", "none.yaml")):
        with pytest.raises(InvalidInputError, match=message):
            load(wrong, files[1])
    assert "import it together with the problem" in robochoc_within("solve", files[1]).stderr


def test_a_file_that_cannot_be_read_is_told_in_one_line(tmp_path: Path) -> None:
    with cases() as each:
        for command in ["solve", "validate", "export", "import"]:
            for content, message in [
                (PYDCOP.encode("utf-16"), "{file}: is not UTF-8: it looks like UTF-16 (save it in UTF-8)"),
                (PYDCOP.encode("utf-16-le"), "{file}: is not UTF-8: it looks like UTF-16 (save it in UTF-8)"),
                (PYDCOP.replace("pairs", "p\xe4rs").encode("latin-1"), "{file}: is not UTF-8 (save it in UTF-8)"),
                (
                    PYDCOP.replace("min", "Minimise").encode(),
                    "{file}:2: has the unknown objective 'Minimise' (write objective: min)",
                ),
                (b"print()\n", "{file}: has an unknown format ("),
            ]:
                with each((command, message)):
                    file = tmp_path / ("program.py" if content.startswith(b"print") else "pairs.yaml")
                    file.write_bytes(content)
                    done = robochoc_within(command, file, *(("-o", tmp_path / "team") if command == "import" else ()))
                    assert done.returncode == 1
                    assert message.format(file=file) in done.stdout + done.stderr


NETWORK = """{"problem": {"name": "b", "mustbe": "<8.0"}, "variables": {"x": 2, "y": 2, "z": 2}, "functions": {
  "f": {"scope": ["x", "y"], "costs": [3, 4.25, 3, 5]}, "g": {"scope": ["y", "z"], "costs": [4, 3, 2, 3]}}}"""


def test_what_would_be_another_problem_is_told_by_all_who_read_the_file(tmp_path: Path) -> None:
    file = tmp_path / "b.cfn"
    file.write_text(NETWORK)
    changed = (" truncated: costs are cut to 1 decimal place, those of mustbe", " bound: toulbar2 accepts only costs")
    for words in (["solve", file, "--runtime", "simulator"], ["validate", file]):
        done = robochoc_within(*words)
        assert done.returncode == 0
        told = done.stderr if words[0] == "solve" else done.stdout
        assert all(one in told for one in changed)
        assert "owner" not in told
    assert "owner: the format has no owners" in robochoc_within("import", file, "-o", tmp_path / "team").stdout
    told = json.loads(robochoc_within("validate", file, "--json").stdout)
    kinds = ["truncated", "bound", "owner"]
    assert [note["kind"] for note in told["notes"]] == kinds
    assert [kind for kind, _ in load(file).notes] == kinds
    assert json.loads(robochoc_within("solve", file, "--runtime", "simulator", "--json").stdout)["cost"] == 6.0


MAX_CSP = """<instance><presentation format="XDisCSP 1.0" type="DCOP"/>
  <agents><agent name="a"/><agent name="b"/></agents><domains><domain name="d">1..2</domain></domains>
  <variables><variable name="x" agent="a" domain="d"/><variable name="y" agent="b" domain="d"/></variables>
  <relations><relation name="r" arity="2" semantics="soft" defaultCost="3">3:1 1</relation></relations>
  <constraints initialCost="2" maximalCost="5"><constraint name="c" arity="2" scope="x y" reference="r"/>
  </constraints></instance>"""
ABOVE = """{"problem": {"name": "b", "mustbe": "BOUND"}, "variables": {"x": 2, "y": 2, "z": 2}, "functions": {
  "f": {"scope": ["x", "y"], "costs": [0, -4, -4, -4]}, "g": {"scope": ["y", "z"], "costs": [-4, -4, -4, 0]},
  "h": {"scope": ["x", "z"], "costs": [-4, -4, 0, -4]}}}"""
BELOW = ABOVE.replace("-4", "4")


@pytest.mark.parametrize(
    ("name", "text", "reached", "other", "words"),
    [
        ("a.cfn", ABOVE, ">-8", ">-9", "a cost of -8 is not above"),
        ("b.cfn", BELOW, "<8.0", "<8.1", "a cost of 8 is not below"),
        ("c.xml", MAX_CSP, 'initialCost="2"', 'initialCost="1"', "a cost of 5 is not below"),
    ],
    ids=["above", "below", "xdiscsp"],
)
def test_an_optimum_that_reaches_the_bound_of_the_file_is_told_so(
    name: str, text: str, reached: str, other: str, words: str, tmp_path: Path
) -> None:
    file = tmp_path / name
    file.write_text(text.replace("BOUND", reached))
    run = ("solve", file, "--protocol", "syncbb", "--runtime", "simulator")
    assert f"bound: {words} the file's bound: by the file this is not a solution" in robochoc_within(*run).stderr
    file.write_text(text.replace("BOUND", other).replace(reached, other))
    done = robochoc_within(*run)
    assert (done.returncode, "this is not a solution" in done.stderr) == (0, False)


def test_an_infinity_means_nothing_to_xcsp3_and_that_is_told(tmp_path: Path) -> None:
    file = tmp_path / "x.xml"
    file.write_text(
        '<instance format="XCSP3" type="COP"><variables><var id="x"> 2 3 </var></variables>'
        "<objectives><minimize> x </minimize></objectives></instance>"
    )
    done = robochoc_within("solve", file, "--infinity", 2, "--runtime", "simulator")
    assert "optimal solution for the robot, cost 2" in done.stdout
    assert f"{file}: infinity: --infinity has no effect: XCSP3 has hard constraints" in done.stderr


def test_orders_and_kills_may_use_original_names(tmp_path: Path) -> None:
    file, order = tmp_path / "dynamic.yaml", tmp_path / "order.txt"
    file.write_text(DYNAMIC)
    order.write_text("r-2\nr_1\n")
    words = ["solve", file, "--protocol", "dpop", "--explain", "--runtime"]
    assert "    r-2\n    └── r-1" in robochoc_within(*words, "simulator", "--order", order).stdout
    order.write_text("r-2\nr_2\nr-3\n")
    wrong = robochoc_within(*words, "simulator", "--order", order)
    assert "'r_2' is listed twice (list each robot once; it is in line 1 already)" in wrong.stderr
    assert "'r-3' is not a robot of dynamic (did you mean 'r-2'?)" in wrong.stderr
    assert "r-9" in robochoc_within(*words, "processes", "--kill", "r-9@1").stderr
    assert robochoc_within(*words, "processes", "--kill", "r-2@50").returncode == 0
    problem = load(file)
    solution = problem.solve("dpop", "simulator", order=["r-2", "r_1"], kill=[])
    assert [(name, node.parent) for name, node in sorted(solution.tree.items())] == [("r-1", "r-2"), ("r-2", None)]
    with pytest.raises(ValueError, match="no robot 'r-3'; did you mean"):
        problem.solve(order=["r-3"])


def test_a_robot_of_one_variable_of_its_name_is_listed_once(tmp_path: Path) -> None:
    file = tmp_path / "b.cfn"
    file.write_text(NETWORK)
    assert "\n    x = 0  y = 0  z = 1\n" in robochoc_within("solve", file, "--runtime", "simulator").stdout


def test_several_files_are_exported_to_named_ones_only(tmp_path: Path) -> None:
    team, exported = tmp_path / "team", tmp_path / "exported.yaml"
    for name, text in (("a.yaml", DYNAMIC), ("b.yaml", SCENARIO)):
        (tmp_path / name).write_text(text)
    assert robochoc_within("import", tmp_path / "a.yaml", tmp_path / "b.yaml", "-o", team).returncode == 0
    done = robochoc_within("export", team, "--format", "pydcop")
    assert (done.returncode, "problem and scenario are two files; name the first one: -o" in done.stderr) == (2, True)
    first, second = robochoc_within("export", team, "--format", "pydcop", "-o", exported).stdout.splitlines()
    assert first.endswith(" bytes, 2 variables")
    assert second.endswith(" bytes")
    assert robochoc_within("export", tmp_path / "a.yaml").stdout.endswith("</instance>\n")


def test_an_exported_problem_may_have_any_name(tmp_path: Path) -> None:
    file, exported = tmp_path / "pairs.yaml", tmp_path / "pairs.txt"
    file.write_text(PYDCOP)
    assert robochoc_within("export", file, "--format", "pydcop", "-o", exported).returncode == 0
    assert "this is pyDCOP's YAML" in robochoc_within("validate", exported).stdout
    assert robochoc_within("import", exported, "-o", tmp_path / "team").returncode == 0


def test_validate_says_what_a_file_is(problem: Path) -> None:
    done = robochoc_within("validate", problem)
    assert done.returncode == 0
    assert (
        "2 robots, 2 variables, 1 constraint: ok\n  this is FRODO's XCSP 2.1: 'robochoc solve' reads it" in done.stdout
    )
    told = json.loads(robochoc_within("validate", problem, "--json").stdout)
    assert (told["valid"], told["format"]) == (True, "frodo")
    folder = robochoc_within("validate", problem.parent)
    assert folder.returncode == 1
    assert f"is FRODO's XCSP 2.1, not a file of a robot (robochoc import {problem.parent} -o FOLDER)" in folder.stdout
    solved = robochoc_within("solve", problem.parent)
    assert "is FRODO's XCSP 2.1, not a file of a robot" in solved.stderr
    problem.rename(problem.with_suffix(".xcsp"))
    hidden = robochoc_within("solve", problem.parent)
    assert f"convert it to a team: robochoc import {problem.parent} -o FOLDER" in hidden.stderr
    assert "convert it to a team" in robochoc_within("validate", problem.parent).stdout
    wrong = problem.with_suffix(".xcsp")
    wrong.write_text(wrong.read_text().replace("3 1", "3 x"))
    assert "problem.xcsp:4: 'x' is not an integer" in robochoc_within("validate", wrong).stdout


@pytest.mark.parametrize("kind", WRITTEN)
def test_export_in_every_format(kind: str, four: Path) -> None:
    done = robochoc_within("export", four, "--format", kind)
    if f"this version cannot write {kind}" in done.stderr:
        pytest.skip(done.stderr)
    assert done.returncode == 0, done.stderr
    assert "V1.1" in done.stdout or kind == "wcsp"


def test_export_reports_differences_between_file_and_team(problem: Path, four: Path, tmp_path: Path) -> None:
    out = tmp_path / "team.xml"
    done = robochoc_within("export", problem, "--format", "frodo", "-o", out)
    assert "\n  scale: costs are integers, in units of 0.1:" in done.stdout
    printed = robochoc_within("export", problem, "--format", "frodo")
    assert printed.stdout == out.read_text()
    assert "  scale: costs are integers, in units of 0.1:" in printed.stderr
    kept = robochoc_within("export", four, "--format", "frodo", "--intension", "-o", out)
    assert "constraints in intension, which only FRODO's JaCoP parser reads" in kept.stdout
    wrong = robochoc_within("export", four, "--format", "cfn", "--intension")
    assert (wrong.returncode, "--intension requires --format frodo" in wrong.stderr) == (2, True)


def test_export_goes_to_a_file(problem: Path, tmp_path: Path) -> None:
    out = tmp_path / "team.dot"
    done = robochoc_within("export", problem, "--format", "dot", "-o", out)
    assert done.stdout == f"{out}: {out.stat().st_size:,} bytes, 2 variables\n"
    assert '"r_1" -- "r_2" [style=bold];' in out.read_text()
    refused = robochoc_within("export", problem, "--format", "xdiscsp")
    assert (refused.returncode, "integer costs of 0 or more, but c has 0.5" in refused.stderr) == (2, True)
