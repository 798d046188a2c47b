"""Command lines that nobody would write: options drawn at random, on random teams, some of which change or lose robots.

None ends in a traceback, the status is what docs/reference/cli.md says, a refusal is one line, and a verdict is brute
force's, whatever the options are.
"""

from __future__ import annotations

import json
import sys
from collections import Counter
from contextlib import AbstractContextManager, nullcontext
from fractions import Fraction
from pathlib import Path
from random import Random
from subprocess import CompletedProcess
from typing import Any

import pytest

from robochoc.formats.problems import read_problem
from robochoc.formats.team_writer import write_team
from robochoc.model.costs import normalized
from robochoc.model.problem import Team
from robochoc.run.registry import protocol_named, protocol_names
from tests.support.brute_force import priced_solutions
from tests.support.changing_costs import changing_cost_team
from tests.support.command_line_answers import Truth, check_answer, check_improvements, check_journal
from tests.support.counted_clock import time_passes_at_each_look
from tests.support.examples import count
from tests.support.limits import HANG_S
from tests.support.loose_problems import minimum_cost
from tests.support.problems import with_unique_definitions
from tests.support.program import robochoc_within
from tests.support.random_changes import random_changing_team, stages
from tests.support.random_command_lines import FORMATS, ORDERS, any_team, assert_refused, by_the_time, endless, some

COUNTING = ("count-dpop", "list-dpop") * 3
"""They say more than others: how many optima there are, and which."""
SEEDS = (0, 7, 2**32, 2**63, 2**64 - 1)
SETTINGS = ("cycles=3", "cycles=", "variant=B", "damping=0.5", "preference=inf", "memory=1", "none=1", "=3")


def command_line(folder: Path, chance: Random) -> list[str]:
    runtime = chance.choice(("simulator", "simulator", "simulator", "arrays"))
    protocols: tuple[str, ...] = (*protocol_names(), "auto")
    if runtime == "arrays" and chance.random() >= 0.2:
        protocols = tuple(name for name in protocol_names() if protocol_named(name).traits.arrays)
    words = ["--runtime", runtime, *some(chance, 0.7, "--protocol", *protocols, *COUNTING)]
    words += some(chance, 0.5, "--order", *ORDERS)
    words += some(chance, 0.5, "--seed", *SEEDS)
    words += by_the_time(chance, 0.3, 0.0001, 0.05, 5) or some(chance, 0.1, "--timeout", "0.0001", "0.01", "1e300")
    words += some(chance, 0.1, "--messages", 1, 10, 100, 10**12)
    words += some(chance, 0.05, "--channel", "wlan", "wwan")
    words += endless(chance, words) or some(chance, 0.08, "--set", *SETTINGS)
    words += some(chance, 0.03, "--spare", 1)
    words += some(chance, 0.15, "--preprocess", "ac")
    words += some(chance, 0.1, "--message-loss", 0, 0.05, 0.5)
    words += ["--verify"] if chance.random() < 0.05 else []
    words += ["--count"] if "count-dpop" in words and chance.random() < 0.5 else []
    words += some(chance, 0.08, "--local-solutions", 1, 5)
    words += some(chance, 0.3, "--journal", folder / "run.journal")
    words += ["--bounds"] if "--journal" in words and chance.random() < 0.3 else []
    words += [f"--withdraw={chance.choice(('minimum', 'maximal'))}"] if chance.random() < 0.25 else []
    if "--channel" not in words and runtime == "simulator":
        words += some(chance, 0.3, "--schedule", "concurrent", "one-by-one", "cycles", "random")
        words += some(chance, 0.15, "--delay", 0, 20, 300)
        words += some(chance, 0.1, "--ncccs", 1, 10, 10**12)
        words += some(chance, 0.05, "--cycles", 1, 100)
    return [*words, "--explain"] if chance.random() < 0.1 else [*words, "--json"]


def clock(words: list[str], chance: Random) -> AbstractContextManager[None]:
    """Let the deadline come in mid-run, in half of the runs in which it is one of the simulator's."""
    in_steps = "--deadline" in words and "simulator" in words and chance.random() < 0.5
    return time_passes_at_each_look(chance.choice((0.002, 0.01, 0.05))) if in_steps else nullcontext()


def in_a_file_of_another_tool(folder: Path, chance: Random) -> Path:
    """Where the team in `folder` is, or in one of ten the same problem for other tools, if one can say it."""
    format_ = chance.choice(sorted(FORMATS))
    path = folder / f"exported.{FORMATS[format_]}"
    path.unlink(missing_ok=True)
    if chance.random() < 0.9 or robochoc_within("export", folder / "team", "--format", format_, "-o", path).returncode:
        return folder / "team"
    return path


