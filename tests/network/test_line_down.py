"""A line between the master and its robots that goes down, for good or for a while: everybody ends by themselves."""

from __future__ import annotations

import signal
import subprocess
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import pytest

from robochoc.formats import write_team
from robochoc.generators.random_csp import random_csp
from robochoc.journal.events import Decided, Event, Sent
from robochoc.journal.journal import read_journal
from robochoc.model.problem import Team
from robochoc.verification.checker import violations
from tests.support.deployments import CROWD, PAIR, Deployment, Program, ended
from tests.support.limits import wait_until
from tests.support.namespaces import TUN, Link, bad_line, namespaces, why_not
from tests.support.warm_programs import WarmPrograms

WHY_NOT = why_not()
pytestmark = [
    pytest.mark.skipif(bool(WHY_NOT), reason=WHY_NOT or "there are namespaces"),
    pytest.mark.skipif(not TUN.exists(), reason=f"a line that can go down needs {TUN}"),
    pytest.mark.slow,
]

PORT = 7447
HILL, FIELD = "10.78.1.1", "10.78.1.2"
PATIENCE_S = 3
COSTLY = random_csp(4, 4, 0.8, 0.0, seed=1, max_cost=50)


class Apart(NamedTuple):
    """A master on the hill, robots in the field, and a line between them."""

    site: Deployment
    hill: str
    field: str
    line: Link

    def enrolled(self, team: Team) -> tuple[Path, dict[str, str]]:
        """The files of `team`, and a token for each robot."""
        files = self.site.folder / "team"
        write_team(team, files)
        return files, self.site.enrol("--team", files)

    def master(self, files: Path, *words: object, patience_s: float = PATIENCE_S) -> Program:
        shown = ("--team", files, "--protocol", "sbt", "--json", "--patience", patience_s)
        return self.site.master(*shown, *words, inside=self.hill)

    def robots(self, files: Path, tokens: dict[str, str], patience_s: float = PATIENCE_S) -> dict[str, Program]:
        words = ("--patience", patience_s)
        return {
            name: self.site.robot(files / f"{name}.xml", "--token", token, *words, inside=self.field)
            for name, token in tokens.items()
        }

    def linked(self) -> bool:
        """Whether a robot has a link to the master."""
        command = ["ip", "netns", "exec", self.hill, "ss", "-Htn", "state", "established", "dst", FIELD]
        return bool(subprocess.run(command, check=True, capture_output=True).stdout.strip())


@pytest.fixture
def apart(tmp_path: Path, warm: WarmPrograms) -> Iterator[Apart]:
    with (
        namespaces(2) as (hill, field),
        bad_line((hill, f"{HILL}/24"), (field, f"{FIELD}/24"), seed=6, loss=0) as line,
        Deployment(tmp_path, HILL, PORT, warm) as site,
    ):
        yield Apart(site, hill, field, line)


def happened(journal: Path, event: type[Event]) -> bool:
    """Whether there is such an event in a journal that is being written."""
    return journal.exists() and any(isinstance(each, event) for each in read_journal(journal.read_bytes()).events)


def searching(apart: Apart, patience_s: float) -> tuple[Program, dict[str, Program]]:
    """The crowd, in the middle of its search."""
    files, tokens = apart.enrolled(CROWD)
    journal = apart.site.folder / "run.jsonl"
    master = apart.master(files, "--journal", journal, patience_s=patience_s)
    crew = apart.robots(files, tokens, patience_s)
    wait_until(lambda: happened(journal, Sent), lambda: master.errors)
    return master, crew


def test_a_line_that_is_down_before_robots_start(apart: Apart) -> None:
    files, tokens = apart.enrolled(PAIR)
    master = apart.master(files, "--gather", 5)
    apart.line.set("down")
    ended(apart.robots(files, tokens), 4)
    assert master.status() == 3, master.errors


def test_a_line_that_goes_down_for_good_while_the_team_gathers(apart: Apart) -> None:
    files, tokens = apart.enrolled(CROWD)
    master = apart.master(files, "--gather", 30)
    crew = apart.robots(files, dict(list(tokens.items())[1:]))
    master.wait_to_say(" has registered", len(crew))
    apart.line.set("down")
    ended(crew, 4)
    assert master.status() == 3, master.errors


def test_a_line_that_goes_down_for_good_during_the_search(apart: Apart) -> None:
    master, crew = searching(apart, PATIENCE_S)
    apart.line.set("down")
    assert master.status() == 4, master.errors
    assert f"it has not been there for {PATIENCE_S} s" in master.errors
    ended(crew, 4)


def test_links_that_were_given_up_and_come_back_before_the_patience_is_over(apart: Apart) -> None:
    master, crew = searching(apart, 60)
    apart.line.set("down")
    wait_until(lambda: not apart.linked(), "links to robots that are out of reach stay open")
    assert master.is_running
    apart.line.set("up")
    assert master.status() == 0, master.errors
    assert (master.object["verdict"], master.object["withdrawn"]) == ("no-solution", [])
    ended(crew)


def test_a_line_that_goes_down_for_good_at_the_end(apart: Apart) -> None:
    """Robots that have heard the outcome end well; the others are in doubt, and say so."""
    files, tokens = apart.enrolled(PAIR)
    journal = apart.site.folder / "run.jsonl"
    master = apart.master(files, "--journal", journal)
    crew = apart.robots(files, tokens)
    wait_until(lambda: happened(journal, Decided), lambda: master.errors)
    apart.line.set("down")
    assert master.status() in {0, 4}, master.errors
    assert {robot.status() for robot in crew.values()} <= {0, 4}


# By a deadline


def improving(apart: Apart) -> tuple[Program, dict[str, Program]]:
    """Robots with costs that have decided, and search on; the master is patient, they are not."""
    files, tokens = apart.enrolled(COSTLY)
    words = ("--protocol", "dsa", "--set", "cycles=1000000000", "--deadline", 0.1, "--improve", 3600, "--patience", 60)
    master = apart.site.master("--team", files, "--json", *words, inside=apart.hill)
    crew = apart.robots(files, tokens, 60)
    for robot in crew.values():
        robot.wait_to_say("solution so far; V")
    return master, crew


def test_a_line_that_goes_down_after_the_deadline_takes_no_answer_away(apart: Apart) -> None:
    master, crew = improving(apart)
    apart.line.set("down")
    master.strike(signal.SIGUSR1)
    assert master.status() == 0, master.errors
    told = master.object
    assert (told["verdict"], told["verified"], "lost" in told) == ("solution", True, False)
    assert list(violations(COSTLY, told["assignment"])) == []
    assert {robot.hurried_status() for robot in crew.values()} == {4}


def test_a_search_goes_on_when_the_line_is_up_again(apart: Apart) -> None:
    master, crew = improving(apart)
    apart.line.set("down")
    wait_until(lambda: not apart.linked(), "links to robots that are out of reach stay open")
    apart.line.set("up")
    wait_until(apart.linked, "no robot comes back")
    master.strike(signal.SIGUSR1)
    assert master.status() == 0, master.errors
    ended(crew)
    assert list(violations(COSTLY, master.object["assignment"])) == []
    said = {robot.output.rpartition("; ")[2].strip() for robot in crew.values()}
    assert said == {f"{name} = {value}" for name, value in master.object["assignment"].items()}
