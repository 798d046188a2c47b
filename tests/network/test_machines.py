"""`robochoc master`, `robot` and `directory`, as users on several machines meet them."""

from __future__ import annotations

import json
import re
import signal
from pathlib import Path

import pytest

from robochoc.formats import read_team
from robochoc.model.outcome import Verdict
from robochoc.run import Options, Runtime, solve
from robochoc.verification.checker import violations
from tests.support.deployments import PAIR, TRIANGLE, Deployment, Program, ended, enrolled, finished, one_line, written
from tests.support.journal_entries import entries_of
from tests.support.program import ROOT, robochoc_within

FOUR = ROOT / "instances" / "queens3d-4"
SEVEN = ROOT / "instances" / "queens3d-7"
SCOUTS = ROOT / "docs" / "examples" / "scouts"
FLYING = 10


# Teams, from tokens to a verdict


@pytest.mark.slow
def test_sixteen_machines_find_what_sixteen_processes_do(site: Deployment) -> None:
    master, robots = finished(site, FOUR, "--team", FOUR, "--json", "--withdraw", "--timeout", 90)
    told = master.object
    alone = solve(read_team(FOUR), Options(runtime=Runtime.SIMULATOR))
    assert alone.verdict is Verdict.NO_SOLUTION
    assert (told["team"], told["protocol"], told["runtime"]) == ("queens3d-4", "abt", "network")
    assert (told["verdict"], told["cost"], len(told["assignment"])) == ("optimal", 0, FLYING)
    assert len(told["withdrawn"]) == len(robots) - FLYING
    assert told["verified"]
    assert "6 withdraw" in robots["Robot1.1"].output
    assert master.errors.count("granted to redeem a token") == master.errors.count(" has registered") == len(robots)
    assert master.errors.count("\n") == 1 + 2 * len(robots)
    listed = [json.loads(line) for line in site.authority("list", "--json").splitlines()]
    assert {member["state"] for member in listed if member["role"] == "robot"} == {"in force"}


@pytest.mark.slow
@pytest.mark.parametrize(("files", "verdict"), [(FOUR, "no-solution"), (SEVEN, "solution")])
def test_the_same_verdict_as_processes(files: Path, verdict: str, site: Deployment) -> None:
    master, _ = finished(site, files, "--team", files, "--json")
    team = read_team(files)
    assert master.object["verdict"] == solve(team, Options(runtime=Runtime.PROCESSES)).verdict == verdict


def test_a_journal_by_the_robots_own_words(site: Deployment) -> None:
    journal, page = site.folder / "scouts.jsonl", site.folder / "scouts.html"
    words = ("--journal", journal, "--json", "--filter", "signed", "--filter", "sealed")
    master, robots = finished(site, SCOUTS, *words, robots=["--json"])
    told = master.object
    assert told["verdict"] == "solution"
    for name, robot in robots.items():
        assert robot.object == {"robot": name, "outcome": "solution", "assignment": robot.object["assignment"]}
    assert {k: v for robot in robots.values() for k, v in robot.object["assignment"].items()} == told["assignment"]
    kinds = {entry["event"] for entry in entries_of(journal)}
    assert {"Registered", "Sent", "Received", "Decided"} <= kinds, kinds
    show = robochoc_within("animate", journal, "--team", SCOUTS, "-o", page)
    assert show.returncode == 0, show.stderr
    assert page.stat().st_size > 0


@pytest.mark.more
def test_what_robots_keep_to_themselves(site: Deployment) -> None:
    journal = site.folder / "pair.jsonl"
    words = ("--private", "--json", "--journal", journal, "--robots", 2)
    master, robots = finished(site, written(PAIR, site), *words)
    told = master.object
    assert (told["verdict"], told["assignment"], told["verified"]) == ("solution", {}, False)
    said = {name: robot.output.rpartition(" = ")[2].strip() for name, robot in robots.items()}
    assert set(said.values()) == {"1", "2"}, said
    written_down = {entry["event"] for entry in entries_of(journal)}
    assert written_down == {"Journal", "Granted", "Registered", "Began", "Ended"}


@pytest.mark.more
def test_a_robot_comes_back_while_others_are_awaited(site: Deployment) -> None:
    files, tokens = enrolled(PAIR, site)
    master = site.master("--team", files)
    first = site.robot(files / "RA.xml", "--token", tokens["RA"])
    master.wait_to_say("RA has registered")
    first.kill()
    robots = {"RA": site.robot(files / "RA.xml"), **site.robots(files, {"RB": tokens["RB"]})}
    assert master.status() == 0, master.errors
    ended(robots)


@pytest.mark.more
def test_a_robot_that_drops_out_is_told_and_waited_for_again(site: Deployment) -> None:
    files, tokens = enrolled(PAIR, site)
    journal = site.folder / "run.jsonl"
    master = site.master("--team", files, "--journal", journal)
    first = site.robot(files / "RA.xml", "--token", tokens["RA"])
    master.wait_to_say("RA has registered")
    first.kill()
    dropped = "RA has disconnected: it has not been there for 10 s; waiting for its return\n"
    master.hurry_until(lambda: dropped in master.errors)
    robots = {"RA": site.robot(files / "RA.xml"), **site.robots(files, {"RB": tokens["RB"]})}
    assert master.status() == 0, master.errors
    ended(robots)
    assert (master.errors.count(dropped), master.errors.count("RA has registered")) == (1, 2)
    found = [(entry["event"], entry["robot"]) for entry in entries_of(journal) if entry["event"] == "DroppedOut"]
    assert found == [("DroppedOut", "RA")]


