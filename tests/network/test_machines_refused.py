"""`robochoc master`, `robot` and `directory`: who is turned away, and how they are told."""

from __future__ import annotations

import signal
import socket
import subprocess
import sys
from pathlib import Path

import pytest
from click.testing import CliRunner

from robochoc.cli.group import cli
from robochoc.formats import write_team
from tests.support.cases import looped
from tests.support.deployments import LONG_S, PAIR, Deployment, ended, enrolled, one_line, taken, written
from tests.support.ports import LOOPBACK
from tests.support.program import ROOT

# Who is turned away


@pytest.mark.slow
def test_tokens_that_do_not_work(site: Deployment) -> None:
    files, tokens = enrolled(PAIR, site)
    expired = site.enrol("Late", "--token-ttl", 1e-6)["Late"]
    write_team(PAIR, site.folder / "other")
    (site.folder / "other" / "RA.xml").rename(site.folder / "other" / "Late.xml")
    master = site.master("--gather", 60)

    def refused(file: Path, token: str, *words: object) -> str:
        robot = site.robot(file, "--token", token, *words)
        assert robot.status() == (1 if "token is incomplete" in robot.errors else 4), robot.errors
        return one_line(robot)

    assert "for another name" in refused(files / "RA.xml", tokens["RB"])
    assert "token is incomplete" in refused(files / "RA.xml", tokens["RA"][:20])
    assert "expired" in refused(site.folder / "other" / "Late.xml", expired)
    first = site.robot(files / "RA.xml", "--token", tokens["RA"])
    master.wait_to_say("RA has registered")
    assert "already been used" in refused(files / "RA.xml", tokens["RA"], "--identity", site.folder / "second")
    with Deployment(site.folder / "elsewhere") as elsewhere:
        foreign = elsewhere.enrol("RB")["RB"]
    assert "does not belong to the Authority of the token" in refused(files / "RB.xml", foreign)
    second = site.robot(files / "RB.xml", "--token", tokens["RB"])
    assert master.status() == 0, master.errors
    ended({"RA": first, "RB": second})


def test_identities_that_do_not_fit(site: Deployment) -> None:
    files, tokens = enrolled(PAIR, site)
    master = site.master("--gather", 60)
    nobody = site.robot(files / "RA.xml")
    assert nobody.status() == 1
    assert "enrol this robot with a token" in one_line(nobody)
    first = site.robot(files / "RA.xml", "--token", tokens["RA"], "--identity", site.folder / "RA.id")
    master.wait_to_say("RA has registered")
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


@pytest.mark.more
def test_no_master_there(site: Deployment) -> None:
    files = written(PAIR, site)
    token = site.enrol("RA")["RA"]
    patient = ("--patience", 3600)
    stranger = site.robot(files / "RA.xml", "--token", token, *patient)
    watcher = site.start("desk", "directory", "--master", site.place, "--as", "RA", "--token", token, *patient)
    for program in (stranger, watcher):
        assert program.hurried_status() == 4
        assert "check that 'robochoc master' is running there" in one_line(program)
    master = site.master("--gather", 60)
    known = site.robot(files / "RA.xml", "--token", token)
    master.wait_to_say("RA has registered")
    master.kill()
    known.strike(signal.SIGINT)
    assert known.status() == 130, known.errors
    known = site.robot(files / "RA.xml", "--patience", 1)
    assert known.status() == 4
    assert f"no master answers at {site.place}" in one_line(known)


@pytest.mark.slow
def test_ctrl_c_ends_a_robot_that_waits_for_its_master(site: Deployment) -> None:
    files = written(PAIR, site)
    master = site.master("--gather", 60)
    site.robot(files / "RA.xml", "--token", site.enrol("RA")["RA"])
    master.wait_to_say("RA has registered")
    with socket.create_server((LOOPBACK, 0)) as silent:
        silent.settimeout(LONG_S)
        place = f"{LOOPBACK}:{silent.getsockname()[1]}"
        robot = site.start("RA", "robot", files / "RA.xml", "--master", place, "--patience", 3600)
        with silent.accept()[0]:
            robot.strike(signal.SIGINT)
            assert robot.status() == 130, robot.errors


@pytest.mark.more
def test_a_master_that_nobody_joins(site: Deployment) -> None:
    files = written(PAIR, site)
    master = site.master("--gather", 3600, "--team", files)
    assert (master.hurried_status(), master.output) == (3, "")
    told = master.errors.splitlines()[-1]
    assert "not complete after 3600 s" in told
    assert "missing: RA, RB" in told


@pytest.mark.slow
def test_a_robot_hears_that_the_others_did_not_come(site: Deployment) -> None:
    files = written(PAIR, site)
    robot = site.robot(files / "RA.xml", "--token", site.enrol("RA")["RA"])
    master = site.master("--gather", 3600)
    master.wait_to_say("RA has registered")
    assert master.hurried_status() == 3
    assert "missing: RB" in master.errors
    assert robot.status() == 4
    assert "missing: RB" in one_line(robot)


