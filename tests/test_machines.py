"""`robochoc master`, `robot` and `directory`, as users on several machines meet them."""

from __future__ import annotations

import json
import re
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import pytest
from click.testing import CliRunner
from machines import LONG_S, LOOPBACK, Program, Site, ended, taken
from problems import team_of
from program import ROOT
from test_epochs import differ

from robochoc.cli.commands import cli
from robochoc.formats import read_team, write_team
from robochoc.observers.checker import objections
from robochoc.outcome import Verdict
from robochoc.problem import Team
from robochoc.run import Options, Runtime, solve

FOUR = ROOT / "instances" / "queens3d-4"
SEVEN = ROOT / "instances" / "queens3d-7"
SCOUTS = ROOT / "docs" / "examples" / "scouts"
PAIR = team_of(dict.fromkeys("AB", range(1, 3)), [differ("A", "B")])
TRIANGLE = team_of(dict.fromkeys("ABC", range(1, 3)), [differ("A", "B"), differ("B", "C"), differ("A", "C")])
FLYING = 10
SOON_S = 20.0


@pytest.fixture
def site(tmp_path: Path) -> Iterator[Site]:
    with Site(tmp_path) as site:
        yield site


def written(team: Team, site: Site) -> Path:
    folder = site.folder / "files"
    write_team(team, folder)
    return folder


def one_line(program: Program) -> str:
    """All that a program says that did not get far."""
    assert program.errors.count("\n") == 1, program.errors
    return program.errors


# Teams, from tokens to a verdict


@pytest.mark.slow
def test_sixteen_machines_find_what_sixteen_processes_do(site: Site) -> None:
    tokens = site.enrol("--team", FOUR)
    master = site.master("--team", FOUR, "--json", "--withdraw", "--timeout", 90)
    robots = site.robots(FOUR, tokens)
    assert master.status() == 0, master.errors
    ended(robots)
    told = master.object
    alone = solve(read_team(FOUR), Options(runtime=Runtime.SIMULATOR))
    assert alone.verdict is Verdict.NO_SOLUTION
    assert (told["team"], told["protocol"], told["runtime"]) == ("queens3d-4", "abt", "network")
    assert (told["verdict"], told["cost"], len(told["assignment"])) == ("optimal", 0, FLYING)
    assert len(told["withdrawn"]) == len(robots) - FLYING
    assert told["verified"]
    assert "6 step aside" in robots["Robot1.1"].output
    assert master.errors.count("granted to redeem a token") == master.errors.count(" is there") == len(robots)
    assert master.errors.count("\n") == 1 + 2 * len(robots)
    assert {row.split()[3] for row in site.authority("list").splitlines()[1:]} == {"force"}


@pytest.mark.slow
@pytest.mark.parametrize(("files", "verdict"), [(FOUR, "no-solution"), (SEVEN, "solution")])
def test_the_same_verdict_as_processes(files: Path, verdict: str, site: Site) -> None:
    tokens = site.enrol("--team", files)
    master = site.master("--team", files, "--json")
    robots = site.robots(files, tokens)
    assert master.status() == 0, master.errors
    ended(robots)
    team = read_team(files)
    assert master.object["verdict"] == solve(team, Options(runtime=Runtime.PROCESSES)).verdict == verdict


def test_a_journal_by_the_robots_own_words(site: Site) -> None:
    tokens = site.enrol("--team", SCOUTS)
    journal, page = site.folder / "scouts.jsonl", site.folder / "scouts.html"
    master = site.master("--journal", journal, "--json", "--filter", "signed", "--filter", "sealed")
    robots = site.robots(SCOUTS, tokens, "--json")
    assert master.status() == 0, master.errors
    ended(robots)
    told = master.object
    assert told["verdict"] == "solution"
    for name, robot in robots.items():
        assert robot.object == {"robot": name, "outcome": "solution", "assignment": robot.object["assignment"]}
    assert {k: v for robot in robots.values() for k, v in robot.object["assignment"].items()} == told["assignment"]
    kinds = {json.loads(line).get("event") for line in journal.read_text().splitlines()}
    assert {"Registered", "Sent", "Received", "Decided"} <= kinds, kinds
    show = site.start("elsewhere", "animate", journal, "--team", SCOUTS, "-o", page)
    assert show.status() == 0, show.errors
    assert page.stat().st_size > 0


