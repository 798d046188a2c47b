"""The command line as a user meets it: what it prints, what it writes, and its exit status."""

from __future__ import annotations

import itertools
import json
import re
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest
from click import Context

from robochoc.cli.group import COMMANDS, cli
from robochoc.formats import read_team, write_team
from robochoc.generators.queens3d import queens3d
from robochoc.model.problem import Constraint, ConstraintModel, Relation, Robot, Semantics
from tests.support.broken_costs import COSTS
from tests.support.broken_files import FILES, SCHEMA, WELL_FORMED
from tests.support.broken_robots import CONSTRAINTS, DEFINITIONS, DOMAINS
from tests.support.broken_scenarios import CHANGES
from tests.support.broken_teams import MANY, NEIGHBOURS, SCENARIOS
from tests.support.cases import cases
from tests.support.problems import team_of
from tests.support.program import ROOT, on_a_terminal, robochoc, robochoc_within, unmeasured

RESULT_KEYS = {
    "team", "protocol", "runtime", "seed", "verdict", "assignment", "cost", "withdrawn", "epochs", "metrics",
    "verified", "order", "chosen",
}  # fmt: skip
METRIC_KEYS = {"messages", "bytes", "largest", "ncccs", "checks", "wall_s"}


# generate


def test_generate_writes_where_it_says(tmp_path: Path) -> None:
    done = robochoc_within("generate", "queens3d", "--n", 3, folder=tmp_path)
    assert done.returncode == 0
    assert sorted(path.name for path in (tmp_path / "instances" / "queens3d-3").iterdir())[:2] == [
        "Robot1.1.xml",
        "Robot1.2.xml",
    ]
    assert read_team(tmp_path / "instances" / "queens3d-3") == queens3d(3)


def test_generate_does_not_overwrite_unless_forced(four: Path) -> None:
    again = ("generate", "queens3d", "--n", 3, "-o", four)
    done = robochoc_within(*again)
    assert done.returncode == 1
    assert "--force" in done.stderr
    assert len(list(four.iterdir())) == 16
    assert robochoc_within(*again, "--force").returncode == 0
    assert len(list(four.iterdir())) == 9
    assert [path.name for path in four.parent.iterdir()] == [four.name]


def test_force_does_not_replace_a_folder_that_is_no_team(tmp_path: Path) -> None:
    (tmp_path / "home").mkdir()
    (tmp_path / "home" / "thesis.tex").write_text("years of work")
    done = robochoc_within("generate", "queens3d", "--n", 3, "-o", tmp_path / "home", "--force")
    assert done.returncode == 1
    assert "thesis.tex" in done.stderr
    assert (tmp_path / "home" / "thesis.tex").exists()


def test_generate_refuses_absurd_sizes_as_wrong_usage(tmp_path: Path) -> None:
    for n in ["0", "65", "four", "-1"]:
        assert robochoc_within("generate", "queens3d", "--n", n, folder=tmp_path).returncode == 2


# validate


def test_validate_says_one_line_a_team(four: Path) -> None:
    done = robochoc_within("validate", folder=ROOT)
    assert done.returncode == 0
    assert done.stdout.splitlines() == [
        "instances/queens3d-4: 16 robots, 16 variables, 76 constraints: ok",
        "instances/queens3d-7: 49 robots, 49 variables, 476 constraints: ok",
    ]
    assert robochoc_within("validate", four / "Robot1.1.xml").stdout.endswith(": ok by itself\n")


def test_validate_tells_every_mistake_of_every_file(four: Path) -> None:
    for name, old, new in (
        ("Robot1.1.xml", 'nbValues="4"', 'nbValues="5"'),
        ("Robot3.1.xml", 'reference="neq"', 'reference="nope"'),
        ("Robot4.4.xml", "</instance>", ""),
    ):
        path = four / name
        path.write_text(path.read_text().replace(old, new))
    done = robochoc_within("validate", four)
    assert done.returncode == 1
    assert "queens3d-4: 4 errors" in done.stdout
    for name in ("Robot1.1.xml:5:", "Robot3.1.xml:", "Robot4.4.xml:"):
        assert name in done.stdout
    assert robochoc_within("solve", four).returncode == 1