@count("many", 20, 2000)
def test_no_command_line_ends_in_a_traceback_or_a_wrong_verdict(many: int, tmp_path: Path) -> None:
    seen: Counter[int] = Counter()
    for number in range(many):
        chance = Random(f"command lines {number}")
        team = any_team(chance)
        write_team(team, tmp_path / "team", replace=True)
        path = in_a_file_of_another_tool(tmp_path, chance)
        words = command_line(tmp_path, chance)
        with clock(words, chance):
            done = robochoc_within("solve", path, *words, "--no-cache")
        what = f"{number}: {path.name} {' '.join(words)}\n{done.stdout}{done.stderr}"
        seen[done.returncode] += 1
        if done.returncode == 2:
            assert_refused(done, what)
        else:
            assert done.returncode in {0, 3}, what
            if "--json" in words:
                check(read_problem(path).team, json.loads(done.stdout), words, what)
                assert (done.returncode == 3) is (json.loads(done.stdout)["verdict"] == "unknown"), what
        check_journal(tmp_path / "run.journal", words, what)
    assert {0, 2} <= {*seen}


def check(team: Team, found: dict[str, Any], words: list[str], what: str) -> None:
    names = found.get("names", {}).get("variables", {})
    assert not names, what  # nothing had to be renamed
    check_answer(team, found, words, what)
    if found["verdict"] == "unknown" or found["withdrawn"] or any("withdraw" in word for word in words):
        return
    if "--protocol" not in words or "auto" in words:
        assert found["chosen"]["protocol"], what
    if found.get("count") is not None:
        assert int(found["count"]) == len(optima(team, whole=True)), what
    if found.get("optima"):
        assert int(found["optima"]["number"]) == len(optima(team, whole=False)), what


def optima(team: Team, *, whole: bool) -> set[tuple[int, ...]]:
    """All solutions of the least cost; not `whole`: those that others than the robots themselves can tell apart."""
    counted = normalized(team)
    least = minimum_cost(counted)
    shown = [name for robot in counted.robots for name in robot.interface]
    told = [*counted.variables] if whole else shown
    return {tuple(one[name] for name in told) for one, cost in priced_solutions(counted) if cost == least}


# Teams that change: each epoch against brute force. The run has an answer only where all events have happened


CHANGING = (random_changing_team, random_changing_team, changing_cost_team)


def changing_line(runtime: str, folder: Path, chance: Random) -> list[str]:
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
        team = with_unique_definitions(chance.choice(CHANGING)(chance, chance.choice((2, 5, 10))))
        write_team(team, tmp_path / "team", replace=True)
        words = changing_line(runtime, tmp_path, chance)
        done = robochoc_within("solve", tmp_path / "team", *words)
        what = f"{number}: {' '.join(words)}\n{done.stdout}{done.stderr}"
        if done.returncode == 2:
            assert_refused(done, what)
        else:
            found = json.loads(done.stdout)
            assert done.returncode == (3 if found["verdict"] == "unknown" else 0), what
            check_epochs(team, found, words, what)
            seen[found["verdict"]] += 1
        check_journal(tmp_path / "run.journal", words, what)
    assert {*seen} >= {"solution", "no-solution", "unknown"}


def check_epochs(team: Team, found: dict[str, Any], words: list[str], what: str) -> None:
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


# Robots that die: the verdict is brute force's for the others, and the run fails only where nothing was said of losses


AT_S = (0, 0, 0.001, 0.01, 0.05)


def losses(team: Team, chance: Random) -> list[str]:
    """Which robots are killed, and when: none to two of them."""
    names = [robot.name for robot in team.robots]
    return [f"{chance.choice(names)}@{chance.choice(AT_S)}" for _ in range(chance.choice((0, 1, 1, 1, 2)))]


def lossy_line(runtime: str, folder: Path, killed: list[str], chance: Random) -> list[str]:
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


def check_survivors(team: Team, words: list[str], done: CompletedProcess[str], what: str) -> None:
    """Hold an answer to the truth about those who are left."""
    found = json.loads(done.stdout)
    if found["verdict"] == "unknown":
        limits = {"--messages", "--message-loss", "--deadline"} & {*words}
        assert limits or "ended, and found no assignment" in found["reason"], what
    check_answer(team, found, words, what)


def may_fail(team: Team, words: list[str], killed: list[str]) -> bool:
    """Whether the run may end with status 4: for a loss that is no withdrawal, or as nobody is left."""
    survives = ("withdraw" in words or "--spare" in words) and "fail" not in words
    return bool(killed) and (not survives or {one.split("@")[0] for one in killed} >= {*team.order})


@pytest.mark.skipif(sys.platform != "linux", reason="robots are killed")
@pytest.mark.parametrize("runtime", ["processes", pytest.param("network", marks=pytest.mark.slow)])
@count("many", 8, 300)
def test_whoever_is_lost_the_others_are_right(runtime: str, many: int, tmp_path: Path) -> None:
    seen: Counter[int] = Counter()
    for number in range(many):
        chance = Random(f"losses {number}")
        team = any_team(chance)
        write_team(team, tmp_path / "team", replace=True)
        killed = losses(team, chance)
        words = lossy_line(runtime, tmp_path, killed, chance)
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
                check_survivors(team, words, done, what)
                if runtime == "processes":  # of a network, it says nothing that could be played
                    check_journal(tmp_path / "run.journal", words, what)
        (tmp_path / "run.journal").unlink(missing_ok=True)
    assert {0, 2} <= {*seen}
