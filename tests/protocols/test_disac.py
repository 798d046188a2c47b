"""Distributed arc consistency (Hamadi 2002): its rules, its fixpoint, and that it takes no solution away."""

from __future__ import annotations

import itertools
from dataclasses import replace
from functools import partial
from random import Random

import pytest

from robochoc.communication.simulator.schedule import RandomChannels
from robochoc.communication.simulator.simulator import Simulation
from robochoc.generators.random_csp import random_csp
from robochoc.model.outcome import Verdict
from robochoc.model.problem import Constraint, Relation, Semantics, Team
from robochoc.protocols.satisfaction.disac import Del, DisAC, Domain
from robochoc.replay.replay import replay
from robochoc.run import Options, Runtime, Withdrawal, solve
from robochoc.run.options import Preprocess
from robochoc.run.registry import protocol_named, protocol_names
from robochoc.solver.agent_problem import agent_problems
from robochoc.solver.compile import TeamCompiler, TeamCompileTimeoutError
from robochoc.solver.compiled_team import CompiledTeam
from robochoc.solver.errors import UnsupportedError
from tests.support.agents import replies, robot_of, started, started_robot
from tests.support.cases import looped
from tests.support.examples import count
from tests.support.limits import HANG_S
from tests.support.loose_problems import check_against_brute_force, loose_team
from tests.support.pkc_problems import pkc_pair, pkc_part
from tests.support.problems import random_team, team_of
from tests.support.random_options import random_options
from tests.support.recorded_journals import record
from tests.support.small_teams import pair, triangle

AC = Options(runtime=Runtime.SIMULATOR, preprocess=Preprocess.AC)
COMPLETE = [name for name in protocol_names() if protocol_named(name).traits.complete]


def below(left: str, right: str) -> Constraint:
    """`left` < `right`, for values from 1 to 4."""
    rows = tuple((a, b) for a in range(1, 5) for b in range(1, 5) if a < b)
    return Constraint(f"{left}{right}", Relation("less", 2, Semantics.SUPPORTS, rows), (left, right), (left, right))


def chain(*values: int) -> Team:
    """A < B < C."""
    return team_of(dict.fromkeys("ABC", values), [below("A", "B"), below("B", "C")])


agent = partial(started_robot, DisAC)


def three(*values: int) -> Domain:
    return Domain(tuple((value,) for value in values))


def test_the_domain_is_told_to_all_that_share_a_constraint() -> None:
    robot = robot_of(DisAC, chain(1, 2, 3), "RB")
    assert started(robot) == [("RA", three(1, 2, 3)), ("RC", three(1, 2, 3))]


def test_nothing_is_revised_before_all_domains_are_known() -> None:
    robot = agent(chain(1, 2, 3), "RB")
    assert replies(robot, ("RA", three(1, 2, 3))) == []
    assert robot.findings.left == (0, 1, 2)


def test_values_without_a_support_are_removed_and_told_where_they_were_the_last_support() -> None:
    robot = agent(chain(1, 2, 3), "RB")
    said = replies(robot, ("RA", three(1, 2, 3)), ("RC", three(1, 2, 3)))
    assert robot.findings.left == (1,)
    assert said == [("RA", Del((0, 2))), ("RC", Del((0, 2)))]


def test_a_removal_that_takes_no_last_support_is_not_told() -> None:
    team = team_of({"A": (1, 2, 3, 4), "B": (1, 2, 3, 4), "C": (2, 3, 4)}, [below("A", "B"), below("B", "C")])
    robot = agent(team, "RB")
    said = replies(robot, ("RA", three(1)), ("RC", three(3, 4)))
    assert said == []
    assert robot.findings.left == (1, 2)


def test_an_empty_domain_ends_with_no_solution() -> None:
    robot = agent(chain(1, 2), "RB")
    assert replies(robot, ("RA", three(1, 2)), ("RC", three(1, 2))) == []
    assert robot.verdict is Verdict.NO_SOLUTION