def test_validate_json(four: Path) -> None:
    good = json.loads(robochoc_within("validate", four, "--json").stdout)
    sizes = {"robots": 16, "variables": 16, "constraints": 76, "events": 0}
    assert good == {"path": str(four), "valid": True, **sizes, "errors": []}
    (four / "Robot1.1.xml").unlink()
    bad = json.loads(robochoc_within("validate", four, "--json").stdout)
    assert bad["valid"] is False
    assert all({"file", "line", "message", "hint"} <= error.keys() for error in bad["errors"])


def test_an_empty_place_says_what_to_do(tmp_path: Path) -> None:
    for command in ("validate", "solve"):
        done = robochoc_within(command, tmp_path)
        assert done.returncode == 1
        assert "robochoc generate queens3d --n 4" in done.stdout + done.stderr


@pytest.mark.parametrize("program", [robochoc_within, pytest.param(robochoc, marks=pytest.mark.slow)])
def test_broken_input_is_status_1_and_one_clear_message(
    program: Callable[..., subprocess.CompletedProcess[str]], tmp_path: Path
) -> None:
    """Try one case of each kind of input; `tests/unit/formats/test_bad_input.py` tries all."""
    kinds = (FILES, WELL_FORMED, SCHEMA, DOMAINS, DEFINITIONS, CONSTRAINTS, COSTS, NEIGHBOURS, SCENARIOS, CHANGES, MANY)
    with cases() as each:
        for case, command in itertools.product([kind[-1] for kind in kinds], ["validate", "solve"]):
            folder = tmp_path / f"{case} {command}"
            with each((case, command)):
                case.write(folder)
                done = program(command, folder / case.target)
                assert done.returncode == 1
                told = done.stdout.splitlines()[1:] if command == "validate" else done.stderr.splitlines()
                assert len(told) == len(case.expected(folder))
                assert done.stdout == "" or command == "validate"


# solve


@pytest.mark.parametrize("runtime", ["simulator", pytest.param("processes", marks=pytest.mark.more)])
def test_solve_json_is_the_contract(runtime: str) -> None:
    done = robochoc_within("solve", "instances/", "--json", "--runtime", runtime, folder=ROOT)
    assert done.returncode == 0
    assert done.stderr == ""
    four, seven = map(json.loads, done.stdout.splitlines())
    assert four.keys() == seven.keys() | {"witness"} == RESULT_KEYS | {"witness"}
    assert four["metrics"].keys() >= METRIC_KEYS
    assert (four["team"], four["verdict"], four["assignment"], four["cost"]) == ("queens3d-4", "no-solution", {}, None)
    assert (seven["team"], seven["verdict"], seven["cost"], seven["verified"]) == ("queens3d-7", "solution", 0, True)
    assert len(seven["assignment"]) == 49
    assert sum(seven["metrics"]["messages_by_type"].values()) == seven["metrics"]["messages"]


@pytest.mark.parametrize(
    ("words", "verdict", "placed_by"),
    [
        (["--withdraw"], "optimal", "sfb"),
        (["--withdraw", "minimum"], "optimal", "sfb"),
        (["--withdraw", "maximal"], "solution", "first-fit"),
        (["--withdraw=maximal"], "solution", "first-fit"),
    ],
)
def test_withdraw_may_stand_alone_even_before_the_path(
    four: Path, words: list[str], verdict: str, placed_by: str
) -> None:
    done = robochoc_within("solve", *words, four, "--protocol", "abt", "--json", "--runtime", "simulator")
    assert done.returncode == 0, done.stderr
    result = json.loads(done.stdout)
    assert (result["verdict"], result["verified"]) == (verdict, True)
    assert (result["protocol"], result["placed_by"]) == ("abt", placed_by)
    assert len(result["withdrawn"]) == {"optimal": 6, "solution": 7}[verdict]
    assert len(result["assignment"]) == 16 - len(result["withdrawn"])


