"""The central solver on costs: the least cost, the fewest aside, and second opinions."""

from __future__ import annotations

import itertools
import json
from dataclasses import replace
from fractions import Fraction
from pathlib import Path
from random import Random

import pytest

from robochoc.formats import PREDEFINED, write_team
from robochoc.generators.coloring import coloring
from robochoc.generators.queens3d import queens3d
from robochoc.model.cost_units import CostUnits
from robochoc.model.outcome import Outcome, Verdict
from robochoc.model.problem import INFINITE, Constraint, Predicate, Relation, Semantics, Team
from robochoc.protocols.message import Message
from robochoc.protocols.protocol import Protocol
from robochoc.protocols.traits import Traits
from robochoc.run import Options, Runtime, Withdrawal, solve
from robochoc.run.options import CentralSolverName
from robochoc.solver.ace import AceProcess
from robochoc.solver.ace_messages import AceSolutions
from robochoc.solver.central import CentralAnswer, CentralSolver
from robochoc.solver.errors import SolverLostError, UnsupportedError
from robochoc.verification.checker import RefutedError, robots_without_values, violations
from robochoc.verification.objective import withdrawal_cost
from robochoc.verification.second_opinion import contradiction
from tests.support.brute_force import least_cost
from tests.support.cases import looped
from tests.support.complex_problems import complex_team, random_complex_team
from tests.support.cost_problems import (
    cost_of,
    minimum_withdrawal,
    random_complex_cost_team,
    random_cost_team,
    with_costs,
)
from tests.support.pkc_problems import random_pkc_team, with_constraints
from tests.support.problems import random_team, team_of
from tests.support.program import robochoc_within
from tests.support.real_costs import best_cost, random_costs_team
from tests.support.solver_networks import misheard

pytestmark = pytest.mark.usefixtures("shared_solvers")

CENTRAL = Options(protocol="central", central_with=CentralSolverName.ACE)
FEWEST = replace(CENTRAL, withdraw=Withdrawal.MINIMUM)
BATCHES = [0, *(pytest.param(batch, marks=pytest.mark.slow) for batch in range(1, 21))]


def any_cost_team(chance: Random) -> Team:
    return random_cost_team(chance) if chance.random() < 0.7 else random_complex_cost_team(chance)


# --- the least cost ---------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("batch", BATCHES)
def test_the_least_cost_is_brute_forces(batch: int, solver: AceProcess) -> None:
    chance = Random(f"central costs {batch}")
    seen = {Verdict.OPTIMAL: 0, Verdict.NO_SOLUTION: 0}
    for _ in range(100 if batch else 40):
        team = any_cost_team(chance)
        outcome = solve(team, CENTRAL, solver=solver)
        least = least_cost(team)
        assert outcome.verdict is (Verdict.NO_SOLUTION if least == INFINITE else Verdict.OPTIMAL), team
        assert outcome.cost == (None if least == INFINITE else least), team
        assert outcome.verified is (least < INFINITE)
        seen[outcome.verdict] += 1
    assert min(seen.values()) > (3 if batch else 1)


@pytest.mark.parametrize("batch", BATCHES)
def test_costs_with_many_digits_are_exact(batch: int, solver: AceProcess) -> None:
    """Costs up to 10^14 units of up to nine decimal places, added up, are those of fractions."""
    highest = 0
    for seed in range(100 * batch, 100 * batch + (100 if batch else 30)):
        team = random_costs_team(seed, most=10 ** (8 + seed % 7), places=(0, 5, 9))
        outcome = solve(team, CENTRAL, solver=solver)
        best = best_cost(team)
        assert outcome.verdict is (Verdict.NO_SOLUTION if best is None else Verdict.OPTIMAL), seed
        assert (outcome.cost is None) if best is None else (Fraction(outcome.cost or 0) == best), seed
        highest = max(highest, abs(best or 0) * 10 ** team.robots[0].costs.places)
    assert highest > 2**45


def test_costs_that_are_too_high_are_reported_in_the_users_numbers() -> None:
    high = Relation("H", 2, Semantics.SOFT, ((0, 0), (0, 1)), (2**52, 3), 0)
    domains = dict.fromkeys("ABCD", (0, 1))
    constraints = [Constraint("".join(pair), high, pair, pair) for pair in itertools.combinations(domains, 2)]
    team = with_costs(team_of(domains, constraints))
    units = CostUnits(places=9)
    team = replace(team, robots=tuple(replace(robot, costs=units) for robot in team.robots))
    told = r"add up to 27,021,597\.764222976, .* up to 9,007,199\.254740992:"
    with pytest.raises(UnsupportedError, match=told):
        solve(team, CENTRAL)


