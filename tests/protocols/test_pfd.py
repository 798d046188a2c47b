"""One test per rule of PFD (Choudhury, Mahmud, Khan 2020), named for it."""

from __future__ import annotations

from dataclasses import replace

import pytest

from robochoc.generators.swarm import swarm
from robochoc.model.assembly import assemble
from robochoc.model.constraint import Constraint, Domain, Function, Predicate, Variable
from robochoc.model.cost_units import CostUnits
from robochoc.model.costs import normalized
from robochoc.model.expression import Type, parse
from robochoc.model.expression.fixed_point import VALUE_PLACES
from robochoc.model.outcome import Verdict
from robochoc.model.problem import ProblemKind, Team
from robochoc.model.real import RealInterval, RealParameters, grid
from robochoc.model.team_edits import on_intervals
from robochoc.protocols.local_search.pfd import PFD, Fitness, Improved, Positions
from robochoc.protocols.settings import read_settings
from robochoc.protocols.shared.anytime import Place
from robochoc.run.options import Options, Runtime
from robochoc.run.orchestrator import solve
from tests.support.agents import assert_refused, replies, robot_of
from tests.support.examples import drawn
from tests.support.real_teams import PLACES, real_constraint, real_team


def apart() -> Team:
    return real_team(real_constraint("p", "abs(X - Y)", ("x", "xb")), real_constraint("s", "abs(X - 1.3)", ("x",)))


def robot(name: str, *chances: float, chance: float = 0.0, **settings: str) -> PFD:
    """Return a robot in the tree whose root is RA; `chances` are drawn for its positions, then `chance`."""
    it = robot_of(PFD, on_intervals(normalized(apart())), name, *chances)
    it.settings = read_settings(PFD, {"particles": str(len(chances)), **settings})  # type: ignore[assignment, misc]
    it.start()
    other = "RB" if name == "RA" else "RA"
    first = Place("RA", 1, "RA", None, None) if name == "RA" else Place("RA", 0, None, None, None)
    replies(it, (other, Place(other, 0, None, None, None)), (other, first))
    if it.cycle < 0:
        replies(it, (other, Place("RA", 1, "RA", 0, None) if name == "RA" else Place("RA", 0, None, 1, 1)))
    assert it.cycle == 0
    it.chance = lambda: chance
    return it


def test_costs_of_positions_between_grid_points_are_added_up_to_the_root() -> None:
    lower = robot("RB", 0.2, 0.55)
    ((receiver, fitness),) = replies(lower, ("RA", Positions([(17,), (50,)])))
    assert receiver == "RA"
    assert isinstance(fitness, Fitness)
    assert fitness.costs == [(0, 300_000), (0, 500_000)]  # |1.7 - 2.0| and |5.0 - 5.5|, with six decimal places
    root = robot("RA", 0.17, 0.5)
    sent = dict(replies(root, ("RB", fitness)))
    assert root.least == [(0, 700_000), (0, 4_200_000)]  # and |x - 1.3|
    assert sent["RB"] is not None
    assert root.assignment == {"x": 17}


def test_the_velocity_is_the_sum_of_inertia_and_both_attractions() -> None:
    it = robot("RB", 0.2, 0.6, chance=0.5, w="0.5", c1="1", c2="2")
    replies(it, ("RA", Positions([(0,), (0,)])))
    replies(it, ("RA", Improved([0, 1], 0, last=False)))
    slow = it.particles[1]
    assert slow.velocity == [pytest.approx(0.5 * 0 + 0.5 * 1 * (60 - 60) + 0.5 * 2 * (20 - 60))]
    assert slow.position == [pytest.approx(20)]
    replies(it, ("RA", Positions([(0,), (0,)])))
    replies(it, ("RA", Improved([], None, last=False)))
    assert slow.velocity == [0.0]  # 0.5 * -40 + 0.5 * (60 - 20) + 0 * (20 - 20)


def test_particles_stop_at_the_ends_of_the_interval() -> None:
    it = robot("RB", 0.0, 1.0, chance=1.0, c1="10", c2="10")
    replies(it, ("RA", Positions([(0,), (0,)])))
    replies(it, ("RA", Improved([0, 1], 0, last=False)))
    assert (it.particles[1].position, it.particles[1].velocity) == ([0.0], [0.0])


