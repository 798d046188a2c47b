"""A standby master that takes over, as users on several machines meet it."""

from __future__ import annotations

import signal

import pytest
from click.testing import CliRunner

from robochoc.cli.group import cli
from tests.support.deployments import TRIANGLE, Deployment, Program, ended, enrolled
from tests.support.journal_entries import entries_of
from tests.support.limits import wait_until
from tests.support.ports import LOOPBACK, free_port

NAMES = ("RA", "RB", "RC")


class Site:
    """A leading master, a standby master with the options `words`, and the robots of a triangle, which know both."""

    def __init__(self, site: Deployment, *words: object) -> None:
        self.files, self._tokens = enrolled(TRIANGLE, site)
        self._site = site
        self.folder = site.folder
        self.robot_words: tuple[object, ...] = ()
        self._place = f"{LOOPBACK}:{free_port(LOOPBACK)}"
        self.journal = site.folder / "standby.jsonl"
        token = site.enrol("B", "--role", "master", "--host", LOOPBACK)["B"]
        self.leader = site.master("--team", self.files, "--json")
        options = ("--standby", site.place, "--as", "B", "--token", token, "--listen", self._place)
        self.standby = site.start(
            "B", "master", *options, "--team", self.files, "--json", "--journal", self.journal, *words
        )
        self.standby.wait_to_say("standing by for")
        self.robots: dict[str, Program] = {}

    def robot(self, name: str) -> Program:
        """Start a robot, and wait until it has registered with the leading master."""
        words = ("--token", self._tokens[name], "--master", self._place, "--json", *self.robot_words)
        self.robots[name] = self._site.robot(self.files / f"{name}.xml", *words)
        return self.robots[name]

    def close_team(self) -> None:
        """Let the team vote, except for RC, which is stopped: the leading master waits for its vote.

        RC is stopped as late as possible: a robot that is silent before the team is complete counts as disconnected.
        """
        for name in ("RA", "RC"):
            self.robot(name)
            self.leader.wait_to_say(f"{name} has registered")
        self.robots["RC"].strike(signal.SIGSTOP)
        self.robot("RB")
        self.leader.wait_to_say("RB has registered")


def test_the_standby_takes_over_from_a_killed_master(site: Deployment) -> None:
    team = Site(site)
    team.close_team()
    team.leader.kill()
    team.robots["RC"].strike(signal.SIGCONT)
    assert team.standby.status() == 0, team.standby.errors
    ended(team.robots)
    result = team.standby.object
    assert (result["verdict"], result["led_by"]) == ("no-solution", "B")
    led = [entry for entry in entries_of(team.journal) if entry["event"] == "Leads"]
    assert [(entry["master"], entry["term"]) for entry in led] == [("B", result["term"])]
    assert f"B leads in term {result['term']}: " in team.standby.errors
    assert "looking for another master" in team.robots["RA"].errors


@pytest.mark.more
def test_robots_go_on_at_the_standby_if_the_master_is_ended(site: Deployment) -> None:
    team = Site(site)
    team.close_team()
    team.leader.strike(signal.SIGTERM)
    team.robots["RC"].strike(signal.SIGCONT)
    assert team.standby.status() == 0, team.standby.errors
    ended(team.robots)
    assert team.standby.object["led_by"] == "B"


@pytest.mark.more
def test_the_standby_ends_with_the_run(site: Deployment) -> None:
    team = Site(site)
    for name in NAMES:
        team.robot(name)
    assert (team.leader.status(), team.standby.status()) == (0, 0), team.standby.errors
    ended(team.robots)
    result = team.leader.object
    assert (result["led_by"], result["term"]) == ("MASTER", 1)
    assert "has ended the run: no-solution" in team.standby.errors
    assert not team.standby.output


@pytest.mark.more
def test_a_minority_does_not_decide(site: Deployment) -> None:
    team = Site(site, "--patience", 1, "--on-loss", "withdraw")
    team.robot_words = ("--patience", 20)  # less: robots may end at the start on a busy machine
    team.close_team()
    votes = team.folder / "RA" / "robochoc" / "identities" / "RA" / "votes.json"
    wait_until(votes.exists, lambda: f"RA has not voted: {team.robots['RA'].errors}, {team.leader.errors}")
    for program in (team.leader, team.robots["RB"], team.robots["RC"]):
        program.kill()
    assert team.standby.status() == 4, team.standby.errors
    assert "1 of 3 robots are here, and a decision needs 2" in team.standby.errors
    assert "missing: RB, RC" in team.standby.errors
    assert not team.standby.output
    assert team.robots["RA"].status() == 4
    assert "no master leads: none of" in team.robots["RA"].errors


@pytest.mark.parametrize(
    ("words", "why"),
    [
        (["--standby", "127.0.0.1:1"], "add --as NAME"),
        (["--as", "B"], "add --standby HOST:PORT"),
        (["--standby", "127.0.0.1:1,127.0.0.1:1", "--as", "B"], "127.0.0.1:1 is given twice: remove one"),
        (["--standby", "?"], "is not of the form HOST:PORT"),
        (["--standby", "127.0.0.1:7447", "--as", "B"], "the address of this master"),
        (["--standby", "127.0.0.1:1", "--as", "B", "--authority", "x"], "--authority is only for the first master"),
    ],
)
def test_options_that_make_no_standby(words: list[str], why: str) -> None:
    done = CliRunner().invoke(cli, ["master", *words])
    assert (done.exit_code, why in done.stderr) == (2, True), done.stderr
