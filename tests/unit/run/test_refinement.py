"""Real variables: finer and finer grids, and bounds that hold for all values."""

from __future__ import annotations

import math
from dataclasses import replace
from decimal import Decimal
from pathlib import Path
from random import Random

import msgspec
import pytest

from robochoc.communication.network.profile import ProfileError, profile_of, visible_robot
from robochoc.generators.swarm import swarm
from robochoc.journal.journal import JournalRecorder, read_journal
from robochoc.model.assembly import assemble
from robochoc.model.constraint import Constraint, Domain, Function, Variable
from robochoc.model.cost_units import CostUnits
from robochoc.model.costs import normalized
from robochoc.model.expression import Type, parse
from robochoc.model.expression.fixed_point import VALUE_PLACES, fixed_point
from robochoc.model.outcome import Outcome, Verdict
from robochoc.model.problem import ProblemKind, Team
from robochoc.model.real import RealInterval, RealParameters, grid
from robochoc.model.symbols import real_places
from robochoc.replay import replay
from robochoc.run.options import Options, Runtime
from robochoc.run.orchestrator import solve
from robochoc.run.recording import journal_header, objective_to_record
from robochoc.run.refinement import solve_on_grids
from robochoc.solver.errors import UnsupportedError
from robochoc.verification import real_bound
from robochoc.verification.checker import check_user_cost, violations
from robochoc.verification.real_bound import certificate
from tests.support.examples import are_the_same, drawn
from tests.support.foreign_problems import imported, written
from tests.support.real_teams import PLACES, best_cost, random_team, real_constraint, with_integers


def _check(team: Team, protocol: str) -> tuple[bool, bool]:
    """Check a run against enumeration. Return whether the answer is proven, and whether it is the best one."""
    outcome = solve(team, Options(protocol=protocol, runtime=Runtime.SIMULATOR))
    best = best_cost(team)
    sign = -1 if team.robots[0].costs.maximize else 1
    if best is None:
        assert outcome.verdict in {Verdict.NO_SOLUTION, Verdict.UNKNOWN}
        return outcome.verdict == Verdict.NO_SOLUTION, True
    assert outcome.verdict != Verdict.NO_SOLUTION
    quick = certificate(team, {}, 200).bound
    assert quick is not None
    assert sign * quick <= sign * best
    if outcome.cost is None:
        return False, False
    assert not list(violations(_whole(team), outcome.assignment))
    check_user_cost(team, outcome.assignment, outcome.cost)
    assert sign * outcome.cost >= sign * best
    if outcome.verdict == Verdict.OPTIMAL:
        assert outcome.cost == best
    else:
        assert outcome.bound is not None
        assert sign * outcome.bound <= sign * best
    return outcome.verdict == Verdict.OPTIMAL, outcome.cost == best


def _whole(team: Team) -> Team:
    """Return `team` with all multiples of the precision in its domains."""
    robots = []
    for robot in team.robots:
        own = []
        for one in robot.variables:
            real = one.domain.real
            ranges = (range(real.low, real.high + 1),) if real else one.domain.ranges
            own.append(replace(one, domain=replace(one.domain, ranges=ranges)))
        robots.append(replace(robot, variables=tuple(own)))
    return replace(team, robots=tuple(robots))


def test_answers_and_bounds_agree_with_enumeration() -> None:
    chance = drawn("real teams")
    for number in range(12):
        team = random_team(chance, chance.randint(1, 2), 30)
        _check(team, ["dpop", "afb", "dsa", "pfd", "c-cocoa"][number % 5])


def test_tables_and_integers_agree_with_enumeration() -> None:
    chance = drawn("mixed teams")
    for number in range(30):
        team = with_integers(random_team(chance, 1, 20), chance)
        is_proven, is_best = _check(team, ["dpop", "afb", "dsa", "pfd", "c-cocoa"][number % 5])
        assert is_proven or best_cost(team) is not None, "small teams without a solution are found"
        assert is_best or number % 5 >= 2 or not is_proven


def test_a_quotient_by_an_interval_from_0_is_bounded() -> None:
    at_least = real_constraint("inverse", "div(1, X)", ("x",))
    domain = Domain("D", grid(0, 20, 3), real=RealInterval(0, 20, PLACES))
    costs = CostUnits(places=VALUE_PLACES)
    team = assemble("one", {"R": [Variable("x", domain)]}, [at_least], kind=ProblemKind.DISWCSP, costs=costs)
    assert certificate(team, {}).bound == best_cost(team) == Decimal("0.5")


