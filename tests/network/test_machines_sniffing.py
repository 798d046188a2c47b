"""`robochoc sniff --master`: a run followed from another machine, and what becomes of it when either side ends."""

from __future__ import annotations

import re
import signal
from pathlib import Path
from urllib.request import urlopen

import pytest
from click.testing import CliRunner

from robochoc.cli.group import cli
from robochoc.journal.journal import read_journal
from tests.support.cases import looped
from tests.support.deployments import PAIR, TRIANGLE, Deployment, Program, ended, enrolled, one_line
from tests.support.journal_entries import entries_of
from tests.support.limits import HANG_S, wait_until

OBSERVER = ("--role", "observer")
SNIFFER = (*OBSERVER, "--may", "sniff")
ENDLESS = ("--protocol", "dsa", "--set", "cycles=1000000", "--json")


def follow(site: Deployment, name: str, token: str, *words: object) -> Program:
    """Follow the run of the site's master on a machine of one's own, into a file."""
    kept = ("--no-page", "--journal", copy_of(site, name))
    return site.start(name, "sniff", "--master", site.place, "--as", name, "--token", token, *kept, *words)


def copy_of(site: Deployment, name: str) -> Path:
    return site.folder / f"{name}.journal"


def heard(site: Deployment, name: str) -> set[str]:
    """The kinds of events that a sniffer has heard of by now."""
    file = copy_of(site, name)
    return {type(event).__name__ for event in read_journal(file.read_bytes()).events} if file.exists() else set()


@pytest.mark.more
def test_who_may_has_the_masters_own_journal_whenever_it_comes(site: Deployment) -> None:
    files, tokens = enrolled(PAIR, site)
    sniffers = site.enrol("Early", "Late", *SNIFFER)
    spy = site.enrol("Spy", *OBSERVER)["Spy"]
    own = site.folder / "own.journal"
    master = site.master("--sniffable", "--journal", own, "--robots", 2)
    early = follow(site, "Early", sniffers["Early"])
    refused = follow(site, "Spy", spy)
    first = site.robot(files / "RA.xml", "--token", tokens["RA"])
    wait_until(lambda: "Registered" in heard(site, "Early"), lambda: early.errors)
    late = follow(site, "Late", sniffers["Late"])
    wait_until(lambda: "Registered" in heard(site, "Late"), lambda: late.errors)
    assert refused.status() == 4
    assert (
        "does not allow Spy to sniff: it does not have the right: grant it by robochoc authority enrol Spy --may sniff"
        in one_line(refused)
    )
    assert not copy_of(site, "Spy").exists()
    second = site.robot(files / "RB.xml", "--token", tokens["RB"])
    assert master.status() == 0, master.errors
    ended({"RA": first, "RB": second})
    for name, sniffer in (("Early", early), ("Late", late)):
        assert sniffer.status() == 0, sniffer.errors
        assert "the run is over; " in sniffer.errors
        assert copy_of(site, name).read_bytes() == own.read_bytes()
    told = entries_of(own)
    assert {"Registered", "Began", "Sent", "Received", "Decided", "Ended"} <= {entry["event"] for entry in told}
    granted = [entry["who"] for entry in told if entry["event"] == "Granted" and entry["what"] == "sniff"]
    assert granted == ["Early", "Late"]
    assert [entry["who"] for entry in told if entry["event"] == "Refused"] == ["Spy"]
    assert "refused: Spy, sniff: it does not have the right" in master.errors


@pytest.mark.slow
def test_sniffers_that_are_stopped_killed_or_revoked_in_mid_run(site: Deployment) -> None:
    files, tokens = enrolled(TRIANGLE, site)
    sniffers = site.enrol("Stopped", "Killed", "Revoked", "Whole", *SNIFFER)
    master = site.master("--sniffable", *ENDLESS, "--timeout", 10)
    robots = site.robots(files, tokens)
    programs = {name: follow(site, name, token, "--patience", 3) for name, token in sniffers.items()}
    for name, program in programs.items():
        wait_until(
            lambda name=name: copy_of(site, name).exists() and copy_of(site, name).stat().st_size > 10_000,  # type: ignore[misc]
            lambda program=program: program.errors,  # type: ignore[misc]
        )
    programs["Stopped"].strike(signal.SIGSTOP)
    programs["Killed"].kill()
    site.authority("revoke", "Revoked")
    assert programs["Revoked"].status() == 4
    assert "to sniff any more" in programs["Revoked"].errors
    assert master.status() == 3, master.errors
    ended(robots, status=3)
    assert " is lost" not in master.errors
    assert programs["Whole"].status() == 0, programs["Whole"].errors
    whole = copy_of(site, "Whole").read_bytes()
    programs["Stopped"].strike(signal.SIGCONT)
    assert programs["Stopped"].status() == 4
    assert "has ended, or does not allow Stopped to sniff any more" in programs["Stopped"].errors
    for name in ("Stopped", "Killed", "Revoked"):
        part = copy_of(site, name).read_bytes()
        assert whole.startswith(part)
        assert read_journal(part).damage is None


