"""The repair of assignments that violate hard constraints, after any incomplete protocol and in any runtime."""

from __future__ import annotations

from dataclasses import replace
from itertools import combinations
from random import Random

import pytest

from robochoc.model.assembly import assemble
from robochoc.model.expression import Type, parse
from robochoc.model.outcome import Outcome, Verdict
from robochoc.model.problem import Constraint, Domain, Predicate, ProblemKind, Relation, Semantics, Team, Variable
from robochoc.run import Options, Runtime, solve
from robochoc.run.evaluation import check_assignment
from robochoc.run.options import AnswerRule
from robochoc.run.registry import installed_protocols
from tests.support.cases import looped
from tests.support.cost_problems import with_costs
from tests.support.problems import team_of

SIMULATOR = Options(protocol="dsa", runtime=Runtime.SIMULATOR, cache=False)
INCOMPLETE = [
    one.name
    for one in installed_protocols()
    if one.protocol is not None
    and one.protocol.traits.costs
    and not one.protocol.traits.complete
    and not one.protocol.traits.allocates
    and not one.protocol.traits.secret_keys
    and one.protocol.__module__.startswith("robochoc.")
]


def berths(chance: Random, robots: int = 5) -> Team:
    """A third of the robots fit into each of three berths, which differ in their costs. A solution is easy to see."""
    names = [f"R{number}" for number in range(robots)]
    variables = {name: [Variable(f"{name}.at", Domain("D", (range(3),)))] for name in names}
    scope = tuple(own.name for (own,) in variables.values())
    constraints = []
    letters = tuple("ABCDEFG"[:robots])
    for berth in range(3):
        terms = ",".join(f"if(eq({letter},{berth}),1,0)" for letter in letters)
        text = f"le(add({terms}),{-(-robots // 3)})"
        definition = Predicate(f"P{berth}", letters, parse(text, letters, Type.BOOLEAN))
        constraints.append(Constraint(f"C{berth}", definition, scope, scope))
    for name in scope:
        costs = Relation(f"U{name}", 1, Semantics.SOFT, ((0,), (1,)), (chance.randint(0, 9), chance.randint(0, 9)), 9)
        constraints.append(Constraint(f"S{name}", costs, (name,), (name,)))
    return assemble("berths", variables, constraints, kind=ProblemKind.DISWCSP)


def colours(chance: Random, robots: int = 8) -> Team:
    """A colouring with three colours and a cost for each; a solution exists."""
    names = [f"R{number}" for number in range(robots)]
    variables = {name: [Variable(f"{name}.c", Domain("D", (range(3),)))] for name in names}
    known = {f"{name}.c": chance.randrange(3) for name in names}
    pairs = [two for two in combinations(known, 2) if known[two[0]] != known[two[1]]]
    differ = Relation("R", 2, Semantics.CONFLICTS, ((0, 0), (1, 1), (2, 2)))
    chosen = sorted(chance.sample(pairs, min(len(pairs), 2 * robots)))
    constraints = [Constraint(f"C{place}", differ, two, two) for place, two in enumerate(chosen)]
    for name in known:
        costs = Relation(f"U{name}", 1, Semantics.SOFT, ((0,), (1,)), (chance.randint(0, 9), chance.randint(0, 9)), 9)
        constraints.append(Constraint(f"S{name}", costs, (name,), (name,)))
    return assemble("colours", variables, constraints, kind=ProblemKind.DISWCSP)


def with_and_without(team: Team, options: Options) -> tuple[Outcome, Outcome]:
    return solve(team, options), solve(team, replace(options, repair=False))


@looped("protocol", INCOMPLETE)
def test_a_repair_follows_only_where_a_hard_constraint_is_violated_and_satisfies_it(protocol: str) -> None:
    """The cycles are few, so that most protocols end with a violated constraint somewhere."""
    chance = Random(5)
    few = (
        {"cycles": "3"}
        if protocol not in {"adpop", "bounded-maxsum", "c-cocoa", "cocoa", "async-maxsum", "duct"}
        else {}
    )
    options = replace(SIMULATOR, protocol=protocol, settings=few)
    for seed in range(1):
        for team in (berths(chance), colours(chance)):
            if protocol == "bounded-maxsum" and team.name == "berths":
                continue
            repaired, bare = with_and_without(team, replace(options, seed=seed))
            if bare.verdict is Verdict.UNKNOWN:
                assert bare.violations is not None
                assert (repaired.verdict, repaired.repair, repaired.violations) == (Verdict.SOLUTION, "gdba", None)
                check_assignment(team, repaired.assignment)
                assert repaired.metrics.messages["Improve"] > 0
            else:
                assert repaired.same_answer(bare)


def broken() -> tuple[Team, Options]:
    """A team and options with which dsa ends with a violated constraint."""
    chance = Random(2)
    while True:
        team = berths(chance)
        options = replace(SIMULATOR, settings={"cycles": "2"})
        if solve(team, replace(options, repair=False)).verdict is Verdict.UNKNOWN:
            return team, options


@pytest.mark.parametrize("protocol", ["p-dsa", "p-maxsum", "p-mgm"])
def test_a_private_search_is_not_repaired(protocol: str) -> None:
    rows = tuple((one, two) for one in (1, 2) for two in (1, 2))
    never = Relation("never", 2, Semantics.CONFLICTS, rows)
    pairs = [Constraint("c", never, two, two) for two in (("A", "B"), ("B", "C"))]
    team = with_costs(team_of(dict.fromkeys("ABC", (1, 2)), pairs))
    outcome = solve(team, replace(SIMULATOR, protocol=protocol, settings={"cycles": "1"}))
    assert outcome.verdict == Verdict.UNKNOWN
    assert outcome.repair is None


def test_a_repair_has_the_same_result_in_every_runtime() -> None:
    team, options = broken()
    found = solve(team, options)
    for runtime in (Runtime.ARRAYS, Runtime.PROCESSES):
        other = solve(team, replace(options, runtime=runtime))
        assert (other.verdict, other.assignment, other.cost) == (found.verdict, found.assignment, found.cost)
        assert (other.metrics.messages, other.metrics.checks) == (found.metrics.messages, found.metrics.checks)


def test_there_is_no_repair_under_other_limits_or_of_a_final_assignment() -> None:
    team, options = broken()
    for other in (replace(options, messages=10**6), replace(options, answer=AnswerRule.FINAL)):
        outcome = solve(team, other)
        assert (outcome.verdict, outcome.repair) == (Verdict.UNKNOWN, None)
        assert outcome.violations is not None


def test_a_place_that_all_have_taken_is_left_by_as_many_as_necessary() -> None:
    """No robot satisfies the capacity by its own move, so each must learn by itself that the place is taken."""
    chance = Random(3)
    for seed in range(6):
        team = berths(chance, robots=7)
        start = dict.fromkeys(team.variables, 0)
        options = replace(SIMULATOR, protocol="mgm", seed=seed, settings={"cycles": "1"}, start=start)
        outcome = solve(team, options)
        assert (outcome.verdict, outcome.repair) == (Verdict.SOLUTION, "gdba")
