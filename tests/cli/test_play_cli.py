"""`robochoc play`: the report, JSON, journals, and wrong usage."""

from __future__ import annotations

import json
import shlex
import subprocess
import sys
from pathlib import Path
from typing import IO

import pytest

import robochoc
from robochoc.cli.commands.check import MOST_TEAMS
from robochoc.cli.commands.play import MOST_ROUNDS
from robochoc.cli.options.value_types import LARGEST_SEED, MOST
from robochoc.formats import write_team
from tests.support.limits import HANG_S
from tests.support.program import ROOT, robochoc_within
from tests.support.seats import lamps, program


@pytest.fixture(name="team")
def team_folder(tmp_path: Path) -> Path:
    folder = tmp_path / "lamps"
    write_team(lamps(), folder)
    return folder


def test_the_report_names_a_liar_and_broken_rules(team: Path) -> None:
    body = """
if number == 2: move["announce"] = values[(best + 1) % 3]
if number == 3: move["say"] = [{"to": "\\x1b[31mr9", "text": "hello"}]
"""
    seat = f"r1={shlex.join(program(body))}"
    done = robochoc_within(
        "play", team, "--seat", seat, "--others", "greedy", "--rounds", 3, "--timeout", HANG_S, "--coalition", "r0,r1"
    )
    assert done.returncode == 0, done.stderr
    assert done.stdout.startswith("lamps: 3 rounds, cost ")
    assert "r1 lied: it announced another value than it played in round 2" in done.stdout
    assert "r1 broke the rule wrong-receiver 1 time, first in round 3: " in done.stdout
    assert "joint regret of r0 and r1: " in done.stdout
    assert "\x1b" not in done.stdout


def test_json_and_journal(team: Path, tmp_path: Path) -> None:
    path = tmp_path / "game.journal"
    done = robochoc_within("play", team, "--player", "r0=script:1,0", "--others", "mgm", "--journal", path, "--json")
    report = json.loads(done.stdout)
    assert report["optimum"] == 2
    assert report["feasible"] is True
    assert [one["player"] for one in report["seats"]] == ["script", "mgm", "mgm", "mgm"]
    assert report["regret"] == report["cost"] - 2
    assert len(report["costs"]) == 20
    shown = robochoc_within("journal", "show", path).stdout
    assert "not possible: the players of a game (robochoc play) are not in its journal" in shown
    replayed = robochoc_within("replay", path)
    assert replayed.returncode == 2
    assert "not in its journal" in replayed.stderr
    assert robochoc_within("privacy", path).returncode == 0


SERVE = (sys.executable, "-m", "robochoc", "play", "--mcp", "r1", "--others", "greedy", "--rounds", "2")


def served(team: Path, stdin: int | IO[bytes]) -> subprocess.CompletedProcess[str]:
    """A game for an MCP client that sends `stdin`."""
    return subprocess.run([*SERVE, str(team)], stdin=stdin, capture_output=True, text=True, check=False, cwd=ROOT)


def test_a_client_that_leaves_before_the_end(team: Path) -> None:
    done = served(team, subprocess.DEVNULL)
    assert (done.returncode, done.stdout) == (4, "")
    assert done.stderr == "the MCP client left in round 1 of 2, so there is no report\n"
    about = {"protocolVersion": "2025-06-18", "capabilities": {}, "clientInfo": {"name": "client", "version": "1"}}
    said: list[dict[str, object]] = [
        {"id": 1, "method": "initialize", "params": about},
        {"method": "notifications/initialized"},
        {"id": 2, "method": "tools/call", "params": {"name": "end_turn", "arguments": {}}},
    ]
    pipe = subprocess.PIPE
    with subprocess.Popen([*SERVE, str(team)], stdin=pipe, stdout=pipe, stderr=pipe, text=True, cwd=ROOT) as game:
        assert game.stdin
        assert game.stdout
        for one in said:
            print(json.dumps({"jsonrpc": "2.0", **one}), file=game.stdin, flush=True)
        while json.loads(game.stdout.readline()).get("id") != 2:
            pass
        _, errors = game.communicate()
    first, *_, last = errors.splitlines()
    assert game.returncode == 4
    assert first.startswith("lamps: 1 of 2 rounds (a partial report), ")
    assert last == "the MCP client left in round 2 of 2, so the report is partial"