def test_a_value_that_is_not_there_cannot_be_removed() -> None:
    with pytest.raises(ValueError, match="value number 4, but has only 3 values"):
        replies(agent(chain(1, 2, 3), "RB"), ("RA", three(1, 2, 3)), ("RA", Del((3,))))


def fixpoint(team: Team) -> dict[str, set[int]]:
    """The largest arc consistent domains, by a central loop; a robot has one variable.

    Constraints over the same variables count as one.
    """
    domains = {name: {*variable.domain} for name, variable in team.variables.items()}
    together: dict[tuple[str, ...], list[Constraint]] = {}
    for constraint in team.constraints():
        together.setdefault(tuple(sorted(set(constraint.variables))), []).append(constraint)
    changed = True
    while changed:
        changed = False
        for names, constraints in together.items():
            rows = [
                row
                for row in itertools.product(*(sorted(domains[name]) for name in names))
                if all(one.allows(dict(zip(names, row, strict=True))) for one in constraints)
            ]
            for place, name in enumerate(names):
                supported = {row[place] for row in rows}
                changed |= supported < domains[name]
                domains[name] &= supported
    return domains


def test_constraints_over_the_same_robots_count_as_one() -> None:
    """Each by itself has a support for every value."""
    same = Constraint("S", Relation("S", 2, Semantics.SUPPORTS, ((1, 1), (2, 2), (3, 3))), ("A", "B"), ("A", "B"))
    other = Constraint("O", Relation("O", 2, Semantics.SUPPORTS, ((1, 1), (2, 3), (3, 2))), ("A", "B"), ("A", "B"))
    robot = agent(team_of(dict.fromkeys("AB", (1, 2, 3)), [same, other]), "RB")
    replies(robot, ("RA", three(1, 2, 3)))
    assert robot.findings.left == (0,)


@count("problems", 25, 2000)
def test_what_is_left_is_the_central_fixpoint_under_every_schedule(problems: int) -> None:
    chance, proofs = Random(0), 0
    for seed in range(problems):
        team = random_team(chance)
        result = Simulation(team, DisAC, RandomChannels(seed)).run(HANG_S)
        expected = fixpoint(team)
        if not all(expected.values()):
            assert result.verdict is Verdict.NO_SOLUTION
            proofs += 1
            continue
        assert result.verdict is Verdict.SOLUTION
        problem = agent_problems(team)
        for name, findings in result.findings.items():
            own = {problem[name].domain.values[place] for place in findings.left or ()}
            (variable,) = team[name].variables
            seen = {(value,) for value in expected[variable.name]} if team[name].interface else own
            assert own == seen, name
    assert proofs


@count("problems", 25, 2000)
def test_verdict_and_cost_are_the_same_whatever_the_protocol(problems: int) -> None:
    chance, removed = Random(1), 0
    for _ in range(problems):
        protocol = chance.choice(COMPLETE)
        costs = protocol_named(protocol).traits.costs and chance.random() < 0.7
        team = loose_team(protocol, chance, costs=costs)
        options = replace(random_options(team, protocol, chance), preprocess=Preprocess.AC)
        try:
            outcome = check_against_brute_force(team, options)
        except UnsupportedError as refused:
            assert "(PKC" in str(refused)  # noqa: PT017 - what else is refused is a fault
            continue
        removed += outcome.preprocessing.removed if outcome.preprocessing else 0
    assert removed > problems


@count("problems", 2, 30)
def test_the_same_in_processes(problems: int) -> None:
    chance = Random(2)
    for _ in range(problems):
        protocol = chance.choice(COMPLETE)
        team = random_team(chance, n_ary=protocol_named(protocol).traits.n_ary)
        check_against_brute_force(team, Options(protocol=protocol, preprocess=Preprocess.AC, timeout=HANG_S))


