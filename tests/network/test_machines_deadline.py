"""`robochoc master --deadline` and `--improve`: robots check what they have while they search, and keep the best."""

from __future__ import annotations

import signal
from typing import Any

import pytest

from robochoc.formats import write_team
from robochoc.generators.random_csp import random_csp
from robochoc.model.problem import Team
from robochoc.verification.checker import assignment_cost, violations
from tests.support.deployments import CROWD, PAIR, Deployment, Program, ended

COSTLY = random_csp(4, 4, 0.8, 0.0, seed=1, max_cost=50)
HARD = random_csp(9, 5, 0.8, 0.0, seed=1, max_cost=50)
"""No robot proves an optimum of it while a test lasts."""
ENDLESS = ("--protocol", "dsa", "--set", "cycles=1000000000")
FOUND = "team: a solution of cost "
SO_FAR = "solution so far; V"


def started(team: Team, site: Deployment, *words: object) -> tuple[Program, dict[str, Program]]:
    files = site.folder / "team"
    write_team(team, files)
    tokens = site.enrol("--team", files)
    master = site.master("--team", files, *words)
    return master, site.robots(files, tokens, "--json")


def ended_well(team: Team, master: Program, robots: dict[str, Program]) -> dict[str, Any]:
    """Return the master's answer once all have ended. It is checked, and each robot has decided the same."""
    assert master.status() == 0, master.errors
    ended(robots)
    told = master.object
    assert (told["verdict"], told["verified"]) == ("solution", True)
    assert list(violations(team, told["assignment"])) == []
    assert told["cost"] == assignment_cost(team, told["assignment"])
    assert {v: value for one in robots.values() for v, value in one.object["assignment"].items()} == told["assignment"]
    return told


@pytest.mark.slow
def test_by_the_deadline_the_best_that_robots_have_checked_is_the_answer(site: Deployment) -> None:
    master, robots = started(COSTLY, site, *ENDLESS, "--deadline", 5, "--json")
    if master.status() == 3:  # on a machine so busy that no robot had a value by then
        assert "by the deadline (--deadline 5) nothing had satisfied" in master.object["reason"]
        return
    told = ended_well(COSTLY, master, robots)
    assert (told["deadline"], "improvements" in told, FOUND in master.errors) == (5, False, False)
    assert sum(told["checked"].values()) == len(list(COSTLY.constraints()))


@pytest.mark.slow
@pytest.mark.parametrize("protocol", ["syncbb", "adopt", "afb"])
def test_what_is_better_is_published_until_the_search_is_ended(protocol: str, site: Deployment) -> None:
    master, robots = started(HARD, site, "--protocol", protocol, "--deadline", 0.1, "--improve", 3600, "--json")
    for robot in robots.values():
        robot.wait_to_say(SO_FAR)
    master.strike(signal.SIGUSR1)
    told = ended_well(HARD, master, robots)
    costs = [one["cost"] for one in told["improvements"]]
    assert costs == sorted(set(costs), reverse=True)
    assert costs[-1] == told["cost"]


@pytest.mark.more
def test_a_signal_ends_it_with_the_best_so_far(site: Deployment) -> None:
    master, robots = started(COSTLY, site, *ENDLESS, "--deadline", 0.1, "--improve", 3600, "--json")
    robots["Robot1"].wait_to_say(SO_FAR)
    master.strike(signal.SIGUSR1)
    ended_well(COSTLY, master, robots)


@pytest.mark.slow
def test_each_better_answer_is_told_in_a_line(site: Deployment) -> None:
    master, robots = started(COSTLY, site, *ENDLESS, "--deadline", 0.1, "--improve", 3600)
    master.wait_to_say(FOUND)
    master.strike(signal.SIGUSR1)
    assert master.status() == 0, master.errors
    ended(robots)
    assert " by the deadline of 0.1 s" in master.output


@pytest.mark.slow
def test_without_costs_the_first_solution_is_the_last(site: Deployment) -> None:
    master, robots = started(PAIR, site, *ENDLESS, "--deadline", 0.5, "--improve", 3600, "--json")
    told = ended_well(PAIR, master, robots)
    assert [one["cost"] for one in told["improvements"]] == [0]


# Whoever dies, or is out of reach


@pytest.mark.slow
def test_a_robot_that_dies_after_the_deadline_ends_the_run(site: Deployment) -> None:
    master, robots = started(COSTLY, site, *ENDLESS, "--deadline", 0.5, "--improve", 3600, "--patience", 1, "--json")
    robots["Robot1"].wait_to_say(SO_FAR)
    robots.pop("Robot2").kill()
    assert master.status() == 4, master.errors
    assert "Robot2 was lost: it has not been there for 1 s" in master.errors
    ended(robots, 4)


@pytest.mark.slow
def test_or_the_others_have_a_deadline_of_their_own(site: Deployment) -> None:
    words = (*ENDLESS, "--deadline", 1, "--improve", 3600, "--patience", 1, "--on-loss", "withdraw")
    master, robots = started(COSTLY, site, *words)
    master.wait_to_say(FOUND)
    robots.pop("Robot2").kill()
    master.wait_to_say("Robot2 is lost")
    found = master.errors.count(FOUND)
    master.wait_to_say(FOUND, found + 1)
    master.strike(signal.SIGUSR1)
    assert master.status() == 0, master.errors
    ended(robots)
    assert "team: solution for 3 of 4 robots (1 lost)" in master.output
    assert " V2 = " not in master.output


@pytest.mark.slow
def test_robots_whose_master_dies_have_told_what_they_had_decided(site: Deployment) -> None:
    master, robots = started(COSTLY, site, *ENDLESS, "--deadline", 0.5, "--improve", 3600, "--json")
    for robot in robots.values():
        robot.wait_to_say(SO_FAR)
    master.kill()
    for robot in robots.values():
        assert robot.hurried_status() == 4, robot.errors


@pytest.mark.slow
def test_a_robot_that_is_stopped_keeps_no_answer_from_the_others(site: Deployment) -> None:
    """The answer that all had checked before stands. The stopped robot hears of it when it goes on."""
    words = (*ENDLESS, "--deadline", 0.5, "--improve", 3600, "--patience", 1e9, "--json")
    master, robots = started(COSTLY, site, *words)
    for robot in robots.values():
        robot.wait_to_say(SO_FAR)
    robots["Robot2"].strike(signal.SIGSTOP)
    master.strike(signal.SIGUSR1)
    assert master.hurried_status() == 0, master.errors
    told = master.object
    assert (told["verdict"], told["withdrawn"]) == ("solution", [])
    assert list(violations(COSTLY, told["assignment"])) == []
    robots.pop("Robot2").kill()


@pytest.mark.slow
def test_as_few_as_possible_withdraw_by_the_deadline_or_more(site: Deployment) -> None:
    words = ("--protocol", "adopt", "--withdraw", "--deadline", 0.1, "--improve", 3600, "--json")
    master, robots = started(CROWD, site, *words)
    assert master.status() == 0, master.errors
    ended(robots)
    told = master.object
    assert (told["verdict"], len(told["withdrawn"])) == ("optimal", 1)
    assert {v: value for one in robots.values() for v, value in one.object["assignment"].items()} == told["assignment"]
