"""Problem classes and commands: each is supported or refused, as the table in docs/reference/known-limits.md says."""

from __future__ import annotations

import json
import shutil
from decimal import Decimal
from pathlib import Path

import pytest

from robochoc.formats import write_team
from robochoc.generators.random_csp import random_csp
from robochoc.model.assembly import assemble
from robochoc.model.constraint import Domain, Variable
from robochoc.model.cost_units import CostUnits
from robochoc.model.expression.fixed_point import VALUE_PLACES
from robochoc.model.problem import ProblemKind, Team
from robochoc.model.real import RealInterval, grid
from robochoc.run import Options, solve
from tests.support.cases import cases
from tests.support.program import ROOT, robochoc_within
from tests.support.real_teams import PLACES, best_cost, real_constraint

PAGE = ROOT / "docs" / "reference" / "known-limits.md"
EXAMPLES = ROOT / "docs" / "examples"
CLASSES = ("random variables", "real variables", "several objectives", "`pc-syncbb`", "`p-dsa`")
"""Problem classes, and protocols that hide secrets from coalitions, which solve a small problem with costs."""
NAMED = dict(zip(CLASSES, ("random variables", "real", "objectives", "pc-syncbb", "p-dsa"), strict=True))
"""Words in each refusal, which name the problem class or the protocol."""
OPTIONS = {
    "`solve --runtime simulator`": "--runtime simulator --journal run.journal",
    "`solve --runtime processes`": "--runtime processes",
    "`solve --runtime network`": "--runtime network",
    "`solve --runtime arrays`": "--runtime arrays --seed 1",
    "`solve --protocol central`": "--protocol central",
    "`solve --protocol dpop`": "--runtime simulator --protocol dpop",
    "`solve --protocol dsa`": "--runtime simulator --protocol dsa",
    "`solve --withdraw`": "--runtime simulator --withdraw",
    "`solve --on-loss withdraw`": "--runtime processes --on-loss withdraw",
    "`solve --deadline`": "--runtime simulator --deadline 600",
    "`solve --message-loss`": "--runtime simulator --message-loss 0.1",
    "`solve --verify`": "--runtime simulator --verify",
    "`solve --html`": "--runtime simulator --html page.html",
    "`solve --situation flight`": "--runtime simulator --situation flight",
}
OK, USAGE, UNKNOWN = 0, 2, 3
STATUSES = {"supported": OK, "refused": USAGE, "unknown": UNKNOWN}
"""The exit statuses of the words in the table."""
EXPORTS = ("xcsp3", "cfn", "pydcop", "frodo", "graphml")
COMMANDS = {
    "`validate`": "validate team",
    **{command: f"solve team --json {options}" for command, options in OPTIONS.items()},
    "`replay`, `privacy`, `journal show`, `journal export`, `animate`": "replay run.journal;privacy run.journal;"
    "journal show run.journal;journal export run.journal --format words;animate run.journal --html scene.html",
    "`check`": "check {protocol} team --states 100",
    "`compile`": "compile team",
    "`compare`": "compare team --protocols {protocol} --jobs 1",
    "`experiment run`": "experiment run study.toml --jobs 1",
    "`capacity`": "capacity team team --runtime simulator --deadline 600 --timeout 600",
    "`play`": "play team --rounds 2 --json",
    "`export --format xcsp3`, `cfn`, `pydcop`, `frodo`, `graphml`": ";".join(
        f"export team --format {kind} -o team.{kind}" for kind in EXPORTS
    ),
    "`generate scenario`": "generate scenario team --events 1 -o changing",
    "`solve` with a scenario": "solve changing --json --runtime simulator",
}
"""The command lines of each row of the table. All lines of a row have the same result."""


def table() -> dict[str, dict[str, str]]:
    """Return the cells of the table in the documentation, by command and problem class."""
    section = PAGE.read_text().split("## Problem classes and commands")[1].split("\n## ")[0]
    rows = [[cell.strip() for cell in line.strip("|").split(" | ")] for line in section.splitlines() if line[:1] == "|"]
    head, _, *body = rows
    return {command: dict(zip(head[1:], cells, strict=True)) for command, *cells in body}