def test_both_parts_of_a_partially_known_constraint_are_paid(solver: AceProcess) -> None:
    chance = Random("central PKC costs")
    for _ in range(25):
        team = random_pkc_team(chance)
        team = with_costs(with_constraints(team, lambda _, one: softened_one(one, chance)))
        least = least_cost(team)
        assert solve(team, CENTRAL, solver=solver).cost == (None if least == INFINITE else least)


def softened_one(constraint: Constraint, chance: Random) -> Constraint:
    """`constraint`, which only costs something if it is a predicate."""
    if not isinstance(constraint.definition, Predicate) or chance.random() < 0.3:
        return constraint
    return replace(constraint, cost=chance.randint(0, 9))


def test_parts_that_share_nothing_are_added(solver: AceProcess) -> None:
    """Together they would have 3^60 assignments, and a JVM is asked for one part at a time."""
    table = Relation("R", 2, Semantics.SOFT, ((1, 1), (2, 3)), (2, 3), 7)
    owned = {f"R{number}": [f"A{number}", f"B{number}"] for number in range(30)}
    domains = {name: (1, 2, 3) for names in owned.values() for name in names}
    constraints = [Constraint("C", table, (a, b), (a, b)) for a, b in owned.values()]
    team = with_costs(complex_team(owned, domains, constraints))
    assert solve(team, CENTRAL, solver=solver).cost == 60


def test_costs_are_compared_in_units_of_their_divisor(solver: AceProcess) -> None:
    """ACE's codes are small; what constraints charge in any case, and what all charges have in common, is left out."""
    million, billion = 10**6, 10**17
    for low, high in ((billion, billion + million), (0, billion), (7, 7)):
        table = Relation("R", 2, Semantics.SOFT, ((1, 1), (2, 2)), (high, high), low)
        constraints = [Constraint("C", table, pair, pair) for pair in itertools.combinations("ABC", 2)]
        team = with_costs(team_of(dict.fromkeys("ABC", (1, 2)), constraints))
        assert solve(team, CENTRAL, solver=solver).cost == 2 * low + high == least_cost(team)


def test_costs_beyond_what_solvers_can_add_are_refused(solver: AceProcess) -> None:
    table = Relation("R", 2, Semantics.SOFT, ((1, 1), (2, 2)), (10**17, 3), 0)
    team = with_costs(team_of({"A": (1, 2), "B": (1, 2)}, [Constraint("C", table, ("A", "B"), ("A", "B"))]))
    with pytest.raises(UnsupportedError, match=r"add up to 100,000,000,000,000,000, .* by infinity"):
        solve(team, CENTRAL, solver=solver)


def test_a_soft_constraint_with_too_many_prices_is_refused() -> None:
    domains = {"A": range(1100), "B": range(1100)}
    team = with_costs(team_of(domains, [Constraint("C7", PREDEFINED["ne"], ("A", "B"), ("A", "B"), cost=2)]))
    with pytest.raises(UnsupportedError, match="constraint C7 has costs for 1,210,000 combinations"):
        solve(team, CENTRAL)


def test_counting_is_for_problems_without_costs() -> None:
    with pytest.raises(UnsupportedError, match=r"has costs \(DCOP\), so every assignment"):
        solve(coloring(3, 2, 2), replace(CENTRAL, count=True))


def test_an_answer_that_does_not_cost_what_the_judge_says_is_none(monkeypatch: pytest.MonkeyPatch) -> None:
    team = coloring(3, 2, 2)
    wrong = CentralAnswer(Verdict.OPTIMAL, dict.fromkeys(team.variables, 1), cost=1, bound=1)
    monkeypatch.setattr(CentralSolver, "solve", lambda *_, **__: wrong)
    with pytest.raises(SolverLostError, match="reports a cost of 1, but its answer costs 3"):
        solve(team, CENTRAL)


@pytest.mark.usefixtures("warm_ace")
def test_a_search_that_broke_off_proves_no_optimum(monkeypatch: pytest.MonkeyPatch) -> None:
    misheard(monkeypatch, AceSolutions(found=1, complete=False, solutions=b"\0" * 4 * 6))
    with pytest.raises(SolverLostError, match="stopped before"):
        CentralSolver(always_ace=True).solve(coloring(3, 2, 2))


# --- the fewest aside -------------------------------------------------------------------------------------------------