# What the command line says no to


def refusal(words: list[str]) -> tuple[int, str]:
    """Return the exit status of a command and the one line that it says."""
    done = CliRunner().invoke(cli, words)
    assert isinstance(done.exception, SystemExit)
    assert done.stdout == ""
    (line,) = (line for line in done.stderr.splitlines() if line and not line.startswith(("Usage:", "Try ")))
    return done.exit_code, line


@looped("higher", [0, 1])
def test_a_port_in_use(higher: int, site: Deployment) -> None:
    with taken(site.port + higher):
        words = ["master", "--listen", site.place, "--authority", str(site.authority_folder), "--gather", "5"]
        status, told = refusal(words)
    assert status == 2
    assert f"cannot listen on 127.0.0.1:{site.port + higher}" in told
    assert "in use" in told


@looped(
    ("words", "status", "told"),
    [
        (["master", "--listen", "nowhere at all"], 2, "not of the form HOST:PORT"),
        (["master", "--listen", "0.0.0.0:17000"], 2, "--host NAME"),
        (["master", "--listen", "[::1]:17000"], 2, "--host NAME"),
        (["master", "--listen", "192.0.2.1:17000"], 2, "cannot listen on 192.0.2.1:1700"),
        (["master", "--protocol", "nonsense"], 2, "nonsense"),
        (["master", "--filter", "nonsense"], 2, "--filter"),
        (["master", "--set", "colour=red"], 2, "colour"),
        (["master", "--gather", "nan"], 2, "Invalid value for '--gather': 'nan' is not a number greater than 0"),
        (["master", "--timeout", "0"], 2, "Invalid value for '--timeout': '0' is not a number greater than 0"),
        (["master", "--deadline", "nan"], 2, "Invalid value for '--deadline': 'nan' is not a number greater than 0"),
        (["master", "--deadline", "1", "--timeout", "1"], 2, "--deadline and --timeout both limit the time"),
        (["master", "--improve", "1"], 2, "--improve continues after --deadline SECONDS: add --deadline"),
        (["master", "--deadline", "1", "--improve", "inf"], 2, "'inf' is not a finite number"),
        (["master", "--deadline", "1", "--private"], 2, "--private hides them; use --timeout"),
        (["master", "--robots", "2", "--team", "."], 2, "--robots and --team"),
        (["master", "--team", "nowhere"], 1, "nowhere"),
        (["robot", "nowhere.xml", "--master", "127.0.0.1:17000"], 1, "nowhere.xml: "),
        (["robot", "RA.xml", "--master", "[::1"], 2, "not of the form HOST:PORT"),
        (["robot", "RA.xml", "--master", "[::1]7447"], 2, "not of the form HOST:PORT"),
        (["robot", "RA.xml", "--master", "127.0.0.1:65535"], 2, "not of the form HOST:PORT"),
        (["directory", "--master", "127.0.0.1:17000", "--as", "Watcher"], 1, "enrol this robot with a token"),
        (["directory", "--master", "127.0.0.1:17000", "--as", "../up"], 2, "../up"),
        (["directory", "--master", "h", "--as", "A", "--search", "colour=red"], 2, "slots are name, protocol"),
        (
            ["directory", "--master", "127.0.0.1:17000", "--as", "A", "--sl", "--json"],
            2,
            "--sl cannot be used with --json",
        ),
    ],
)
def test_what_cannot_be_is_said_in_a_line(
    words: list[str], status: int, told: str, site: Deployment, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("XDG_DATA_HOME", str(site.folder))
    given = [*words, "--authority", str(site.authority_folder)] if words[0] == "master" else words
    found, line = refusal(given)
    assert found == status
    assert told in line


def test_a_master_without_an_authority(tmp_path: Path) -> None:
    status, told = refusal(["master", "--authority", str(tmp_path / "nowhere"), "--listen", "127.0.0.1:7447"])
    assert status == 1
    assert told.endswith("run: robochoc authority init")


WITHOUT_AN_EXTRA = """
import sys
sys.modules[sys.argv[1]] = None
from robochoc.cli.main import main
codes = []
for words in (["master"], ["robot", "A.xml", "--master", "h"], ["directory", "--master", "h", "--as", "A"]):
    sys.argv[1:] = words
    try:
        main()
    except SystemExit as end:
        codes.append(end.code)
sys.exit(codes != [2, 2, 2])
"""


@looped("missing", ["zenoh", "cryptography"])
def test_without_the_extra_it_says_what_to_install(missing: str) -> None:
    words = [sys.executable, "-c", WITHOUT_AN_EXTRA, missing]
    done = subprocess.run(words, capture_output=True, text=True, check=False, cwd=ROOT)
    assert (done.returncode, done.stdout) == (0, "")
    assert (
        done.stderr == f"this command requires {missing}, which is an extra; run: pip install 'robochoc[network]'\n" * 3
    )