def test_solve_tells_people_what_happened(four: Path) -> None:
    words = robochoc_within("solve", four, "--withdraw", "--runtime", "simulator", "--protocol", "abt").stdout
    assert "no solution for the whole team (Robot" in words
    assert "has ruled everything out" in words
    assert "queens3d-4: 10 of 16 fly (proven maximum); " in words
    assert "6 withdrawn:" in words
    assert "abt, then sfb, simulator, seed 0: " in words
    assert re.search(r"row\\column +1 +2 +3 +4", words)


def test_a_seed_repeats_a_run(four: Path) -> None:
    first, again, other = (
        json.loads(
            robochoc_within(
                "solve", four, "--json", "--protocol", "abt", *("--runtime", "simulator", "--seed", seed)
            ).stdout
        )
        for seed in (1, 1, 2)
    )
    for result in (first, again, other):
        del result["metrics"]["wall_s"]
    assert first == again
    assert first["metrics"] != other["metrics"]


@pytest.mark.parametrize("runtime", ["simulator", pytest.param("processes", marks=pytest.mark.more)])
def test_a_limit_is_status_3(tmp_path: Path, runtime: str) -> None:
    write_team(queens3d(10), tmp_path / "ten")
    done = robochoc_within(
        "solve", tmp_path / "ten", *("--protocol", "abt", "--timeout", "0.3", "--json", "--runtime", runtime)
    )
    assert done.returncode == 3
    assert json.loads(done.stdout)["verdict"] == "unknown"


def test_a_process_ends_with_the_status_of_its_command(four: Path) -> None:
    """Most tests run commands within their own process; those that end with 4, and by signals, are elsewhere."""
    for status, words in (
        (0, ("solve", four, "--runtime", "simulator")),
        (1, ("validate", four.parent / "nowhere")),
        (2, ("solve", four, "--nonsense")),
        (3, ("compile", "--local-solutions", 1, four)),
    ):
        done, within = robochoc(*words), robochoc_within(*words)
        assert done.returncode == within.returncode == status
        assert seconds_apart(done.stdout) == seconds_apart(within.stdout)
        assert done.stderr.splitlines()[-1:] == within.stderr.splitlines()[-1:]


def seconds_apart(text: str) -> str:
    return re.sub(r"[\d.]+ (?=m?s\b)", "some ", text)


def test_a_command_that_there_is_not_is_status_2() -> None:
    for word, said in (
        ("sovle", "No such command 'sovle'. Did you mean 'solve'?"),
        ("xyzzy", "No such command 'xyzzy'."),
    ):
        done = robochoc_within(word)
        assert (done.returncode, done.stderr.splitlines()[-1]) == (2, f"Error: {said}")


def test_what_this_version_cannot_solve_is_said_in_one_sentence(tmp_path: Path) -> None:
    differ = Relation("R", 2, Semantics.CONFLICTS, ((1, 1),))
    part = Constraint("C", differ, ("A", "B"), ("A", "B"), model=ConstraintModel.PKC)
    write_team(team_of({"A": (1, 2), "B": (1, 2)}, [part]), tmp_path / "private")
    done = robochoc_within("solve", tmp_path / "private", "--withdraw", "maximal")
    assert done.returncode == 2
    assert "PKC" in done.stderr
    assert len(done.stderr.splitlines()) == 1


def test_complex_robots_are_solved_alike_by_abt_and_the_judge() -> None:
    for words in ([], ["--runtime", "simulator"], ["--protocol", "central"]):
        done = robochoc_within("solve", ROOT / "tests" / "data" / "complex", "--json", *words)
        result = json.loads(done.stdout)
        assert (result["verdict"], result["verified"], result["cost"]) == ("solution", True, 0), done.stderr
        assert len(result["assignment"]) == 5


def test_the_example_of_the_documentation_is_solved(tmp_path: Path) -> None:
    done = robochoc_within("solve", ROOT / "docs" / "examples" / "scouts", "--html", tmp_path / "page.html")
    assert done.returncode == 0
    assert "Relay: V2 = " in done.stdout
    assert (ROOT / "docs" / "examples" / "scouts" / "Relay.xml").read_text() in (
        ROOT / "docs" / "reference" / "format.md"
    ).read_text()