def least_total(team: Team) -> float:
    """What the cheapest choice of robots that withdraw costs, and the cheapest answer of the others."""
    best = INFINITE
    price = withdrawal_cost(team)
    for flying in itertools.product((True, False), repeat=len(team.robots)):
        there = [robot for robot, flies in zip(team.robots, flying, strict=True) if flies]
        own = {variable.name: variable.domain for robot in there for variable in robot.variables}
        met = [constraint for constraint in team.constraints() if own.keys() >= {*constraint.variables}]
        paid = price * sum(robot.weight for robot in team.robots if robot not in there)
        for values in itertools.product(*own.values()):
            best = min(best, paid + cost_of(dict(zip(own, values, strict=True)), met))
    return best


def weighed(team: Team, chance: Random) -> Team:
    return replace(team, robots=tuple(replace(robot, weight=chance.choice((1, 1, 2, 3))) for robot in team.robots))


@pytest.mark.parametrize("batch", BATCHES[:8])
def test_as_few_as_possible_step_aside_by_weight(batch: int, solver: AceProcess) -> None:
    chance = Random(f"central fewest {batch}")
    aside = 0
    for _ in range(60 if batch else 30):
        team = weighed(random_team(chance) if chance.random() < 0.7 else random_complex_team(chance), chance)
        outcome = solve(team, FEWEST, solver=solver)
        assert sum(team[name].weight for name in outcome.withdrawn) == minimum_withdrawal(team)
        assert outcome.verdict is (Verdict.OPTIMAL if outcome.withdrawn else Verdict.SOLUTION)
        assert not list(violations(team, outcome.assignment, outcome.withdrawn))
        aside += bool(outcome.withdrawn)
    assert (10 if batch else 5) < aside < (50 if batch else 25)


@pytest.mark.parametrize("batch", BATCHES[:8])
def test_among_the_fewest_aside_costs_are_least(batch: int, solver: AceProcess) -> None:
    """A robot of several variables is there as a whole or not at all; constraints go with any of their robots."""
    chance = Random(f"central fewest costs {batch}")
    aside = 0
    for _ in range(40):
        team = weighed(any_cost_team(chance), chance)
        while len(team.variables) > 5:
            team = weighed(any_cost_team(chance), chance)
        if chance.random() < 0.5:
            team = with_constraints(team, lambda _, one: replace(one, cost=INFINITE))
        outcome = solve(team, FEWEST, solver=solver)
        away = sum(team[name].weight for name in outcome.withdrawn)
        assert outcome.verdict is Verdict.OPTIMAL
        assert outcome.cost is not None
        assert away * int(withdrawal_cost(team)) + outcome.cost == least_total(team), team
        aside += bool(away)
    assert aside > 2


@looped(("n", "model", "flying"), [(3, "planar", 5), (3, "full", 4), (4, "planar", 10), (4, "full", 7)])
def test_so_many_queens_can_stay(n: int, model: str, flying: int, solver: AceProcess) -> None:
    outcome = solve(queens3d(n, model), FEWEST, solver=solver)
    assert outcome.verdict is Verdict.OPTIMAL
    assert len(outcome.assignment) == flying == n * n - len(outcome.withdrawn)


def test_everybody_may_have_to_step_aside(solver: AceProcess) -> None:
    never = Relation("never", 1, Semantics.SUPPORTS, ())
    alone = [Constraint("C", never, (name,), (name,)) for name in ("A", "B")]
    outcome = solve(team_of({"A": (1, 2), "B": (1, 2)}, alone), FEWEST, solver=solver)
    assert (outcome.verdict, outcome.withdrawn, outcome.assignment) == (Verdict.OPTIMAL, ("RA", "RB"), {})


def test_there_is_nothing_to_count_where_robots_step_aside() -> None:
    with pytest.raises(UnsupportedError, match="--count counts solutions for all robots"):
        solve(queens3d(3), replace(FEWEST, count=True))


def test_maximal_is_for_the_robots() -> None:
    with pytest.raises(UnsupportedError, match="--withdraw minimum"):
        solve(queens3d(3), replace(CENTRAL, withdraw=Withdrawal.MAXIMAL))


# --- the second opinion -----------------------------------------------------------------------------------------------


class Silent(Protocol):
    """Chooses, and never says or hears a word."""

    traits = Traits(costs=True, complete=True)
    messages = Message

    def receive(self, sender: str, message: Message) -> None:
        """Nobody speaks."""


class Cheapest(Silent):
    """Takes what costs it least itself, and calls that the best for all."""

    def start(self) -> None:
        """Choose."""
        problem = self.problem
        self.value = min(range(len(problem.values)), key=problem.charges.__getitem__)


class OnlyTheFirst(Silent):
    """The first robot stays, all others withdraw."""

    def start(self) -> None:
        """Choose."""
        self.value = 0 if not self.problem.parents else len(self.problem.values) - 1