def test_the_radius_is_halved_after_failures_and_doubled_after_successes() -> None:
    it = robot("RB", 0.2)
    radius = it.radius
    for number in range(7):
        replies(it, ("RA", Positions([(0,)])))
        replies(it, ("RA", Improved([], 0 if number == 0 else None, last=False)))
    assert it.radius == radius / 2
    for _ in range(16):
        replies(it, ("RA", Positions([(0,)])))
        replies(it, ("RA", Improved([0], 0, last=False)))
    assert it.radius == radius


def test_messages_that_cannot_be_are_refused() -> None:
    wrong = [
        ("RA", Positions([(101,)])),
        ("RA", Positions([(1,), (2,)])),
        ("RA", Fitness([(0, 1)])),
        ("RA", Improved([], 0, last=False)),
    ]
    assert_refused(lambda: robot("RB", 0.2), wrong, "RA")

    def evaluated() -> PFD:
        it = robot("RB", 0.2)
        replies(it, ("RA", Positions([(0,)])))
        return it

    assert_refused(evaluated, [("RA", Improved([1], 0, last=False)), ("RA", Improved([0], None, last=False))], "RA")
    costs = [Fitness([(0, float("nan"))]), Fitness([(0, -1)]), Fitness([])]
    assert_refused(lambda: robot("RA", 0.2), [("RB", one) for one in costs], "RB")


def test_the_cost_of_the_best_position_never_rises() -> None:
    seed, costs = drawn("swarms of particles").randint(0, 99), []
    for cycles in ("1", "5", "25"):
        settings = {"cycles": cycles, "particles": "10"}
        outcome = solve(
            swarm(agents=4),
            Options(protocol="pfd", runtime=Runtime.SIMULATOR, seed=seed, settings=settings, repair=False),
        )
        costs.append((outcome.cost is None, outcome.cost or 0))
    assert costs == sorted(costs, reverse=True)


@pytest.mark.parametrize("protocol", ["pfd", "c-cocoa"])
def test_the_network_runtime_finds_the_same_answer_as_the_simulator(protocol: str) -> None:
    settings = {"cycles": "3", "particles": "3"} if protocol == "pfd" else {}
    options = Options(protocol=protocol, runtime=Runtime.SIMULATOR, settings=settings)
    simulated, networked = (
        solve(apart(), replace(options, runtime=runtime)) for runtime in (Runtime.SIMULATOR, Runtime.NETWORK)
    )
    assert (networked.cost, networked.lost) == (simulated.cost, ())
    assert networked.assignment == simulated.assignment


def test_robots_may_have_real_and_other_variables() -> None:
    domain = Domain("D", grid(0, 100, 3), real=RealInterval(0, 100, PLACES))
    owned = {"RA": [Variable("x", domain), Variable("n", Domain("N", (range(3),)))], "RB": [Variable("xb", domain)]}
    above = Predicate(
        "above", ("X", "N"), parse("lt(X, 14 + N)", ("X", "N"), Type.BOOLEAN), real=RealParameters(("X",), PLACES)
    )
    below = Function("below", ("N",), parse("if(lt(N, 2), 500000, 0)", ("N",), Type.INTEGER), places=VALUE_PLACES)
    constraints = [
        real_constraint("h", "ge(X, Y + 1)", ("x", "xb"), hard=True),
        Constraint("i", above, ("x", "n"), ("x", "n")),
        real_constraint("s", "abs(X - 1.3)", ("x",)),
        Constraint("c", below, ("n",), ("n",)),
    ]
    team = assemble("three", owned, constraints, kind=ProblemKind.DISWCSP, costs=CostUnits(places=VALUE_PLACES))
    outcome = solve(team, Options(protocol="pfd", runtime=Runtime.SIMULATOR))
    assert (outcome.verdict, outcome.cost) == (Verdict.OPTIMAL, 0)
    assert {name: outcome.assignment[name] for name in "xn"} == {"x": 13, "n": 2}
    assert outcome.assignment["xb"] <= 3