def test_the_jchoc_originals_get_a_verdict_distributed_and_central() -> None:
    originals = ROOT.parent / "shared" / "data" / "jchoc"
    if not originals.is_dir():
        pytest.skip("the original files are not part of this repository")
    assert "3 robots, 12 variables" in robochoc_within("validate", originals).stdout
    assert not any(solutions_of_robot(robot) for robot in read_team(originals).robots)
    for words in (["--runtime", "simulator"], ["--protocol", "central"]):
        result = json.loads(robochoc_within("solve", originals, "--json", *words).stdout)
        assert result["verdict"] == "no-solution", words
    assert "A1 alone has none" in robochoc_within("solve", originals).stdout


def solutions_of_robot(robot: Robot) -> bool:
    names = [variable.name for variable in robot.variables]
    every = itertools.product(*(variable.domain for variable in robot.variables))
    locals_ = (dict(zip(names, values, strict=True)) for values in every)
    return any(all(constraint.allows(local) for constraint in robot.private) for local in locals_)


def test_progress_is_shown_on_a_terminal_only(four: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    words = ("solve", four, "--runtime", "simulator")
    assert b"queens3d-4: compiling Robot1.1 (1 of 16), " in on_a_terminal(*words)
    monkeypatch.setattr("robochoc.cli.reports.progress.REFRESH_S", 0)  # what would be shown, were it slower
    assert robochoc_within(*words).stderr == ""
    shown = robochoc_within(*words, terminal=True).stderr
    assert "queens3d-4: compiling Robot4.4 (16 of 16), " in shown
    assert re.search("queens3d-4: [1-9][0-9,]* messages, ", shown)


# the whole


def test_every_command_has_help_and_is_in_the_docs() -> None:
    pages = "".join(page.read_text() for page in (ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md"))))
    for name in COMMANDS:
        command = cli.get_command(Context(cli), name)
        assert command
        assert command.help, name
        assert f"robochoc {name}" in pages, name
    assert robochoc_within("--help").returncode == 0


def test_the_help_of_commands_imports_nothing_heavy() -> None:
    code = (
        "import sys; from click import Context; from robochoc.cli.group import COMMANDS, cli\n"
        "for name in COMMANDS: cli.get_command(Context(cli), name).get_help(Context(cli))\n"
        "print(*sys.modules)"
    )
    command = [sys.executable, "-c", code]
    done = subprocess.run(command, capture_output=True, text=True, check=True, env=unmeasured())
    modules = done.stdout.split()
    assert {f"robochoc.cli.commands.{name}" for name in COMMANDS} <= {*modules}
    heavy = {"numpy", "meshcat", "lxml", "msgspec", "multiprocessing", "tornado", "pycsp3", "zenoh"}
    assert not heavy & set(modules)


def test_options_of_pydcop_are_answered_by_ours() -> None:
    for theirs, ours in (("--algo", "--protocol"), ("--algo_params", "--set"), ("--mode", "--runtime")):
        done = robochoc_within("solve", "instances/queens3d-3", theirs, "dsa")
        assert done.returncode == 2
        assert f"No such option '{theirs}': instead of this option of pyDCOP, use {ours}." in done.stderr
    for command, text in (
        (["batch", "f.yaml"], "No such command 'batch', which pyDCOP has; use robochoc experiment run instead."),
        (["distribute", "f.yaml"], "which pyDCOP has; there is no counterpart: a robot owns its variables."),
        (["solve", "instances/queens3d-4", "--protocol", "DSA-tuto"], "instead of this algorithm of pyDCOP, use dsa"),
        (
            ["solve", "instances/queens3d-4", "--protocol", "dsa", "--set", "stop_cycle=9"],
            "--set: instead of pyDCOP's stop_cycle, set cycles",
        ),
    ):
        done = robochoc_within(*command)
        assert done.returncode == 2
        assert text in done.stderr
    done = robochoc_within("solve", "instances/queens3d-3", "--protocoll", "dsa")
    assert "Did you mean '--protocol'?" in done.stderr