def claimed(
    protocol: type[Protocol], team: Team, patch: pytest.MonkeyPatch, withdraw: Withdrawal | None = None
) -> Outcome:
    patch.setattr("robochoc.run.orchestrator.protocol_named", lambda _: protocol)
    return solve(team, Options(runtime=Runtime.SIMULATOR, verify=True, withdraw=withdraw))


def test_a_least_cost_that_the_judge_finds_too_is_confirmed(monkeypatch: pytest.MonkeyPatch) -> None:
    unary = Relation("U", 1, Semantics.SOFT, ((1,), (2,)), (5, 4), 0)
    alone = [Constraint("U", unary, (name,), (name,)) for name in ("A", "B")]
    team = with_costs(team_of({"A": (1, 2), "B": (1, 2)}, alone))
    outcome = claimed(Cheapest, team, monkeypatch)
    assert (outcome.verdict, outcome.cost, outcome.verified, outcome.confirmed) == (Verdict.OPTIMAL, 8, True, True)


def test_a_cost_that_is_not_the_least_is_refuted(monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(RefutedError, match=r"the least cost, 3, but the central solver has found one that costs 1$"):
        claimed(Cheapest, coloring(3, 2, 2), monkeypatch)


def test_more_aside_than_need_be_is_refuted(monkeypatch: pytest.MonkeyPatch) -> None:
    """Nobody could be added, and yet: without the first, all others could stay."""
    pairs = [("A", name) for name in ("B", "C", "D")]
    star = team_of(dict.fromkeys("ABCD", (1,)), [Constraint("C", PREDEFINED["ne"], pair, pair) for pair in pairs])
    with pytest.raises(RefutedError, match=r"the least cost, 3, but the central solver has found one that costs 1$"):
        claimed(OnlyTheFirst, star, monkeypatch, withdraw=Withdrawal.MINIMUM)
    heavy = replace(star, robots=(replace(star.robots[0], weight=3), *star.robots[1:]))
    outcome = claimed(OnlyTheFirst, heavy, monkeypatch, withdraw=Withdrawal.MINIMUM)
    assert (outcome.withdrawn, outcome.confirmed) == (("RB", "RC", "RD"), True)


def test_what_contradicts_a_claim() -> None:
    none, found = CentralAnswer(Verdict.NO_SOLUTION), CentralAnswer(Verdict.OPTIMAL, {"A": 1}, cost=3, bound=3)
    broken_off = CentralAnswer(Verdict.UNKNOWN, {"A": 1}, cost=7, bound=2)
    assert contradiction(none, INFINITE) is None
    assert contradiction(none, 3) == "none"
    assert contradiction(found, INFINITE) == "one"
    assert contradiction(found, 3) is None
    assert contradiction(found, 4) == "one that costs 3"
    assert contradiction(found, 2) == "that nothing costs less than 3"
    assert contradiction(broken_off, 5) is None
    assert contradiction(broken_off, INFINITE) == "one"
    assert contradiction(CentralAnswer(Verdict.UNKNOWN, bound=2), INFINITE) is None


def test_a_no_solution_of_costs_is_refuted_too(monkeypatch: pytest.MonkeyPatch) -> None:
    class Never(Silent):
        def start(self) -> None:
            self.conclude(Verdict.NO_SOLUTION)

    with pytest.raises(RefutedError, match="has no solution, but the central solver has found one"):
        claimed(Never, coloring(3, 2, 2), monkeypatch)


# --- on the command line ----------------------------------------------------------------------------------------------


@pytest.mark.usefixtures("warm_ace")
def test_the_program_tells_who_steps_aside(four: Path) -> None:
    done = robochoc_within("solve", four, "--protocol", "central", "--withdraw=fewest", "--json")
    assert done.returncode == 0, done.stderr
    result = json.loads(done.stdout)
    assert (result["verdict"], len(result["withdrawn"]), result["verified"]) == ("optimal", 6, True)


@pytest.mark.usefixtures("warm_ace")
def test_the_program_refuses_to_count_costs(tmp_path: Path) -> None:
    write_team(coloring(3, 2, 2), tmp_path / "triangle")
    done = robochoc_within("solve", tmp_path / "triangle", "--protocol", "central", "--count")
    assert (done.returncode, done.stdout) == (2, "")
    assert "every assignment that satisfies the hard constraints is a solution" in done.stderr
    optimum = robochoc_within("solve", tmp_path / "triangle", "--protocol", "central", "--json")
    assert json.loads(optimum.stdout)["cost"] == 1


def test_absent_is_who_has_no_value() -> None:
    team = team_of({"A": (1,), "B": (1,)}, [])
    assert robots_without_values(team, {"B": 1}) == ("RA",)