@pytest.mark.more
def test_who_has_dropped_out_is_named_when_the_time_is_over(site: Deployment) -> None:
    files = written(PAIR, site)
    robot = site.robot(files / "RA.xml", "--token", site.enrol("RA")["RA"])
    master = site.master("--gather", 3600, "--patience", 1, "--team", files)
    master.wait_to_say("RA has registered")
    robot.kill()
    master.wait_to_say("RA has disconnected: it has not been there for 1 s; waiting for its return")
    assert master.hurried_status() == 3
    assert "missing: RA (it was there, and has dropped out), RB" in master.errors


@pytest.mark.more
def test_robots_that_are_there_before_their_master(site: Deployment) -> None:
    files = written(PAIR, site)
    robots = site.robots(files, site.enrol("--team", files))
    master = site.master("--team", files)
    assert master.status() == 0, master.errors
    ended(robots)
    assert master.output.startswith("files: solution for all 2 robots, checked; by their owner only: 1 of 1 constraint")


# The directory


@pytest.mark.more
def test_whom_the_directory_knows_while_the_master_waits(site: Deployment) -> None:
    files, tokens = enrolled(TRIANGLE, site)
    (token,) = site.enrol("Watcher", "--role", "observer").values()
    late = tokens.pop("RC")
    master = site.master("--protocol", "abt", "--team", files, "--withdraw", "--json")
    robots = site.robots(files, tokens)
    master.wait_to_say(" has registered", 2)

    def asked(*words: object) -> Program:
        return site.start("desk", "directory", "--master", site.place, "--as", "Watcher", *words)

    def names(*words: object) -> list[str]:
        program = asked("--json", *words)
        assert program.status() == 0, program.errors
        return [json.loads(line)["name"].partition("@")[0] for line in program.output.splitlines()]

    assert names("--token", token) == ["RA", "RB"]
    assert names("--search", "protocol=abt", "--search", "variable=B") == ["RB"]
    assert names("--search", "name=RB") == ["RB"]
    assert names("--at-most", 1, "--search", "protocol=abt") == ["RA"]
    words = asked("--sl", "--search", "variable=A")
    assert words.status() == 0, words.errors
    assert words.output.startswith("((result")
    assert f"RA@{site.place}/robochoc" in words.output
    table = asked("--search", "topic=/nowhere")
    assert (table.status(), table.output) == (0, "no agent matches\n")

    watcher = asked("--watch", "--patience", 3600)
    watcher.wait_to_print("RB@")
    last = site.robot(files / "RC.xml", "--token", late)
    assert master.status() == 0, master.errors
    assert (master.object["verdict"], len(master.object["withdrawn"])) == ("optimal", 1)
    assert (watcher.hurried_status(), "is gone" in watcher.errors) == (4, True)
    assert [line.partition("@")[0] for line in watcher.output.splitlines()] == ["RA", "RB", "RC"]
    ended({**robots, "RC": last})


@pytest.mark.more
def test_what_a_parent_leaves_out_its_childs_constraints_say(site: Deployment) -> None:
    files = site.folder / "unsaid"
    files.mkdir()
    for path in (ROOT / "docs" / "examples" / "scouts").glob("*.xml"):
        (files / path.name).write_text(re.sub(r' variable="[^"]*"', "", path.read_text()))
    master, _ = finished(site, files, "--team", files, "--json")
    assert not list(violations(read_team(files), master.object["assignment"]))


# In mid-run


@pytest.mark.slow
def test_revoked_while_the_others_wait_for_it(site: Deployment) -> None:
    files, tokens = enrolled(TRIANGLE, site)
    late = tokens.pop("RC")
    master = site.master("--on-loss", "withdraw", "--json", "--gather", 60)
    robots = site.robots(files, tokens)
    master.wait_to_say(" has registered", 2)
    site.authority("revoke", "RB")
    master.wait_to_say("refused: RB, take part: its certificate was revoked")
    last = site.robot(files / "RC.xml", "--token", late)
    master.wait_to_say("RC has registered")
    robots["RB"].kill()
    again = site.enrol("RB")["RB"]
    back = site.robot(files / "RB.xml", "--token", again, "--identity", site.folder / "anew")
    assert master.status() == 0, master.errors
    assert master.object["verdict"] == "no-solution"
    ended({"RA": robots["RA"], "RB": back, "RC": last})


@pytest.mark.slow
def test_revoked_in_mid_run(site: Deployment) -> None:
    files, tokens = enrolled(TRIANGLE, site)
    endless = ("--protocol", "dsa", "--set", "cycles=1000000", "--timeout", 15)
    master = site.master("--on-loss", "withdraw", "--json", *endless)
    robots = site.robots(files, tokens, "--patience", 2)
    master.wait_to_say(" has registered", 3)
    site.authority("revoke", "RB")
    master.wait_to_say("RB is lost: its certificate was revoked")
    assert master.status() == 0, master.errors
    told = master.object
    assert (told["verdict"], told["withdrawn"], told["lost"]) == ("solution", ["RB"], ["RB"])
    assert robots.pop("RB").status() == 4
    ended(robots, 0)


def test_ctrl_c_at_the_master_sends_everybody_home(site: Deployment) -> None:
    files, tokens = enrolled(TRIANGLE, site)
    del tokens["RC"]
    master = site.master()
    robots = site.robots(files, tokens)
    master.wait_to_say(" has registered", 2)
    master.strike(signal.SIGINT)
    assert master.status() == 130
    assert master.errors.endswith("robochoc: interrupted\n")
    ended(robots, status=4)
    for robot in robots.values():
        assert "the run was broken off: the master has stopped" in one_line(robot)
