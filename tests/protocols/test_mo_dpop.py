"""Multi-objective DPOP: fronts equal brute force, and bad messages are refused."""

from __future__ import annotations

from dataclasses import replace
from fractions import Fraction
from pathlib import Path
from random import Random

import pytest
from hypothesis import given
from hypothesis import strategies as st

import robochoc
from robochoc.journal.journal import JournalRecorder, read_journal
from robochoc.model.objectives import PARETO, ObjectivesMode, non_dominated, objectives_mode, place_values, unpacked
from robochoc.model.outcome import EpochOutcome, Outcome, Verdict
from robochoc.model.problem import RemoveConstraint, ScenarioEvent, Team
from robochoc.privacy import privacy_of
from robochoc.protocols.inference.mo_dpop import MODPOPSettings
from robochoc.replay import replay
from robochoc.run import Options, Runtime, solve
from robochoc.run.objectives import combined_run
from robochoc.run.options import ScheduleName
from robochoc.run.orchestrator import prepare
from robochoc.run.recording import journal_header
from robochoc.solver.errors import UnsupportedError
from robochoc.verification.checker import RefutedError
from robochoc.verification.front import check_front, confirm_front, enumerated_front
from tests.support.examples import drawn
from tests.support.objective_problems import as_vector, brute_front, random_team, solutions

SCHEDULES = (ScheduleName.CONCURRENT, ScheduleName.ONE_BY_ONE, ScheduleName.RANDOM)
COMPLETE = ("dpop", "sfb", "afb", "syncbb", "bnb-adopt", "pt-fb", "mo-dpop", "central")


def simulated(team: Team, protocol: str = "auto", **options: object) -> Outcome:
    return solve(team, Options(protocol=protocol, runtime=Runtime.SIMULATOR, **options))  # type: ignore[arg-type]


def check_fronts(seed: int, *, verify: bool) -> None:
    chance = Random(seed)
    team = random_team(chance)
    expected = brute_front(team)
    order = chance.choice((None, "random", "max-degree"))
    outcome = simulated(team, order=order, schedule=chance.choice(SCHEDULES), seed=chance.randrange(100), verify=verify)
    found = [as_vector(team, point.objectives) for point in outcome.front]
    assert sorted(found) == sorted(expected), seed
    assert outcome.verdict == (Verdict.OPTIMAL if expected else Verdict.NO_SOLUTION), seed
    if expected:
        assert (outcome.protocol, outcome.confirmed) == ("mo-dpop", verify)
        assert outcome.confirmed_by == ("enumeration",) * verify
        assert outcome.assignment == outcome.front[0].assignment
        assert found == sorted(found)
        assert {as_vector(team, point.objectives) for point in simulated(team, "central").front} == expected


def check_single_costs(seed: int) -> None:
    chance = Random(seed)
    team = random_team(chance)
    vectors = [vector for vector, _ in solutions(team)]
    names = chance.sample(team.objectives, len(team.objectives))
    at = [team.objectives.index(name) for name in names]
    weights = [chance.randint(1, 40) for _ in names]
    weighted = ",".join(f"{name}={weight}" for name, weight in zip(names, weights, strict=True))
    for protocol in chance.sample(COMPLETE, 2):
        for mode in (f"weighted:{weighted}", f"lexicographic:{','.join(names)}"):
            outcome = simulated(team, protocol, objectives=mode)
            if not vectors:
                assert outcome.verdict == Verdict.NO_SOLUTION, (seed, protocol)
                continue
            found = as_vector(team, outcome.objectives)
            ranked = [[vector[place] for place in at] for vector in (found, *vectors)]
            if mode.startswith("weighted"):
                ranked = [
                    [sum((weight * cost for weight, cost in zip(weights, one, strict=True)), Fraction(0))]
                    for one in ranked
                ]
            assert found in vectors, (seed, protocol, mode)
            assert ranked[0] == min(ranked), (seed, protocol, mode)


def test_fronts_equal_brute_force() -> None:
    chance = drawn("fronts")
    for number in range(12):
        check_fronts(chance.randrange(2**32), verify=number == 0)


def test_weighted_and_lexicographic_optima_equal_brute_force() -> None:
    chance = drawn("single costs")
    for _ in range(8):
        check_single_costs(chance.randrange(2**32))


@pytest.mark.slow
def test_200_fronts_equal_brute_force() -> None:
    for seed in range(200):
        check_fronts(seed, verify=seed % 10 == 0)
        check_single_costs(seed)


@given(vectors=st.lists(st.tuples(*[st.integers(0, 6)] * 3), max_size=30))
def test_non_dominated_vectors_are_those_of_the_definition(vectors: list[tuple[int, ...]]) -> None:
    for size in (1, 2, 3):
        own = {vector[:size] for vector in vectors}
        bases = (7,) * (size - 1)
        factors = place_values(bases)
        packed = [sum(part * factor for part, factor in zip(one, factors, strict=True)) for one in own]
        expected = {
            one
            for one in own
            if not any(other != one and all(a <= b for a, b in zip(other, one, strict=True)) for other in own)
        }
        assert [unpacked(one, bases) for one in non_dominated(packed, bases)] == sorted(expected)