def test_what_robots_keep_to_themselves(site: Site) -> None:
    files = written(PAIR, site)
    tokens = site.enrol("--team", files)
    journal = site.folder / "pair.jsonl"
    master = site.master("--private", "--json", "--journal", journal, "--robots", 2)
    robots = site.robots(files, tokens)
    assert master.status() == 0, master.errors
    ended(robots)
    told = master.object
    assert (told["verdict"], told["assignment"], told["verified"]) == ("solution", {}, False)
    said = {name: robot.output.rpartition(" = ")[2].strip() for name, robot in robots.items()}
    assert set(said.values()) == {"1", "2"}, said
    written_down = {json.loads(line)["event"] for line in journal.read_text().splitlines()}
    assert written_down == {"Journal", "Granted", "Registered", "Ended"}


def test_a_robot_comes_back_while_others_are_awaited(site: Site) -> None:
    files = written(PAIR, site)
    tokens = site.enrol("--team", files)
    master = site.master("--team", files)
    first = site.robot(files / "RA.xml", "--token", tokens["RA"])
    master.wait_to_say("RA is there")
    first.kill()
    robots = {"RA": site.robot(files / "RA.xml"), **site.robots(files, {"RB": tokens["RB"]})}
    assert master.status() == 0, master.errors
    ended(robots)


def test_robots_that_are_there_before_their_master(site: Site) -> None:
    files = written(PAIR, site)
    robots = site.robots(files, site.enrol("--team", files))
    master = site.master("--team", files)
    assert master.status() == 0, master.errors
    ended(robots)
    assert master.output.startswith("files: solution, checked against every constraint")


# The directory


def test_whom_the_directory_knows_while_the_master_waits(site: Site) -> None:
    files = written(TRIANGLE, site)
    tokens = site.enrol("--team", files)
    (token,) = site.enrol("Watcher", "--role", "observer").values()
    late = tokens.pop("RC")
    master = site.master("--protocol", "abt", "--team", files, "--withdraw", "--json")
    robots = site.robots(files, tokens)
    master.wait_to_say(" is there", 2)

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
    assert (table.status(), table.output) == (0, "nobody that matches\n")

    watcher = asked("--watch", "--patience", 1)
    watcher.wait_to_print("RB@")
    last = site.robot(files / "RC.xml", "--token", late)
    assert master.status() == 0, master.errors
    assert (master.object["verdict"], len(master.object["withdrawn"])) == ("optimal", 1)
    assert (watcher.status(), "is gone" in watcher.errors) == (4, True)
    assert [line.partition("@")[0] for line in watcher.output.splitlines()] == ["RA", "RB", "RC"]
    ended({**robots, "RC": last})


def test_what_a_parent_leaves_out_its_childs_constraints_say(site: Site) -> None:
    files = site.folder / "unsaid"
    files.mkdir()
    for path in (ROOT / "docs" / "examples" / "scouts").glob("*.xml"):
        (files / path.name).write_text(re.sub(r' variable="[^"]*"', "", path.read_text()))
    tokens = site.enrol("--team", files)
    master = site.master("--team", files, "--json")
    robots = site.robots(files, tokens)
    assert master.status() == 0, master.errors
    assert not list(objections(read_team(files), master.object["assignment"]))
    ended(robots)


# Who is turned away


@pytest.mark.slow
def test_tokens_that_do_not_work(site: Site) -> None:
    files = written(PAIR, site)
    tokens = site.enrol("--team", files)
    expired = site.enrol("Late", "--token-ttl", 1e-6)["Late"]
    write_team(PAIR, site.folder / "other")
    (site.folder / "other" / "RA.xml").rename(site.folder / "other" / "Late.xml")
    master = site.master("--gather", 60)

    def refused(file: Path, token: str, *words: object) -> str:
        robot = site.robot(file, "--token", token, *words)
        assert robot.status() == (1 if "no token" in robot.errors else 4), robot.errors
        return one_line(robot)

    assert "not for this name" in refused(files / "RA.xml", tokens["RB"])
    assert "no token" in refused(files / "RA.xml", tokens["RA"][:20])
    assert "expired" in refused(site.folder / "other" / "Late.xml", expired)
    first = site.robot(files / "RA.xml", "--token", tokens["RA"])
    master.wait_to_say("RA is there")
    assert "used already" in refused(files / "RA.xml", tokens["RA"], "--identity", site.folder / "second")
    with Site(site.folder / "elsewhere") as elsewhere:
        foreign = elsewhere.enrol("RB")["RB"]
    assert "not the Authority that the token is from" in refused(files / "RB.xml", foreign)
    second = site.robot(files / "RB.xml", "--token", tokens["RB"])
    assert master.status() == 0, master.errors
    ended({"RA": first, "RB": second})


