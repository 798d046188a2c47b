"""Costs that people have: decimal, negative, maximised, functions. What a run says is exact, in the user's numbers."""

from __future__ import annotations

import sys
from dataclasses import replace
from decimal import Decimal
from fractions import Fraction
from pathlib import Path
from random import Random

import pytest

from robochoc.communication.kill_schedule import Kill
from robochoc.formats import read_team, write_team
from robochoc.formats.result import read_result, result_json
from robochoc.model.assembly import Extras, assemble
from robochoc.model.costs import normalized, user_cost
from robochoc.model.expression import Type, parse
from robochoc.model.outcome import Verdict
from robochoc.model.problem import (
    AddAgent,
    AddValue,
    Constraint,
    CostUnits,
    Domain,
    Function,
    Predicate,
    ProblemKind,
    Relation,
    RemoveAgent,
    RemoveValue,
    Robot,
    ScenarioEvent,
    Semantics,
    Team,
    Variable,
)
from robochoc.model.team_edits import without_robots
from robochoc.protocols.protocol import Protocol
from robochoc.run.options import OnLoss, Options, Preprocess, Runtime, Withdrawal
from robochoc.run.orchestrator import solve
from robochoc.run.scenario import ScenarioRun
from robochoc.solver.compiled_team import CompiledTeam
from robochoc.solver.errors import UnsupportedError
from robochoc.verification.checker import RefutedError, assignment_cost, check_user_cost
from tests.support.examples import count
from tests.support.losing import Losing
from tests.support.real_costs import best_cost, random_costs_team

PAIR = ("X", "Y")
PRODUCT = Function("product", PAIR, parse("mul(X,Y)", PAIR, Type.INTEGER))
PROTOCOLS = ("central", "adopt", "dpop", "syncbb", "bnb-adopt", "bnb-adopt-fdac", "afb", "sfb")


def in_simulator(protocol: str, *, verify: bool = False) -> Options:
    return Options(protocol=protocol, runtime=Runtime.SIMULATOR, verify=verify)


@count("seeds", 30, 2000)
def test_every_complete_protocol_finds_the_exact_optimum(seeds: int) -> None:
    for seed in range(seeds):
        team = random_costs_team(seed)
        best = best_cost(team)
        for protocol in PROTOCOLS:
            outcome = solve(team, in_simulator(protocol, verify=protocol == "dpop" and seed % 10 == 0))
            told = None if outcome.cost is None else Fraction(outcome.cost)
            assert told == best, (seed, protocol)
            assert read_result(result_json(outcome)).cost == outcome.cost


@pytest.mark.parametrize("runtime", [Runtime.PROCESSES, Runtime.NETWORK])
def test_robots_with_processes_count_the_same(runtime: Runtime) -> None:
    for seed in (0, 5):  # functions, and a utility
        team = random_costs_team(seed)
        best = best_cost(team)
        outcome = solve(team, Options(protocol="adopt", runtime=runtime))
        assert outcome.epochs == ()
        assert (None if outcome.cost is None else Fraction(outcome.cost)) == best


@pytest.mark.slow
@pytest.mark.parametrize("runtime", [Runtime.PROCESSES, Runtime.NETWORK])
def test_who_is_left_after_a_loss_has_the_exact_optimum(runtime: Runtime, tmp_path: Path) -> None:
    """Robots that are killed are lost, or come back in processes of their own."""
    for seed in range(25):
        chance = Random(seed)
        write_team(random_costs_team(seed), tmp_path / str(seed))
        team = read_team(tmp_path / str(seed))
        struck = chance.sample([robot.name for robot in team.robots], min(2, len(team.robots) - 1))
        spares = len(struck) * (runtime is Runtime.PROCESSES and chance.random() < 0.5)
        outcome = solve(
            team,
            Options(
                protocol=chance.choice(PROTOCOLS[1:]),
                runtime=runtime,
                kill=tuple(Kill(robot, after_s=0) for robot in struck),
                on_loss=None if spares else OnLoss.WITHDRAW,
                spares=spares,
            ),
        )
        best = best_cost(without_robots(team, outcome.lost))
        assert (None if outcome.cost is None else Fraction(outcome.cost)) == best, seed


