"""Robots that die under options that are seldom combined, on random teams: the verdict is brute force's for the others.

None ends in a traceback or in silence: who is lost is told, and only where nothing was said of losses the run fails.
"""

from __future__ import annotations

import json
import sys
from collections import Counter
from pathlib import Path
from random import Random
from subprocess import CompletedProcess

import pytest

from robochoc.formats.folder import write_team
from robochoc.model.problem import Team
from robochoc.run.registry import protocol_names
from tests.support.command_line_answers import check_answer, check_journal
from tests.support.examples import count
from tests.support.limits import HANG_S
from tests.support.program import robochoc_within
from tests.support.random_command_lines import ORDERS, any_team, assert_refused, by_the_time, endless, some

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="robots are killed")
AT_S = (0, 0, 0.001, 0.01, 0.05)


def losses(team: Team, chance: Random) -> list[str]:
    """Which robots are killed, and when: none to two of them."""
    names = [robot.name for robot in team.robots]
    return [f"{chance.choice(names)}@{chance.choice(AT_S)}" for _ in range(chance.choice((0, 1, 1, 1, 2)))]


def command_line(runtime: str, folder: Path, killed: list[str], chance: Random) -> list[str]:
    words = ["--runtime", runtime, *some(chance, 0.5, "--protocol", "auto", *protocol_names())]
    words += by_the_time(chance, 0.3, 0.01, 0.5, 5) or ["--timeout", str(HANG_S)]
    words += endless(chance, words)
    words += some(chance, 0.4, "--order", *ORDERS)
    for one in killed:
        words += ["--kill", one]
    words += some(chance, 0.8, "--on-loss", "withdraw", "withdraw", "withdraw", "fail")
    words += ["--spare"] if chance.random() < 0.15 else []
    words += [f"--withdraw={chance.choice(('minimum', 'maximal'))}"] if chance.random() < 0.2 else []
    words += some(chance, 0.1, "--messages", 5, 100)
    words += ["--verify"] if chance.random() < 0.1 else []
    words += some(chance, 0.15, "--preprocess", "ac")
    words += some(chance, 0.1, "--message-loss", 0.05, 0.5)
    words += some(chance, 0.1, "--patience", 5, HANG_S)
    words += some(chance, 0.15 if runtime == "network" else 0.02, "--filter", "signed", "sealed")
    words += some(chance, 0.3, "--journal", folder / "run.journal")
    return [*words, *some(chance, 0.3, "--seed", 0, 7), "--json", "--no-cache"]


def check(team: Team, words: list[str], done: CompletedProcess[str], what: str) -> None:
    """Hold an answer to the truth about those who are left."""
    found = json.loads(done.stdout)
    if found["verdict"] == "unknown":
        limits = {"--messages", "--message-loss", "--deadline"} & {*words}
        assert limits or "has come to its end" in found["reason"], what
    check_answer(team, found, words, what)


def may_fail(team: Team, words: list[str], killed: list[str]) -> bool:
    """Whether the run may end with status 4: for a loss that is no withdrawal, or as nobody is left."""
    survives = ("withdraw" in words or "--spare" in words) and "fail" not in words
    return bool(killed) and (not survives or {one.split("@")[0] for one in killed} >= {*team.order})


@pytest.mark.parametrize("runtime", ["processes", pytest.param("network", marks=pytest.mark.slow)])
@count("many", 8, 300)
def test_whoever_is_lost_the_others_are_right(runtime: str, many: int, tmp_path: Path) -> None:
    seen: Counter[int] = Counter()
    for number in range(many):
        chance = Random(f"losses {number}")
        team = any_team(chance)
        write_team(team, tmp_path / "team", replace=True)
        killed = losses(team, chance)
        words = command_line(runtime, tmp_path, killed, chance)
        done = robochoc_within("solve", tmp_path / "team", *words)
        what = f"{number}: {' '.join(words)}\n{done.stdout}{done.stderr}"
        seen[done.returncode] += 1
        match done.returncode:
            case 2:
                assert_refused(done, what)
            case 4:
                assert may_fail(team, words, killed), what
            case _:
                assert done.returncode in {0, 3}, what
                check(team, words, done, what)
                if runtime == "processes":  # of a network, it says nothing that could be played
                    check_journal(tmp_path / "run.journal", words, what)
        (tmp_path / "run.journal").unlink(missing_ok=True)
    assert {0, 2} <= {*seen}
