"""Smaller teams with a fault: nothing can be left out of them alone, and the fault needs no more steps."""

from __future__ import annotations

import itertools

import pytest

from robochoc.exploration.check import CheckedTeam, CheckOptions, checked
from robochoc.exploration.problems import small_teams
from robochoc.exploration.shrinking import reduced
from robochoc.protocols.satisfaction.abt import ABT
from robochoc.run import Options, Runtime
from robochoc.testing import check_protocol
from tests.support.compiled import plain_python_only
from tests.support.faulty_abt import NoAnswer

pytestmark = plain_python_only
OPTIONS = CheckOptions(NoAnswer, Options(protocol="abt", runtime=Runtime.SIMULATOR), 3000)


def faulty(number: int) -> CheckedTeam:
    team = next(itertools.islice(small_teams(NoAnswer.traits, 3, 2, 0), number, None))
    (found,) = checked([team], OPTIONS)
    assert found.exploration.fault
    return found


@pytest.mark.parametrize(("number", "steps"), [(17, 4), (56, 4), (95, 4)])
def test_a_smaller_team_has_a_fault_after_no_more_steps(number: int, steps: int) -> None:
    found = faulty(number)
    smaller = reduced(found, OPTIONS)
    assert smaller.team.name == f"{found.team.name}-reduced"
    assert len(smaller.exploration.path) == steps <= len(found.exploration.path)
    assert sum(1 for _ in smaller.team.constraints()) <= sum(1 for _ in found.team.constraints())
    assert reduced(smaller, OPTIONS) is smaller, "nothing can be left out"
    (again,) = checked([smaller.team], OPTIONS)
    assert again.exploration == smaller.exploration


def test_nothing_is_tried_after_the_end_of_the_time() -> None:
    found = faulty(17)
    assert reduced(found, OPTIONS, lambda: True) is found


class Stuck(ABT):
    """Fails in every team."""

    def start(self) -> None:
        raise ValueError("stuck")


def test_one_robot_with_one_value_is_the_smallest_team() -> None:
    with pytest.raises(AssertionError, match=r"Stuck on small-3-2-0-0-reduced, Robot\d has failed: ValueError: stuck"):
        check_protocol(Stuck)
    options = OPTIONS._replace(protocol=Stuck)
    (found,) = checked([faulty(17).team], options)
    smaller = reduced(found, options).team
    assert [[len(one.domain) for one in robot.variables] for robot in smaller.robots] == [[1]]
    assert not [*smaller.constraints()]