@pytest.mark.more
def test_a_master_that_is_killed_and_the_page_stays(site: Deployment) -> None:
    files, tokens = enrolled(PAIR, site)
    token = site.enrol("Sniffer", *SNIFFER)["Sniffer"]
    master = site.master("--sniffable", "--robots", 2)
    words = ("--token", token, "--journal", copy_of(site, "Sniffer"), "--patience", 3600)
    sniffer = site.start("desk", "sniff", "--master", site.place, *words)
    robot = site.robot(files / "RA.xml", "--token", tokens["RA"], "--patience", 3600)
    wait_until(lambda: "Registered" in heard(site, "Sniffer"), lambda: sniffer.errors)
    master.kill()
    sniffer.hurry_until(lambda: "has ended, or does not allow Sniffer to sniff any more" in sniffer.errors)
    sniffer.wait_to_say("stays until Ctrl-C")
    assert robot.hurried_status() == 4
    url = re.search(r"http://127\S+/", sniffer.errors)
    assert url
    with urlopen(f"{url[0]}about", timeout=HANG_S) as answer:  # noqa: S310 - our own server
        assert b'"network"' in answer.read()
    sniffer.strike(signal.SIGINT)
    assert sniffer.status() == 4
    content = copy_of(site, "Sniffer").read_bytes()
    journal = read_journal(content)
    assert (journal.outcome, journal.damage) == (None, None)
    assert f"{len(content):,} bytes of its journal received" in sniffer.errors


@pytest.mark.more
def test_in_a_private_run_only_robots_that_agreed_are_heard(site: Deployment) -> None:
    files, tokens = enrolled(PAIR, site)
    token = site.enrol("Eye", *SNIFFER)["Eye"]
    master = site.master("--sniffable", "--private", "--robots", 2)
    eye = follow(site, "Eye", token)
    eye.wait_to_say("following the run")
    first = site.robot(files / "RA.xml", "--token", tokens["RA"], "--sniff")
    second = site.robot(files / "RB.xml", "--token", tokens["RB"])
    assert master.status() == 0, master.errors
    ended({"RA": first, "RB": second, "Eye": eye})
    told = entries_of(copy_of(site, "Eye"))
    assert {entry["sender"] for entry in told if entry["event"] == "Sent"} <= {"RA"}
    assert {entry["robot"] for entry in told if entry["event"] in {"Decided", "Settled"}} == {"RA"}
    assert all("content" not in entry for entry in told if entry["event"] == "Received")
    assert [entry["outcome"]["assignment"] for entry in told if entry["event"] == "Ended"] == [{}]


@pytest.mark.more
def test_ctrl_c_ends_it_and_a_master_that_is_not_sniffable_says_so(site: Deployment) -> None:
    tokens = site.enrol("Eye", "Ear", *SNIFFER)
    master = site.master()
    eye = follow(site, "Eye", tokens["Eye"])
    assert eye.status() == 4
    assert "this master does not publish its journal: start it with --sniffable" in one_line(eye)
    master.strike(signal.SIGINT)
    master.status()
    master = site.master("--sniffable")
    ear = follow(site, "Ear", tokens["Ear"])
    ear.wait_to_say("following the run")
    ear.strike(signal.SIGINT)
    assert (ear.status(), "Traceback" in ear.errors) == (130, False)


@looped(
    ("words", "told"),
    [
        ([], "give a JOURNAL"),
        (["{file}", "--master", "127.0.0.1"], "remove one"),
        (["{file}", "--as", "Eye"], "--as requires --master"),
        (["{file}", "--no-page"], "--no-page requires --master"),
        (["--master", "127.0.0.1", "--no-page"], "--no-page requires --journal"),
        (["--master", "127.0.0.1", "--team", "{folder}"], "--team requires a JOURNAL"),
        (["--master", "nowhere:port"], "is not of the form HOST:PORT"),
    ],
)
def test_what_does_not_go_together(words: list[str], told: str, tmp_path: Path) -> None:
    file = tmp_path / "run.journal"
    file.touch()
    done = CliRunner().invoke(cli, ["sniff", *(word.format(file=file, folder=tmp_path) for word in words)])
    assert (done.exit_code, told in done.output) == (2, True), done.output