def test_identities_that_do_not_fit(site: Site) -> None:
    files = written(PAIR, site)
    tokens = site.enrol("--team", files)
    master = site.master("--gather", 60)
    nobody = site.robot(files / "RA.xml")
    assert nobody.status() == 1
    assert "enrol with a token" in one_line(nobody)
    first = site.robot(files / "RA.xml", "--token", tokens["RA"], "--identity", site.folder / "RA.id")
    master.wait_to_say("RA is there")
    borrowed = site.robot(files / "RB.xml", "--identity", site.folder / "RA.id")
    assert borrowed.status() == 1
    assert "is the identity of RA, not of RB" in one_line(borrowed)
    double = site.robot(files / "RA.xml", "--identity", site.folder / "RA.id")
    assert double.status() == 4
    assert "registered already" in one_line(double)
    second = site.robot(files / "RB.xml", "--token", tokens["RB"])
    assert master.status() == 0, master.errors
    ended({"RA": first, "RB": second})


# Nobody there


def test_no_master_there(site: Site) -> None:
    files = written(PAIR, site)
    token = site.enrol("RA")["RA"]
    began = time.monotonic()
    stranger = site.robot(files / "RA.xml", "--token", token, "--patience", 1)
    watcher = site.start("desk", "directory", "--master", site.place, "--as", "RA", "--token", token, "--patience", 1)
    for program in (stranger, watcher):
        assert program.status() == 4
        assert "is 'robochoc master' running there?" in one_line(program)
    assert time.monotonic() - began < LONG_S / 3
    master = site.master("--gather", 60)
    known = site.robot(files / "RA.xml", "--token", token)
    master.wait_to_say("RA is there")
    master.kill()
    known.strike(signal.SIGINT)
    assert known.status() == 130, known.errors
    began = time.monotonic()
    known = site.robot(files / "RA.xml", "--patience", 1)
    assert known.status() == 4
    assert f"no master answers at {site.place}" in one_line(known)
    assert time.monotonic() - began < LONG_S / 3


@pytest.mark.slow
def test_ctrl_c_ends_a_robot_that_waits_for_its_master(site: Site) -> None:
    files = written(PAIR, site)
    master = site.master("--gather", 60)
    site.robot(files / "RA.xml", "--token", site.enrol("RA")["RA"])
    master.wait_to_say("RA is there")
    with socket.create_server((LOOPBACK, 0)) as silent:
        silent.settimeout(LONG_S)
        place = f"{LOOPBACK}:{silent.getsockname()[1]}"
        robot = site.start("RA", "robot", files / "RA.xml", "--master", place, "--patience", 3600)
        with silent.accept()[0]:
            robot.strike(signal.SIGINT)
            assert robot.status(SOON_S) == 130, robot.errors


def test_a_master_that_nobody_joins(site: Site) -> None:
    files = written(PAIR, site)
    master = site.master("--gather", 1, "--team", files)
    assert (master.status(), master.output) == (3, "")
    told = master.errors.splitlines()[-1]
    assert "not complete after 1 s" in told
    assert "awaited: RA, RB" in told


@pytest.mark.slow
def test_a_robot_hears_that_the_others_did_not_come(site: Site) -> None:
    files = written(PAIR, site)
    robot = site.robot(files / "RA.xml", "--token", site.enrol("RA")["RA"])
    master = site.master("--gather", 15)
    assert master.status() == 3
    assert "awaited: RB" in master.errors
    assert robot.status() == 4
    assert "awaited: RB" in one_line(robot)


# In mid-run


@pytest.mark.slow
def test_revoked_while_the_others_wait_for_it(site: Site) -> None:
    files = written(TRIANGLE, site)
    tokens = site.enrol("--team", files)
    late = tokens.pop("RC")
    master = site.master("--on-loss", "withdraw", "--json", "--gather", 60)
    robots = site.robots(files, tokens)
    master.wait_to_say(" is there", 2)
    site.authority("revoke", "RB")
    master.wait_to_say("refused: RB, take part: its certificate was revoked")
    last = site.robot(files / "RC.xml", "--token", late)
    master.wait_to_say("RC is there")
    robots["RB"].kill()
    again = site.enrol("RB")["RB"]
    back = site.robot(files / "RB.xml", "--token", again, "--identity", site.folder / "anew")
    assert master.status() == 0, master.errors
    assert master.object["verdict"] == "no-solution"
    ended({"RA": robots["RA"], "RB": back, "RC": last})


@pytest.mark.slow
def test_revoked_in_mid_run(site: Site) -> None:
    files = written(TRIANGLE, site)
    tokens = site.enrol("--team", files)
    endless = ("--protocol", "dsa", "--set", "cycles=1000000", "--timeout", 15)
    master = site.master("--on-loss", "withdraw", "--json", *endless)
    robots = site.robots(files, tokens, "--patience", 2)
    master.wait_to_say(" is there", 3)
    site.authority("revoke", "RB")
    master.wait_to_say("RB is lost: its certificate was revoked")
    assert master.status() == 3, master.errors
    told = master.object
    assert (told["verdict"], told["withdrawn"], told["lost"]) == ("unknown", ["RB"], ["RB"])
    assert robots.pop("RB").status() == 4
    ended(robots)


