"""One traitor among three machines: what users see of it at the master's (docs/guides/security.md, "One traitor")."""

from __future__ import annotations

import re

import pytest

from robochoc.model.problem import Constraint, Team
from tests.support import traitors
from tests.support.deployments import Deployment, Program, ended, written
from tests.support.limits import HANG_S
from tests.support.problems import PREDICATES, team_of

SLOW = pytest.mark.slow
PAIRS = [Constraint("C", PREDICATES[0], pair, pair) for pair in (("A", "B"), ("B", "C"))]
CHAIN = team_of(dict.fromkeys("ABC", (1, 2)), PAIRS)
PAIR = team_of(dict.fromkeys("AB", (1, 2)), PAIRS[:1])


def betrayed(
    site: Deployment, lie: str, *words: object, team: Team = CHAIN, copied: bool = False
) -> tuple[Program, int]:
    """The master, at its end, of a run in which RB lies, and its exit status."""
    files = written(team, site)
    if copied:
        parent, child = files / "RA.xml", (files / "RB.xml").read_text()
        predicates = child[child.index("<predicates") : child.index("<agents_neighbours>")]
        copy = child[child.index("<constraints nb") : child.index("</agent>")]
        text = parent.read_text().replace("<agents_neighbours>", predicates + "<agents_neighbours>")
        parent.write_text(
            text.replace('<agent name="RB" variable="A"/>', f'<agent name="RB" variable="A">{copy}</agent>')
        )
    tokens = site.enrol("--team", files)
    master = site.master("--team", files, *words)
    honest = site.robots(files, {name: token for name, token in tokens.items() if name != "RB"}, "--patience", HANG_S)
    robot = ("robot", files / "RB.xml", "--master", site.place, "--token", tokens["RB"], "--patience", HANG_S)
    site.script("traitor", traitors.program(lie, "RB", *robot))
    status = master.status()
    ended(honest, status)
    return master, status


@pytest.mark.more
def test_it_claims_that_there_is_no_solution(site: Deployment) -> None:
    master, status = betrayed(site, "no-solution", "--json")
    assert status == 0, master.errors
    told = master.object
    assert (told["verdict"], told["claimed_by"], told["verified"]) == ("no-solution", "RB", False)


@SLOW
def test_that_is_what_people_read(site: Deployment) -> None:
    master, status = betrayed(site, "no-solution")
    assert status == 0, master.errors
    assert master.output.startswith("files: no solution (RB claims it; this could not be checked)\n")


@SLOW
@pytest.mark.parametrize(
    ("lie", "why"),
    [
        (
            "optimal",
            "RB was lost: it has concluded optimal, but a robot of this protocol may conclude only no-solution",
        ),
        ("too early", "RB was lost: it has concluded a verdict before the start of the search"),
        ("a strange name", "RB was lost: it has reported a variable with an invalid name"),
        ("another's variable", "RB was lost: it has reported a value of A, which is RA's"),
        ("falling", "RB was lost: its counters have fallen, from "),
        ("costs", "RB was lost: it has reported 9,007,199,254,740,992 constraint checks in "),
    ],
)
def test_what_cannot_be_ends_the_run_and_names_it(site: Deployment, lie: str, why: str) -> None:
    master, status = betrayed(site, lie)
    assert status == 4, master.output
    assert why in master.errors
    assert "\x1b" not in master.errors + master.output


@SLOW
def test_others_go_on_without_it(site: Deployment) -> None:
    master, status = betrayed(site, "optimal", "--on-loss", "withdraw", "--json")
    assert status == 0, master.errors
    told = master.object
    assert (told["verdict"], told["lost"], sorted(told["assignment"])) == ("solution", ["RB"], ["A", "C"])


@SLOW
def test_it_judges_its_own_constraint(site: Deployment) -> None:
    master, status = betrayed(site, "a wrong value", team=PAIR)
    assert status == 0, master.errors
    assert master.output.startswith(
        "files: solution for all 2 robots, checked; by their owner only: 1 of 1 constraint\n"
    )


@SLOW
def test_its_parent_has_a_copy_of_the_constraint(site: Deployment) -> None:
    master, status = betrayed(site, "a wrong value", team=PAIR, copied=True)
    assert status == 4, master.output
    assert (
        "RA reports that the constraint over A B is broken, but RB, which holds it, reports that it holds"
        in master.errors
    )


@SLOW
def test_others_find_that_its_value_breaks_theirs(site: Deployment) -> None:
    master, status = betrayed(site, "a wrong value")
    assert status == 4, master.output
    assert "but RC finds its constraint over B C broken" in master.errors


@SLOW
@pytest.mark.parametrize(
    ("lie", "why"),
    [
        ("awake", r"RA reports .* messages sent to RB, but RB reports"),
        ("silent", r"RB.* not answered the master"),
    ],
)
def test_it_keeps_the_run_awake_until_the_time_is_over(site: Deployment, lie: str, why: str) -> None:
    master, status = betrayed(site, lie, "--timeout", 10)
    assert status == 3, master.errors
    assert "unknown: the time was over (--timeout 10); " in master.output
    assert re.search(why, master.output), master.output