@pytest.mark.parametrize("text", ["pareto", "weighted:energy=1,risk=3", "lexicographic:risk,energy"])
def test_modes_are_read_as_written(text: str) -> None:
    assert str(objectives_mode(text)) == text


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("best", "is not a way to combine objectives"),
        ("weighted:energy", "the weight of energy is missing"),
        ("weighted:energy=-1", "the weight of energy is -1"),
        ("weighted:energy=1.5", "the weight of energy is 1.5"),
        ("weighted:energy=99999999999", "an integer from 1 to"),
        ("lexicographic:", "names no objective"),
        ("lexicographic:a,a", "names an objective twice"),
        ("lexicographic:a=1", "lexicographic has none"),
        ("pareto:a", "pareto has all of them"),
    ],
)
def test_invalid_modes_are_refused(text: str, expected: str) -> None:
    with pytest.raises(ValueError, match=expected):
        objectives_mode(text)


def trade_off(size: int = 3) -> robochoc.Model:
    model = robochoc.Model("drones")
    heights = [model.robot(f"drone{number}").variable("height", range(1, 6)) for number in range(size)]
    model.minimize(sum(3 * height for height in heights), objective="energy")
    model.minimize(sum(height * height - 12 * height for height in heights), objective="risk")
    model.add(heights[0] != heights[1])
    return model


@pytest.mark.parametrize(
    ("protocol", "options", "expected"),
    [
        ("dpop", {}, "several objectives .* minimises a single cost"),
        ("auto", {"withdraw": "minimum"}, "--withdraw cannot be combined with a Pareto front"),
        ("auto", {"deadline": 1}, "--deadline cannot be combined"),
        ("auto", {"message_loss": 0.1}, "--message-loss cannot be combined"),
        ("auto", {"objectives": "weighted:energy=1"}, "has the objectives energy, risk"),
        ("dpop", {"objectives": "lexicographic:" + ",".join(f"a{n}" for n in range(999))}, r"a12,a\.\.\. does not"),
        ("mo-dpop", {"settings": {"vectors": "3"}}, "more than 3 cost vectors.* or combine the objectives"),
        ("dpop", {"objectives": "weighted:energy=1000000000,risk=1000000000", "seed": 1}, ""),
    ],
)
def test_refusals_name_the_next_step(protocol: str, options: dict[str, object], expected: str) -> None:
    if expected:
        with pytest.raises(UnsupportedError, match=expected):
            simulated(trade_off().team, protocol, **options)
    else:
        assert simulated(trade_off().team, protocol, **options).verdict == Verdict.OPTIMAL


def test_a_robot_that_returns_has_no_combined_costs() -> None:
    options = Options(protocol="dpop", objectives=objectives_mode("weighted:energy=1,risk=1"), spares=1)
    with pytest.raises(UnsupportedError, match="--spare cannot be combined with several objectives"):
        combined_run(trade_off().team, options)


def test_messages_never_exclude_the_truth() -> None:
    chance = drawn("proofs of tables of vectors")
    for _ in range(10):
        run = prepare(random_team(chance), Options(runtime=Runtime.SIMULATOR))
        recorder = JournalRecorder(journal_header(run.team, run.choice.options))
        recorder.outcome = run.solve(observer=recorder)
        if recorder.outcome.metrics.messages:  # otherwise a robot without values has ended the run
            report = privacy_of(read_journal(recorder.content()))  # raises an error if the truth is excluded
            assert not report.without_rule


def test_solutions_are_listed_from_the_first_point_of_the_front_on() -> None:
    listed = [tuple(solution.objectives.values()) for solution in trade_off(2).solutions()]
    assert listed == sorted(listed)
    assert len({*map(str, listed)}) > 1


def test_objectives_are_refused_for_a_single_cost() -> None:
    model = robochoc.Model("single")
    model.minimize(model.robot("r").variable("x", range(3)))
    with pytest.raises(UnsupportedError, match="has a single cost"):
        simulated(model.team, objectives="pareto")


def test_combined_costs_that_are_too_large_are_refused() -> None:
    model = trade_off()
    model.minimize(10**12 * model["drone0.height"], objective="energy")
    with pytest.raises(UnsupportedError, match="could add up to"):
        simulated(model.team, objectives="weighted:energy=1000000,risk=1")


def test_local_solutions_that_neighbours_cannot_distinguish_are_all_on_the_front() -> None:
    model = robochoc.Model("hidden")
    robot = model.robot("r")
    seen, hidden = robot.variable("seen", range(2)), robot.variable("hidden", range(3))
    other = model.robot("s").variable("x", range(2))
    model.add(seen != other)
    model.minimize(hidden, objective="energy")
    model.minimize(-hidden + other, objective="risk")
    outcome = simulated(model.team)
    assert [tuple(point.objectives.values()) for point in outcome.front] == [(0, 0), (1, -1), (2, -2)]