def test_ctrl_c_at_the_master_sends_everybody_home(site: Site) -> None:
    files = written(TRIANGLE, site)
    tokens = site.enrol("--team", files)
    del tokens["RC"]
    master = site.master()
    robots = site.robots(files, tokens)
    master.wait_to_say(" is there", 2)
    master.strike(signal.SIGINT)
    assert master.status() == 130
    assert master.errors.endswith("robochoc: interrupted\n")
    ended(robots, status=4)
    for robot in robots.values():
        assert "the run was broken off: the master has stopped" in one_line(robot)


# What the command line says no to


@pytest.mark.parametrize("higher", [0, 1])
def test_a_port_in_use(higher: int, site: Site) -> None:
    with taken(site.port + higher):
        words = ("--listen", site.place, "--authority", site.authority_folder, "--gather", 5)
        master = site.start("master", "master", *words)
        assert master.status() == 2
    told = one_line(master)
    assert f"cannot listen on 127.0.0.1:{site.port + higher}" in told
    assert "in use" in told


@pytest.mark.parametrize(
    ("words", "status", "told"),
    [
        (["master", "--listen", "nowhere at all"], 2, "no HOST:PORT"),
        (["master", "--listen", "0.0.0.0:17000"], 2, "--host NAME"),
        (["master", "--listen", "[::1]:17000"], 2, "--host NAME"),
        (["master", "--listen", "192.0.2.1:17000"], 2, "cannot listen on 192.0.2.1:1700"),
        (["master", "--protocol", "nonsense"], 2, "nonsense"),
        (["master", "--filter", "nonsense"], 2, "--filter"),
        (["master", "--set", "colour=red"], 2, "colour"),
        (["master", "--gather", "nan"], 2, "--gather takes a number of seconds, more than 0"),
        (["master", "--timeout", "0"], 2, "--timeout takes a number of seconds"),
        (["master", "--robots", "2", "--team", "."], 2, "--robots and --team"),
        (["master", "--team", "nowhere"], 1, "nowhere"),
        (["robot", "nowhere.xml", "--master", "127.0.0.1:17000"], 1, "nowhere.xml: "),
        (["robot", "RA.xml", "--master", "[::1"], 2, "no HOST:PORT"),
        (["robot", "RA.xml", "--master", "[::1]7447"], 2, "no HOST:PORT"),
        (["robot", "RA.xml", "--master", "127.0.0.1:65535"], 2, "no HOST:PORT"),
        (["directory", "--master", "127.0.0.1:17000", "--as", "Watcher"], 1, "enrol with a token"),
        (["directory", "--master", "127.0.0.1:17000", "--as", "../up"], 2, "../up"),
        (["directory", "--master", "h", "--as", "A", "--search", "colour=red"], 2, "slots are name, protocol"),
        (["directory", "--master", "127.0.0.1:17000", "--as", "A", "--sl", "--json"], 2, "--sl and --json"),
    ],
)
def test_what_cannot_be_is_said_in_a_line(
    words: list[str], status: int, told: str, site: Site, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("XDG_DATA_HOME", str(site.folder))
    given = [*words, "--authority", str(site.authority_folder)] if words[0] == "master" else words
    done = CliRunner().invoke(cli, given)
    assert (done.exit_code, done.stdout) == (status, "")
    assert isinstance(done.exception, SystemExit)
    said = [line for line in done.stderr.splitlines() if line and not line.startswith(("Usage:", "Try "))]
    assert len(said) == 1
    assert told in said[0]


def test_a_master_without_an_authority(tmp_path: Path) -> None:
    with Site(tmp_path) as site:
        words = ("--authority", tmp_path / "nowhere", "--listen", site.place)
        master = site.start("master", "master", *words)
        assert master.status() == 1
        assert one_line(master).endswith("say: robochoc authority init\n")


@pytest.mark.parametrize("missing", ["zenoh", "cryptography"])
@pytest.mark.parametrize(
    "words", [["master"], ["robot", "A.xml", "--master", "h"], ["directory", "--master", "h", "--as", "A"]]
)
def test_without_the_extra_it_says_what_to_install(missing: str, words: list[str]) -> None:
    program = f"import sys; sys.modules[{missing!r}] = None; from robochoc.cli.main import main; main()"
    done = subprocess.run(
        [sys.executable, "-c", program, *words], capture_output=True, text=True, check=False, cwd=ROOT
    )
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr == f"this needs {missing}, which is an extra; say: pip install 'robochoc[network]'\n"
