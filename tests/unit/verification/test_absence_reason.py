"""The constraints that explain why a team with absent robots has no solution."""

from __future__ import annotations

from dataclasses import replace

from robochoc.model.constraint import Constraint, WhenAbsent
from robochoc.verification.absence_reason import absence_reason
from tests.support.problems import team_of
from tests.support.small_teams import differ


def test_a_reason_names_the_constraints() -> None:
    """Those that must not lose a robot before those that cannot hold, and before those that had to be restated."""

    def reason(*constraints: Constraint, withdrawal: bool = False, values: tuple[int, ...] = (1, 2)) -> str:
        domains = {"A": list(values), "B": list(values)}
        return absence_reason(team_of(domains, list(constraints)), withdrawal=withdrawal)

    fails = replace(differ("A", "B"), name="whole", when_absent=WhenAbsent.FAIL)
    names = [replace(differ("A", "B"), name=f"c{number}", original=fails) for number in range(5)]
    assert reason(differ("A", "B")) == reason(differ("A", "B"), withdrawal=True) == ""
    assert reason(names[0]) == "c0 had to be restated for the robots that are left"
    assert reason(*names) == "c0, c1, c2 and 2 more had to be restated for the robots that are left"
    assert reason(*names, withdrawal=True) == ""
    assert reason(names[0], fails, withdrawal=True) == "the robots of whole must not withdraw (when_absent)"
    assert reason(names[0], values=(1,)) == "c0 cannot hold for the robots that are left"
    lost = replace(names[1], when_absent=WhenAbsent.FAIL)
    assert reason(names[0], lost, values=(1,)) == "c1 must not lose a robot (when_absent)"