def test_the_front_is_refuted_if_a_point_is_wrong() -> None:
    team = trade_off().team
    points = [(dict(zip(team.objectives, one, strict=True)), found) for one, found in enumerated_front(team).items()]
    check_front(team, points)
    assert confirm_front(team, [costs for costs, _ in points])
    with pytest.raises(RefutedError, match="1 are missing"):
        confirm_front(team, [costs for costs, _ in points[1:]])
    with pytest.raises(RefutedError, match="equal costs"):
        check_front(team, [points[0], points[0]])
    with pytest.raises(RefutedError, match="does not have the costs"):
        check_front(team, [(points[0][0], points[1][1])])


def test_a_model_returns_the_front() -> None:
    solution = trade_off().solve()
    assert solution.front[0].objectives == {"energy": 12, "risk": -42}
    assert solution.cost == 12
    lexicographic = trade_off().solve("dpop", objectives="lexicographic:risk,energy")
    assert lexicographic.cost == lexicographic.objectives["risk"] == solution.front[-1].objectives["risk"]


def test_epochs_have_the_costs_of_their_own_team() -> None:
    model = trade_off()
    event = model.after_solution()
    event.add(model["drone0.height"] + model["drone2.height"] >= 7, cost=9, objective="energy")
    with pytest.raises(UnsupportedError, match="a problem that changes"):
        model.solve()
    solution = model.solve("dpop", objectives="lexicographic:energy,risk")
    assert [epoch.objectives for epoch in solution.epochs] == [
        {"energy": 12, "risk": -42},
        {"energy": 21, "risk": -42},
    ]
    assert [epoch.cost for epoch in solution.epochs] == [12, 21]


def test_epochs_have_the_costs_in_each_objective_if_the_last_has_no_solution() -> None:
    model = trade_off()
    event = model.after_solution()
    event.add(model["drone0.height"] == model["drone1.height"])
    weighted = model.solve("dpop", objectives="weighted:energy=2,risk=1")
    first, last = [epoch.objectives for epoch in weighted.epochs]
    assert (2 * first["energy"] + first["risk"], last) == (-26, {})
    lexicographic = model.solve("dpop", objectives="lexicographic:energy,risk")
    assert lexicographic.verdict == Verdict.NO_SOLUTION
    assert [epoch.cost for epoch in lexicographic.epochs] == [12, None]


def test_costs_after_a_loss_are_those_of_the_other_robots() -> None:
    team = trade_off().team
    run = combined_run(team, Options(protocol="dpop", objectives=objectives_mode("lexicographic:risk,energy")))
    assert run is not None
    assignment = {"drone1.height": 5, "drone2.height": 5}
    combined = 30 * run.weights["energy"] - 70 * run.weights["risk"]
    epochs = (
        EpochOutcome(verdict=Verdict.UNKNOWN, robots=team.order, opened_by="", lost=("drone0",)),
        EpochOutcome(
            verdict=Verdict.OPTIMAL,
            assignment=assignment,
            cost=combined,
            robots=("drone1", "drone2"),
            opened_by="",
        ),
    )
    found = simulated(team, "dpop", objectives="lexicographic:risk,energy")
    outcome = run.outcome(replace(found, assignment=assignment, cost=combined, epochs=epochs, lost=("drone0",)))
    assert (outcome.cost, outcome.objectives) == (-70, {"energy": 30, "risk": -70})
    assert outcome.epochs[1].cost == -70
    outcome = run.outcome(replace(found, assignment=assignment, cost=combined + 1, lost=("drone0",)))
    assert (outcome.cost, outcome.objectives) == (None, {})  # robots are lost with their files on a network


@pytest.mark.parametrize("mode", ["weighted:energy=2,risk=3", "lexicographic:risk,energy"])
def test_events_of_an_environment_change_the_costs_in_each_objective(mode: str) -> None:
    model = trade_off()
    model.add(model["drone0.height"] + model["drone1.height"] >= 10, cost=7, name="high", objective="risk")
    events = [ScenarioEvent((RemoveConstraint("drone1", "drone0", "high"),))]
    solution = model.solve("dpop", objectives=mode, environment=lambda *_: events.pop() if events else None)
    before, after = [epoch.objectives for epoch in solution.epochs]
    assert before["risk"] - after["risk"] == 7
    assert before["energy"] == after["energy"]


@pytest.mark.parametrize("bases", ["0", "a", "1,2,3", "1,,2", str(2**63)])
def test_invalid_bases_are_refused(bases: str) -> None:
    with pytest.raises(ValueError, match="positive integers"):
        MODPOPSettings(bases=bases)


def test_pareto_is_the_mode_without_names() -> None:
    assert PARETO.names == ()
    assert ObjectivesMode(PARETO.combination) == PARETO


@pytest.mark.parametrize("mode", ["pareto", "lexicographic:risk,energy", "weighted:energy=2,risk=1"])
def test_journals_are_replayed(tmp_path: Path, mode: str) -> None:
    trade_off().solve("mo-dpop", objectives=mode, journal=tmp_path / "run.jsonl")
    assert not [*replay(read_journal((tmp_path / "run.jsonl").read_bytes())).contradictions]