def real_team() -> Team:
    """Return a team of two robots with real variables."""
    names = ("x1", "x2")
    domain = Domain("D", grid(0, 10, 3), real=RealInterval(0, 10, PLACES))
    owned = {f"R{name}": [Variable(name, domain)] for name in names}
    constraints = [real_constraint("s", "sqr(X - 0.3)", names[:1]), real_constraint("p", "abs(X - Y + 0.2)", names)]
    costs = CostUnits(places=VALUE_PLACES)
    return assemble("team", owned, constraints, kind=ProblemKind.DISWCSP, costs=costs)


def write_example(problem_class: str) -> Decimal:
    """Write a team of this class to the folder `team`, and return its least cost, or that in its first objective."""
    if problem_class == "real variables":
        team = real_team()
        write_team(team, Path("team"))
        found = best_cost(team)
        assert found is not None
        return found
    if problem_class in CLASSES[3:]:
        team = random_csp(3, 2, 1, 0, max_cost=5, seed=1)
        write_team(team, Path("team"))
        return Decimal(solve(team, Options(protocol="central")).cost or 0)
    name, cost = {"random variables": ("gusts", "7.5"), "several objectives": ("survey", "11")}[problem_class]
    shutil.copytree(EXAMPLES / name, "team")
    return Decimal(cost)


def completed(line: str, problem_class: str) -> str:
    """Return a command line of the table with the protocol of the problem class."""
    own = NAMED[problem_class] if problem_class in CLASSES[3:] else ""
    command, _ = line.split(maxsplit=1)
    protocol = own or {"check": "mgm", "compare": "auto"}.get(command, "")
    if own and command in {"solve", "capacity"}:
        line += f" --protocol {own}"
    if own == "p-dsa" and command in {"solve", "compare"}:
        line += " --set cycles=3"
    return line.format(protocol=protocol) + " --set cycles=1" * (command == "check" and protocol in {"mgm", "p-dsa"})


def check_supported(line: str, output: str, least: Decimal) -> None:
    """Check the output of a command: results are checked, and proven costs are the least; exported files are read."""
    if line.startswith("solve"):
        result = json.loads(output, parse_float=Decimal)
        assert result["verified"]
        assert line.startswith("solve changing") or result["cost"] >= least
        if result["verdict"] == "optimal" and "changing" not in line:
            assert result["cost"] == least
        assert not any(name in line for name in ("dpop", "pc-syncbb")) or result["verdict"] == "optimal"
    if line.startswith("export") and "graphml" not in line:
        kind = line.rpartition(".")[2]
        read = robochoc_within("import", f"team.{kind}", "--format", kind, "-o", f"from-{kind}")
        assert read.returncode == 0, read.stderr
    if line.startswith("compare"):
        assert "refused" not in output


def test_the_table_has_all_commands_and_classes() -> None:
    assert list(table()) == list(COMMANDS)
    assert all(tuple(cells) == CLASSES for cells in table().values())
    assert {cell for cells in table().values() for cell in cells.values()} == {*STATUSES, "-"}


@pytest.mark.more
@pytest.mark.usefixtures("in_a_folder")
@pytest.mark.parametrize("problem_class", CLASSES)
def test_each_command_supports_the_problem_class_or_refuses_it(problem_class: str) -> None:
    least = write_example(problem_class)
    runs = f'protocol = "{NAMED[problem_class] if problem_class in CLASSES[3:] else "auto"}"'
    runs += "\nsettings = { cycles = 3 }" * ("p-dsa" in runs)
    Path("study.toml").write_text(f'record = ["cost-over-time"]\n[problems]\npath = "team"\n[runs]\n{runs}\n')
    with cases() as each:
        for command, cells in table().items():
            lines = COMMANDS[command].split(";") if cells[problem_class] != "-" else ()
            for line in [completed(line, problem_class) for line in lines]:
                with each(line):
                    done = robochoc_within(*line.split())
                    expected = STATUSES[cells[problem_class]]
                    is_cut = line.startswith("check") and done.returncode == UNKNOWN  # at --states
                    assert is_cut or done.returncode == expected, done.stderr
                    if expected != OK:
                        assert expected == UNKNOWN or not done.stdout
                        assert len(done.stderr.strip().splitlines()) == 1
                        assert NAMED[problem_class] in done.stderr
                    else:
                        check_supported(line, done.stdout, least)