def test_incomplete_protocols_tell_what_their_answer_costs() -> None:
    for protocol in ["dsa", "mgm", "mgm2", "maxsum"]:
        for seed in range(10):
            team = random_costs_team(seed)
            outcome = solve(team, in_simulator(protocol))
            best = best_cost(team)
            if outcome.cost is not None:
                assert best is not None
                better = outcome.cost <= best if team.robots[0].costs.maximize else outcome.cost >= best
                assert better, seed  # and `solve` has checked it against the files


def product(x: range, y: range, costs: CostUnits) -> Team:
    """Two robots whose values should multiply to much."""
    return assemble(
        "product",
        {"a": [Variable("x", Domain("D", (x,)))], "b": [Variable("y", Domain("E", (y,)))]},
        [Constraint("C", PRODUCT, ("x", "y"), ("x", "y"))],
        kind=ProblemKind.DISWCSP,
        costs=costs,
    )


def tutored() -> Team:
    """The product of two numbers up to 2, of which 0.05 is given away."""
    return product(range(3), range(3), CostUnits(maximize=True, places=2, constant=-5))


def test_a_utility_is_told_with_its_decimal_places() -> None:
    outcome = solve(tutored(), in_simulator("adopt"))
    assert outcome.cost == Decimal("3.95")
    assert b'"cost":3.95' in result_json(outcome)
    assert outcome.assignment == {"x": 2, "y": 2}


def test_a_limit_leaves_a_bound_above_the_utility() -> None:
    outcome = solve(tutored(), replace(in_simulator("adopt"), messages=2))
    assert outcome.verdict is Verdict.UNKNOWN
    assert outcome.bound is None or outcome.bound >= Decimal("3.95")


def test_epochs_tell_their_own_costs() -> None:
    events = (ScenarioEvent((RemoveValue("x", 2),)), ScenarioEvent((AddValue("y", 7),)))
    team = replace(tutored(), scenario=events)
    for protocol in ("adopt", "central"):
        outcome = solve(team, in_simulator(protocol))
        assert [epoch.cost for epoch in outcome.epochs] == [Decimal("3.95"), Decimal("1.95"), Decimal("6.95")]


def test_a_value_that_nobody_named_is_refused_where_costs_are_functions() -> None:
    events = iter([ScenarioEvent((AddValue("y", 9),))])
    with pytest.raises(UnsupportedError, match="the value 9 of y is new"):
        solve(tutored(), in_simulator("adopt"), environment=lambda *_: next(events, None))


def test_withdrawal_and_utilities_do_not_go_together() -> None:
    with pytest.raises(UnsupportedError, match="negative costs, or utilities"):
        solve(tutored(), replace(in_simulator("adopt"), withdraw=Withdrawal.MINIMUM))


def test_a_wrong_cost_is_refuted() -> None:
    check_user_cost(tutored(), {"x": 1, "y": 2}, Decimal("1.95"))
    with pytest.raises(RefutedError, match=r"costs 1\.95, but the protocol claims 2"):
        check_user_cost(tutored(), {"x": 1, "y": 2}, 2)


# Constant costs of robots that come and go: each counts while its robot is there


BITS = Domain("D", (range(2),))


def soft(name: str, scope: tuple[str, ...], **costs: int) -> Constraint:
    """A constraint whose tuples, written as words, have these costs."""
    rows = tuple(tuple(map(int, word[1:])) for word in costs)
    return Constraint(name, Relation(name, len(scope), Semantics.SOFT, rows, tuple(costs.values()), 1), scope, scope)


