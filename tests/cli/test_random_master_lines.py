"""Command lines of `robochoc master` that nobody would write: options drawn at random, robots started by hand.

A run that is refused ends all robots; a verdict is brute force's, and what each robot says that it has decided is what
the master says.
"""

from __future__ import annotations

from collections import Counter
from contextlib import suppress
from pathlib import Path
from random import Random
from typing import Any

import pytest

from robochoc.formats import write_team
from robochoc.model.costs import UnboundedCostError, normalized_robot
from robochoc.model.problem import ProblemKind, Team
from robochoc.run.registry import protocol_named, protocol_names
from tests.support.command_line_answers import Truth, check_answer
from tests.support.deployments import Deployment, Program
from tests.support.examples import count
from tests.support.problems import with_unique_definitions
from tests.support.random_command_lines import TEAMS, some
from tests.support.warm_programs import WarmPrograms


def command_line(team: Team, chance: Random) -> list[str]:
    ours = {name: protocol_named(name) for name in protocol_names()}
    fit = [
        name
        for name, one in ours.items()
        if one.__module__.startswith("robochoc.") and (one.traits.costs or team.kind is ProblemKind.DISCSP)
    ]
    words = some(chance, 0.8, "--protocol", *fit)
    words += some(chance, 0.5, "--deadline", 0.001, 0.05, 0.3)
    words += some(chance, 0.5 if "--deadline" in words else 0.03, "--improve", 0.001, 0.3)
    words += some(chance, 0.05, "--timeout", 0.001, 60)
    words += some(chance, 0.1, "--messages", 1, 10, 10**12)
    words += some(chance, 0.1, "--seed", 0, 7, 2**64 - 1)
    words += some(chance, 0.1, "--message-loss", 0.05, 0.5)
    words += some(chance, 0.2, "--set", "cycles=3", "cycles=1000000000")
    words += some(chance, 0.1, "--on-loss", "fail", "withdraw")
    words += some(chance, 0.1, "--filter", "signed", "sealed")
    words += ["--private"] if chance.random() < 0.05 else []
    words += [f"--withdraw={chance.choice(('minimum', 'maximal'))}"] if chance.random() < 0.25 else []
    if not {"--deadline", "--timeout"} & {*words} and "cycles=1000000000" in words:
        words += ["--timeout", "1"]
    return words


def any_bounded_team(chance: Random) -> Team:
    """Return a team whose robots all know the bounds of their costs: for others, which end, the master would wait."""
    while True:
        team = with_unique_definitions(TEAMS[chance.choice(sorted(TEAMS))](chance))
        with suppress(UnboundedCostError):
            for robot in team.robots:
                normalized_robot(robot, robot.costs, {one.name: one.domain for one in robot.variables})
            return team


@pytest.mark.slow
@count("many", 4, 100)
def test_robots_decide_what_the_master_says_and_brute_force_agrees(
    many: int, tmp_path: Path, warm: WarmPrograms
) -> None:
    seen: Counter[int] = Counter()
    for number in range(many):
        chance = Random(f"master lines {number}")
        team = any_bounded_team(chance)
        words = command_line(team, chance)
        with Deployment(tmp_path / str(number), warm=warm) as site:
            master, robots = run(team, words, site)
            what = f"{number}: {' '.join(words)}\n{master.output}{master.errors}"
            statuses = {name: robot.status() for name, robot in robots.items()}
        seen[master.status()] += 1
        assert master.status() in {0, 2, 3}, what
        if master.status() == 2:
            assert not master.output, what
            continue
        assert {*statuses.values()} == {master.status()}, (what, statuses)
        told = master.object
        check_verdict(team, told, words, what)
        if told["verdict"] in {"solution", "optimal"} and "--private" not in words:
            decided = {v: value for robot in robots.values() for v, value in robot.object["assignment"].items()}
            assert decided == told["assignment"], what
    assert 0 in seen


def run(team: Team, words: list[str], site: Deployment) -> tuple[Program, dict[str, Program]]:
    """A master and its robots; none where the master refuses its options before any comes."""
    files = site.folder / "team"
    write_team(team, files)
    tokens = site.enrol("--team", files)
    listening = ("--listen", site.place, "--authority", site.authority_folder)
    master = site.start("master", "master", *listening, "--team", files, "--json", *words)
    robots = site.robots(files, tokens, "--json", "--patience", 20)
    status = master.status()
    if status == 2 and "listening" not in master.errors:
        for robot in robots.values():
            robot.kill()
        return master, {}
    return master, robots


def check_verdict(team: Team, found: dict[str, Any], words: list[str], what: str) -> None:
    assert "deadline" not in found or "--deadline" in words, what
    if "--private" not in words:
        check_answer(team, found, words, what)
    elif found["verdict"] != "unknown" and not any(word.startswith("--withdraw") for word in words):
        assert (found["verdict"] == "no-solution") is (Truth(team).best() is None), what