@count("problems", 6, 200)
def test_who_withdraws_is_decided_with_whole_domains(problems: int) -> None:
    chance = Random(3)
    for _ in range(problems):
        team = random_team(chance)
        for withdraw in Withdrawal:
            options = replace(AC, protocol="abt", withdraw=withdraw)
            before, after = (solve(team, replace(options, preprocess=one)) for one in (None, Preprocess.AC))
            assert len(before.withdrawn) == len(after.withdrawn)


def test_what_it_takes_is_counted_apart_and_what_it_saves_shows() -> None:
    team = chain(1, 2, 3, 4)
    plain, before = (solve(team, replace(AC, protocol="abt", preprocess=one)) for one in (None, Preprocess.AC))
    assert before.preprocessing is not None
    assert (before.preprocessing.removed, before.preprocessing.values) == (6, 12)
    assert before.preprocessing.metrics.messages["Domain"] == 4
    assert "Domain" not in before.metrics.messages
    assert before.metrics.checks < plain.metrics.checks


def test_no_protocol_begins_where_a_domain_becomes_empty() -> None:
    outcome = solve(pair(), replace(AC, protocol="abt"))
    assert outcome.verdict is Verdict.NO_SOLUTION
    assert outcome.witness in {"RA", "RB"}
    assert not outcome.metrics.messages


def test_a_limit_may_end_it() -> None:
    outcome = solve(random_csp(12, 4, 0.5, 0.4), replace(AC, protocol="abt", messages=3))
    assert outcome.verdict is Verdict.UNKNOWN
    assert outcome.reason == "the limit of messages was reached (--messages 3)"


def test_what_it_took_is_told_where_the_time_is_over_after_it(monkeypatch: pytest.MonkeyPatch) -> None:
    compiled = TeamCompiler.compile

    def in_time(compiler: TeamCompiler, team: Team, *, every: bool = False) -> CompiledTeam:
        if len(teams) == 2:  # for the run, and for the robots that make their domains consistent
            raise TeamCompileTimeoutError("the time limit was exceeded while RA was compiled")
        teams.append(team)
        return compiled(compiler, team, every=every)

    teams: list[Team] = []
    monkeypatch.setattr(TeamCompiler, "compile", in_time)
    journal = record(chain(1, 2, 3, 4), replace(AC, protocol="abt"))
    outcome = journal.outcome
    assert outcome is not None
    assert (outcome.verdict, outcome.reason) == (Verdict.UNKNOWN, "the time limit was exceeded while RA was compiled")
    assert outcome.preprocessing is not None
    assert outcome.preprocessing.removed == 6
    assert not replay(journal).contradictions


@looped("protocol", ["abt", "sfb"])
@looped("team", lambda: [chain(1, 2, 3, 4), pair()])
def test_its_journal_is_replayed(protocol: str, team: Team) -> None:
    done = replay(record(team, replace(AC, protocol=protocol)))
    assert done.difference is None
    assert not done.contradictions


@looped(
    ("options", "told"),
    [
        (
            replace(AC, runtime=Runtime.NETWORK),
            "--preprocess is only for robots that run as processes or in the simulator",
        ),
        (replace(AC, runtime=Runtime.ARRAYS, protocol="dsa"), "--preprocess is only for robots that run as processes"),
        (
            Options(protocol="central", preprocess=Preprocess.AC),
            "--preprocess is for robots that solve the problem together",
        ),
        (
            replace(AC, protocol="sfb", withdraw=Withdrawal.MINIMUM),
            "--preprocess removes values that are possible if other robots withdraw",
        ),
    ],
)
def test_what_it_does_not_go_with_is_refused(options: Options, told: str) -> None:
    with pytest.raises(UnsupportedError, match=told):
        solve(triangle(), options)


def test_partially_known_constraints_and_problems_that_change_are_refused() -> None:
    with pytest.raises(UnsupportedError, match="--preprocess does not support: remove --preprocess"):
        solve(pkc_pair(pkc_part("AB", (1, 1)), pkc_part("AB")), replace(AC, protocol="abt"))