def test_a_client_whose_input_cannot_be_read(team: Path, tmp_path: Path) -> None:
    with (tmp_path / "written").open("wb") as unreadable:
        done = served(team, unreadable)
    left = "the MCP client left in round 1 of 2, so there is no report"
    assert (done.returncode, done.stderr) == (4, f"{left}: standard input cannot be read: Bad file descriptor\n")
    with Path("/dev/zero").open("rb") as endless:
        assert served(team, endless).stderr == f"{left}: it sent a line with more than 1,048,576 bytes\n"


def test_a_robot_without_a_possible_value(tmp_path: Path) -> None:
    model = robochoc.Model("stuck")
    model.add(model.robot("r0").variable("c", range(2)) > 5)
    write_team(model.team, tmp_path / "stuck")
    done = robochoc_within("play", tmp_path / "stuck")
    assert done.returncode == 2
    assert "r0 has no possible value: relax its private constraints, which exclude all of them" in done.stderr


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (("--seat", "r1"), "is not of the form ROBOT=..."),
        (("--seat", "r1='"), "cannot be read"),
        (("--seat", "r1=  "), "is empty"),
        (("--player", "r1=random", "--player", "r1=dsa"), "names r1 twice"),
        (("--player", "r7=random"), "no robot 'r7'"),
        (("--others", "dpop"), "--others dpop: dpop cannot play in rounds"),
        (("--others", "nobody"), "--others nobody: no protocol 'nobody'"),
        (("--seat", "r1=/no/such/program"), "--seat r1: /no/such/program cannot be started"),
        (("--player", "r2=script:9"), "--player r2: the script of r2 needs"),
        (("--coalition", ","), "--coalition ',' has an empty name"),
        (("--optimum", "dpopp"), "no protocol"),
        (("--optimum", "dsa"), "dsa is incomplete"),
        (("--coalition", "r1,r1"), "names r1 twice"),
        (("--mcp", "r1", "--mcp", "r2"), "--mcp is given 2 times"),
    ],
)  # fmt: skip
def test_wrong_usage(team: Path, words: tuple[str, ...], says: str) -> None:
    journal = team.parent / "game.journal"
    done = robochoc_within("play", team, *words, "--journal", journal)
    assert done.returncode == 2
    assert says in done.stderr
    assert len(done.stderr.splitlines()) == 1
    assert not journal.exists()


@pytest.mark.parametrize("timeout", ["inf", "1e300"])
def test_any_timeout_is_accepted(team: Path, timeout: str) -> None:
    seat = f"r1={shlex.join(program())}"
    done = robochoc_within("play", team, "--seat", seat, "--rounds", 2, "--timeout", timeout)
    assert done.returncode == 0, done.stderr


@pytest.mark.parametrize(
    ("command", "option", "most"),
    [
        ("play", "--rounds", MOST_ROUNDS),
        ("play", "--texts", MOST),
        ("check", "--teams", MOST_TEAMS),
        ("check", "--seed", LARGEST_SEED),
    ],
)
def test_a_number_above_the_maximum(command: str, option: str, most: int, team: Path, tmp_path: Path) -> None:
    where = [team, "--journal", tmp_path / "game.journal"] if command == "play" else ["abt"]
    done = robochoc_within(command, *where, option, most + 1)
    assert done.returncode == 2
    assert option in done.stderr
    assert f" to {most:,}" in done.stderr
    assert not (tmp_path / "game.journal").exists()


def test_a_journal_that_cannot_be_written(team: Path) -> None:
    done = robochoc_within("play", team, "--journal", "/dev/full", "--others", "greedy")
    assert done.returncode == 1
    assert "/dev/full" in done.stderr
