"""Command lines that nobody would write: options drawn at random, on random teams.

None ends in a traceback, the status is what docs/reference/cli.md says, a refusal is one line, and a verdict is brute
force's, whatever the options are.
"""

from __future__ import annotations

import json
from collections import Counter
from contextlib import AbstractContextManager, nullcontext
from pathlib import Path
from random import Random
from typing import Any

from robochoc.formats.folder import write_team
from robochoc.formats.problems import read_problem
from robochoc.model.costs import normalized
from robochoc.model.problem import Team
from robochoc.run.registry import protocol_named, protocol_names
from tests.support.brute_force import priced_solutions
from tests.support.command_line_answers import check_answer, check_journal
from tests.support.counted_clock import time_passes_at_each_look
from tests.support.examples import count
from tests.support.loose_problems import minimum_cost
from tests.support.program import robochoc_within
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
    words += some(chance, 0.1, "--messages", 1, 10, 100, 10**30)
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
        words += some(chance, 0.1, "--ncccs", 1, 10, 10**30)
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