def test_bounds_of_quotients_by_constants_in_the_scope() -> None:
    formals = ("X", "Y")
    real = RealParameters(("X",), PLACES, source := parse("div(X, Y)", formals, Type.INTEGER, decimals=True))
    body = fixed_point(source, ("X",), PLACES, Type.INTEGER, VALUE_PLACES)
    function = Function("third", formals, body, real=real, places=VALUE_PLACES)
    domain = Domain("D", grid(-9, -1, 3), real=RealInterval(-9, -1, PLACES))
    third = Constraint("third", function, ("x",), ("x", 3))
    for maximize, best in ((False, "-0.300000"), (True, "-0.033333")):
        costs = CostUnits(maximize=maximize, places=VALUE_PLACES)
        team = assemble("one", {"R": [Variable("x", domain)]}, [third], kind=ProblemKind.DISWCSP, costs=costs)
        bound = certificate(team, {}).bound
        assert bound is not None
        assert best_cost(team) == Decimal(best)
        assert 0 <= (bound - Decimal(best) if maximize else Decimal(best) - bound) <= Decimal("0.000001")


@pytest.mark.slow
def test_300_small_teams() -> None:
    chance = drawn("300 real teams")
    proven = best = 0
    for number in range(300):
        variables = 1 + number % 4
        is_proven, is_best = _check(random_team(chance, variables, [60, 40, 25, 12][variables - 1]), "dpop")
        proven, best = proven + is_proven, best + is_best
    if are_the_same():
        assert (proven, best) == (288, 295)


@pytest.mark.parametrize("protocol", ["dpop", "central"])
def test_grids_that_are_not_refined_prove_nothing(protocol: str) -> None:
    team = random_team(Random(1), 2, 30)
    options = Options(protocol=protocol, runtime=Runtime.SIMULATOR, refine=math.inf)
    outcome = solve(team, options)
    assert outcome.verdict in {Verdict.SOLUTION, Verdict.UNKNOWN}
    assert outcome.bound is None
    with pytest.raises(UnsupportedError, match="--verify confirms optima of integer variables"):
        solve(team, replace(options, verify=True))


@pytest.mark.parametrize("unsolved", [0, 1])
def test_each_grid_has_half_of_the_time_until_the_deadline(unsolved: int, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(real_bound, "EVALUATIONS", 200)
    team, deadline, asked = swarm(agents=2), 1e6, list[float]()

    def solve_grid(now: Team, options: Options, number: int, _: str) -> Outcome:
        asked.append(options.deadline or 0)
        values = {name: next(iter(one.domain)) for name, one in now.variables.items()} if number >= unsolved else {}
        verdict = Verdict.SOLUTION if values else Verdict.UNKNOWN
        cost = 1 if values else None
        bare = Outcome(verdict, team="", protocol="dsa", runtime=Runtime.SIMULATOR, seed=0)
        return replace(bare, assignment=values, cost=cost, deadline=options.deadline)

    outcome = solve_on_grids(team, Options(protocol="dsa", deadline=deadline), solve_grid)
    assert outcome.deadline == deadline
    half = pytest.approx(deadline / 2, rel=0.01)
    assert asked[:3] == [half, deadline if unsolved else half, half]


def test_the_master_learns_of_real_variables_from_profiles() -> None:
    team = random_team(Random(1), 2, 30)
    profiles = [profile_of(robot) for robot in team.robots]
    assert all(one.on_grid for one in profiles)
    shown = Team(team.name, tuple(visible_robot(one, {}) for one in profiles))
    assert real_places(shown) == {name: 1 for one in profiles for name in one.variables}
    with pytest.raises(ProfileError, match="decimal places"):
        visible_robot(msgspec.structs.replace(profiles[0], real_places={"x": 99}), {})


def test_journals_of_refined_runs_replay_and_a_wrong_cost_is_found(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(real_bound, "EVALUATIONS", 200)  # the journal does not contain the bound
    team = swarm(agents=2)
    for protocol, error in (("dpop", 0), ("dsa", 0), ("pfd", 0), ("c-cocoa", 0), ("dpop", 1)):
        options = Options(protocol=protocol, runtime=Runtime.SIMULATOR)
        recorder = JournalRecorder(journal_header(team, options), objective_to_record(normalized(team), options))
        outcome = solve(team, options, observer=recorder)
        assert outcome.cost is not None
        recorder.outcome = replace(outcome, cost=outcome.cost - error)
        again = replay(read_journal(recorder.content()))
        assert not again.differs or error
        assert len(again.contradictions) == error, again


def test_teams_exported_to_pydcop_can_be_imported(tmp_path: Path) -> None:
    team = swarm(agents=2)
    (file,) = written("pydcop", team).values()
    again = imported(file.decode(), tmp_path, "swarm.yaml").team
    assert [len(one.domain) for one in again.variables.values()] == [len(one.domain) for one in team.variables.values()]