@pytest.mark.parametrize("protocol", ["central", "dpop"])
def test_a_constant_counts_while_its_robot_is_there(protocol: str) -> None:
    start = assemble(
        "t",
        {"a": [Variable("x", BITS)], "b": [Variable("y", BITS)]},
        [soft("c", ("x", "y"), _00=3, _11=-4)],
        kind=ProblemKind.DISWCSP,
        costs=CostUnits(constant=100),
    )
    private = replace(soft("p", ("w",), _0=7, _1=-2), model=None)
    late = Robot("z", (Variable("w", BITS),), ProblemKind.DISWCSP, private=(private,), costs=CostUnits(constant=1000))
    events = (ScenarioEvent((AddAgent(late),)), ScenarioEvent((RemoveAgent("a"),)))
    runtime = Runtime.PROCESSES if protocol == "central" else Runtime.SIMULATOR
    outcome = solve(replace(start, scenario=events), Options(protocol=protocol, runtime=runtime))
    assert [epoch.cost for epoch in outcome.epochs] == [96, 1094, 998]


@pytest.mark.skipif(sys.platform != "linux", reason="robots are killed")
def test_the_constant_of_a_robot_lost_in_the_preprocessing_does_not_count() -> None:
    domains = {"a": [Variable("x", BITS)], "b": [Variable("y", BITS)]}
    costly = [soft("c", ("x", "y"), _00=3)]
    team = assemble("t", domains, costly, kind=ProblemKind.DISWCSP, costs=CostUnits(constant=100))
    options = Options(protocol="dpop", on_loss=OnLoss.WITHDRAW, preprocess=Preprocess.AC, kill=(Kill("a", 0.0),))
    outcome = solve(team, options)
    assert outcome.cost == (0 if outcome.lost else 101)


# Robots that come back, by a scenario or after a loss: costs and symbols are those of the whole team


TENTHS = CostUnits(maximize=True, places=1)


@pytest.mark.parametrize("protocol", ["adopt", "central"])
def test_who_comes_again_with_other_values_costs_what_they_say(protocol: str) -> None:
    poor = product(range(6), range(2), TENTHS)["b"]
    events = (ScenarioEvent((RemoveAgent("b"),)), ScenarioEvent((AddAgent(poor),)))
    team = replace(product(range(6), range(6), TENTHS), scenario=events)
    outcome = solve(team, Options(protocol=protocol, runtime=Runtime.SIMULATOR))
    assert [epoch.cost for epoch in outcome.epochs] == [Decimal(25), Decimal(0), Decimal(5)]


def test_who_was_lost_counts_values_that_are_still_to_come(tmp_path: Path) -> None:
    events = (ScenarioEvent((RemoveValue("x", 1),)), ScenarioEvent((AddValue("x", 9),)))
    write_team(product(range(2), range(3), TENTHS), tmp_path / "team")
    team = normalized(replace(read_team(tmp_path / "team"), scenario=events))
    journey = ScenarioRun(team, None, CompiledTeam, lambda: None, spares=1)
    *_, last = (played.team for played in journey.epochs(Losing(journey.team, ["b"]), lambda _: None))
    assert journey.failed_returns == []
    assert user_cost(last, assignment_cost(last, {"x": 9, "y": 2})) == Decimal(18)


@pytest.mark.parametrize(
    ("old", "new", "why"),
    [
        ('objective="maximize"', "", "the objective differs"),
        ('scale="0.1"', 'scale="0.01"', "more decimal places"),
        ('nbValues="3">0..2', ">0..7", "y has new values"),
        ('<domain name="E" nbValues="3">0..2', '<domain name="E" type="symbolic">u v', "the team has no symbol 'u'"),
    ],
)
def test_who_reads_costs_otherwise_stays_away(old: str, new: str, why: str, tmp_path: Path) -> None:
    parents_hold = product(range(2), range(3), TENTHS)
    turned = assemble(
        "product",
        {"b": parents_hold["b"].variables, "a": parents_hold["a"].variables},
        parents_hold.constraints(),
        kind=ProblemKind.DISWCSP,
        costs=parents_hold.robots[0].costs,
    )
    write_team(turned, tmp_path / "team")
    team = normalized(read_team(tmp_path / "team"))
    file = tmp_path / "team" / "b.xml"
    assert old in file.read_text()
    file.write_text(file.read_text().replace(old, new))
    journey = ScenarioRun(team, None, CompiledTeam, lambda: None, spares=1)
    list(journey.epochs(Losing(journey.team, ["b"]), lambda _: None))
    assert journey.lost_for_good == ["b"]
    assert why in journey.failed_returns[0]


