"""Command lines that nobody would write: options drawn at random, on random teams.

None ends in a traceback, the status is what docs/reference/cli.md says, a refusal is one line, and a verdict is brute
force's, whatever the options are.
"""

from __future__ import annotations

import json
from collections import Counter
from pathlib import Path
from random import Random
from typing import Any

from robochoc.formats.folder import write_team
from robochoc.model.problem import INFINITE, ProblemKind, Team
from robochoc.run.registry import protocol_named, protocol_names
from tests.support.cost_problems import minimum_withdrawal
from tests.support.examples import count
from tests.support.loose_problems import minimum_cost
from tests.support.problems import with_unique_definitions
from tests.support.program import robochoc_within
from tests.support.random_command_lines import ORDERS, TEAMS, assert_refused, some

AS_ARRAYS = [name for name in protocol_names() if protocol_named(name).traits.arrays]
SEEDS = (0, 7, 2**32, 2**63, 2**64 - 1)
SETTINGS = ("cycles=3", "cycles=", "variant=B", "damping=0.5", "preference=inf", "memory=1", "none=1", "=3")


def command_line(folder: Path, chance: Random) -> list[str]:
    runtime = chance.choice(("simulator", "simulator", "arrays"))
    protocols = (*protocol_names(), "auto") if runtime == "simulator" or chance.random() < 0.2 else AS_ARRAYS
    words = ["--runtime", runtime, *some(chance, 0.6, "--protocol", *protocols)]
    words += some(chance, 0.5, "--order", *ORDERS)
    words += some(chance, 0.5, "--seed", *SEEDS)
    words += some(chance, 0.1, "--timeout", "0.0001", "0.01", "1e300")
    words += some(chance, 0.15, "--messages", 1, 10, 100, 10**30)
    words += some(chance, 0.15, "--ncccs", 1, 10, 10**30)
    words += some(chance, 0.3, "--schedule", "concurrent", "one-by-one", "cycles", "random")
    words += some(chance, 0.1, "--cycles", 1, 100)
    words += some(chance, 0.15, "--delay", 0, 20, 300)
    words += some(chance, 0.05, "--channel", "wlan", "wwan")
    words += some(chance, 0.08, "--set", *SETTINGS)
    words += some(chance, 0.05, "--spare", 1)
    words += some(chance, 0.15, "--preprocess", "ac")
    words += some(chance, 0.15, "--message-loss", 0, 0.05, 0.5)
    words += some(chance, 0.1, "--deadline", 0.0001, 0.05, 5)
    words += ["--verify"] if chance.random() < 0.1 else []
    words += some(chance, 0.08, "--local-solutions", 1, 5)
    words += some(chance, 0.08, "--journal", folder / "run.journal")
    words += [f"--withdraw={chance.choice(('minimum', 'maximal'))}"] if chance.random() < 0.15 else []
    return [*words, "--explain"] if chance.random() < 0.1 else [*words, "--json"]


@count("many", 30, 2000)
def test_no_command_line_ends_in_a_traceback_or_a_wrong_verdict(many: int, tmp_path: Path) -> None:
    seen: Counter[int] = Counter()
    for number in range(many):
        chance = Random(f"command lines {number}")
        team = with_unique_definitions(TEAMS[chance.choice(sorted(TEAMS))](chance))
        write_team(team, tmp_path / "team", replace=True)
        words = command_line(tmp_path, chance)
        done = robochoc_within("solve", tmp_path / "team", *words, "--no-cache")
        what = f"{number}: {' '.join(words)}\n{done.stdout}{done.stderr}"
        seen[done.returncode] += 1
        if done.returncode == 2:
            assert_refused(done, what)
        else:
            assert done.returncode in {0, 3}, what
            if "--json" in words:
                check_verdict(team, json.loads(done.stdout), words, what)
                assert (done.returncode == 3) is (json.loads(done.stdout)["verdict"] == "unknown"), what
    assert {0, 2} <= {*seen}


def check_verdict(team: Team, found: dict[str, Any], words: list[str], what: str) -> None:
    verdict, cost = found["verdict"], found["cost"]
    if verdict == "unknown":
        assert found["reason"], what
    elif "--withdraw=minimum" in words:
        weights = {robot.name: robot.weight for robot in team.robots}
        withdrawn, least = sum(weights[name] for name in found["withdrawn"]), minimum_withdrawal(team)
        assert withdrawn == least or (withdrawn > least and found.get("deadline") is not None), what
    elif "--withdraw=maximal" not in words:
        truth = minimum_cost(team)
        assert (verdict == "no-solution") is (truth == INFINITE), what
        assert verdict == "no-solution" or cost >= truth, what
        assert verdict != "optimal" or (cost == truth and team.kind is ProblemKind.DISWCSP), what
    assert verdict in {"unknown", "no-solution"} or found["verified"], what
    if "--protocol" not in words or "auto" in words:
        assert found["chosen"]["protocol"], what
