"""Command lines that nobody would write, on teams that change: options drawn at random, each epoch against brute force.

The run has an answer only where all events have happened: the answer to an earlier problem is none to the last one.
"""

from __future__ import annotations

import json
from collections import Counter
from fractions import Fraction
from pathlib import Path
from random import Random
from typing import Any

import pytest

from robochoc.formats.folder import write_team
from robochoc.model.problem import Team
from robochoc.run.registry import protocol_names
from tests.support.changing_costs import changing_cost_team
from tests.support.command_line_answers import Truth, check_improvements, check_journal
from tests.support.limits import HANG_S
from tests.support.problems import with_unique_definitions
from tests.support.program import robochoc_within
from tests.support.random_changes import random_changing_team, stages
from tests.support.random_command_lines import ORDERS, assert_refused, by_the_time, endless, some

TEAMS = (random_changing_team, random_changing_team, changing_cost_team)


def command_line(runtime: str, folder: Path, chance: Random) -> list[str]:
    words = ["--runtime", runtime, *some(chance, 0.8, "--protocol", "auto", "dynabt", "dynabt", *protocol_names())]
    words += some(chance, 0.3, "--order", *ORDERS)
    words += some(chance, 0.3, "--seed", 0, 7)
    words += some(chance, 0.2, "--preprocess", "ac")
    words += some(chance, 0.2, "--message-loss", 0, 0.05, 0.5)
    words += by_the_time(chance, 0.3, 0.001, 0.05, 5) or ["--timeout", str(HANG_S)]
    words += endless(chance, words)
    words += some(chance, 0.2, "--messages", 1, 50, 200)
    words += some(chance, 0.3, "--journal", folder / "run.journal")
    words += [f"--withdraw={chance.choice(('minimum', 'maximal'))}"] if chance.random() < 0.15 else []
    words += ["--verify"] if chance.random() < 0.05 else []
    if runtime == "simulator":
        words += some(chance, 0.3, "--schedule", "concurrent", "one-by-one", "cycles", "random")
        words += some(chance, 0.2, "--delay", 0, 20, 300)
    return [*words, "--json", "--no-cache"]


SLOW = [pytest.param(*one, marks=pytest.mark.slow) for one in (("simulator", 400), ("processes", 40))]


@pytest.mark.parametrize(("runtime", "many"), [("simulator", 20), *SLOW])
def test_each_epoch_is_right_and_the_last_one_counts(runtime: str, many: int, tmp_path: Path) -> None:
    seen: Counter[str] = Counter()
    for number in range(many):
        chance = Random(f"changes {runtime} {number}")
        team = with_unique_definitions(chance.choice(TEAMS)(chance, chance.choice((2, 5, 10))))
        write_team(team, tmp_path / "team", replace=True)
        words = command_line(runtime, tmp_path, chance)
        done = robochoc_within("solve", tmp_path / "team", *words)
        what = f"{number}: {' '.join(words)}\n{done.stdout}{done.stderr}"
        if done.returncode == 2:
            assert_refused(done, what)
        else:
            found = json.loads(done.stdout)
            assert done.returncode == (3 if found["verdict"] == "unknown" else 0), what
            check(team, found, words, what)
            seen[found["verdict"]] += 1
        check_journal(tmp_path / "run.journal", words, what)
    assert {*seen} >= {"solution", "no-solution", "unknown"}


def check(team: Team, found: dict[str, Any], words: list[str], what: str) -> None:
    every = list(stages(team))
    if found["verdict"] == "unknown":
        assert found["reason"], what
    else:
        assert len(found["epochs"]) in {0, len(every)}, what
    for now, epoch in zip(every, found["epochs"], strict=False):
        truth = Truth(now)
        best = truth.best()
        check_improvements(truth, epoch, words, what)
        if epoch["verdict"] not in {"unknown", "no-solution"}:
            cost = Fraction(str(epoch["cost"]))
            assert epoch["verified"], what
            assert truth.paid(epoch["assignment"]) == cost, what
            assert best is not None, what
            assert cost == best if epoch["verdict"] == "optimal" else cost >= best, what
        assert epoch["verdict"] != "no-solution" or best is None, what