FILE = """<instance><presentation type="DisCSP"/>
<domains><domain name="D" type="symbolic">{0}</domain></domains>
<variables><variable name="{1}" domain="D"/></variables>
<relations><relation name="r" semantics="supports">red red</relation></relations>
<agents_neighbours><agents_parent>{2}</agents_parent><agents_children>{3}</agents_children></agents_neighbours>
</instance>"""


def test_who_was_lost_knows_the_codes_of_the_team(tmp_path: Path) -> None:
    shared = '<agent name="a"><constraints><constraint name="C" reference="r" scope="x y"/></constraints></agent>'
    (tmp_path / "a.xml").write_text(FILE.format("green blue red", "x", "", '<agent name="b" variable="x"/>'))
    (tmp_path / "b.xml").write_text(FILE.format("red blue", "y", shared, ""))
    team = read_team(tmp_path)
    journey = ScenarioRun(team, None, CompiledTeam, lambda: None, spares=1)
    *_, last = (played.team for played in journey.epochs(Losing(journey.team, ["b"]), lambda _: None))
    assert last == team


# Partially known constraints whose parts cost something: each side pays its own, and the sum is what counts


ORDERS = Function("ordered", PAIR, parse("sub(mul(2,X),Y)", PAIR, Type.INTEGER))
DIFFER = Predicate("differ", PAIR, parse("ne(X,Y)", PAIR, Type.BOOLEAN))


def asymmetric_team(seed: int) -> Team:
    """Three robots; of each pair one or both sides have costs of their own."""
    chance = Random(seed)
    own = {f"r{number}": [Variable(f"x{number}", Domain("D", (range(-1, 2),)))] for number in range(3)}
    parts: dict[str, list[Constraint]] = {name: [] for name in own}
    for one, other in ((0, 1), (1, 2), (0, 2)):
        scope = (f"x{one}", f"x{other}")
        for side in (one, other)[chance.randint(0, 1) :]:  # the lower one has a part, so it shows its variable
            rows = tuple((left, right) for left in range(-1, 2) for right in range(-1, 2) if chance.random() < 0.6)
            costs = tuple(chance.randint(-9, 9) for _ in rows)
            table = Relation(f"t{one}{other}", 2, Semantics.SOFT, rows, costs, chance.randint(-3, 3))
            definition = ORDERS if chance.random() < 0.5 else table
            part = Constraint(f"C{one}{other}", definition, scope, scope)
            if chance.random() < 0.3:
                part = replace(part, definition=DIFFER, cost=chance.randint(-5, 5))
            parts[f"r{side}"].append(part)
    units = CostUnits(chance.random() < 0.5, chance.choice([0, 2]))
    return assemble(f"adcop-{seed}", own, [], kind=ProblemKind.DISWCSP, costs=units, extras=Extras(parts=parts))


@count("seeds", 10, 400)
def test_the_central_solver_adds_what_both_sides_pay(seeds: int, tmp_path_factory: pytest.TempPathFactory) -> None:
    for seed in range(seeds):
        team = asymmetric_team(seed)
        outcome = solve(team, Options(protocol="central"))
        assert outcome.cost is not None
        assert Fraction(outcome.cost) == best_cost(team), seed
        assert outcome.verified
        folder = tmp_path_factory.mktemp("teams") / team.name
        write_team(team, folder)
        assert read_team(folder) == team


def test_protocols_refuse_it_by_name() -> None:
    for protocol in ["dpop", "adopt", "afb", "dsa"]:
        with pytest.raises(UnsupportedError, match=rf"has costs of its own for .*C\d\d\), which {protocol} does not"):
            solve(asymmetric_team(1), Options(protocol=protocol, runtime=Runtime.SIMULATOR))


def test_a_trait_says_who_takes_it() -> None:
    assert not Protocol.traits.asymmetric
