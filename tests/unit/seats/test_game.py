"""Games: baselines, protocols, outside programs, lies, coalitions, journals."""

from __future__ import annotations

import json
import math
from itertools import pairwise
from pathlib import Path

import pytest

import robochoc
from robochoc.generators.coloring import coloring
from robochoc.journal.reader import read_journal
from robochoc.journal.recorder import JournalRecorder
from robochoc.privacy import Kind, privacy_of
from robochoc.seats import GameOptions, Limits, header_of, play
from robochoc.seats.moves import PlayerError
from robochoc.seats.report import cost_shares
from robochoc.seats.words import problem_in_words
from robochoc.solver.errors import UnsupportedError
from robochoc.verification.checker import assignment_cost
from tests.support.cost_problems import random_cost_team
from tests.support.examples import drawn
from tests.support.limits import HANG_S
from tests.support.seats import lamps, program

PATIENT = Limits(timeout_s=HANG_S)


def test_baselines_lie_between_random_and_optimal() -> None:
    team = coloring(20, 3, 3, seed=4)
    regrets = {
        player: sum(play(team, GameOptions(others=player, seed=seed)).regret or 0 for seed in range(3))
        for player in ("random", "dsa", "mgm", "optimal")
    }
    assert regrets["optimal"] == 0
    assert regrets["random"] > max(regrets["dsa"], regrets["mgm"])


def test_real_variables_have_values_on_their_grids() -> None:
    model = robochoc.Model("rail")
    x, y = (model.robot(name).real("x", 0, 10, points=9) for name in "AB")
    model.minimize((x - 2.5) ** 2 + (x - y + 3) ** 2 + abs(y - 4))
    report = play(model.team, GameOptions(others="optimal", rounds=1))
    assert report.cost == report.optimum == model.solve("dpop", refine=math.inf).cost
    report = play(model.team, GameOptions(others="script:0", rounds=1))
    assert math.fsum(one.regret or 0 for one in report.seats) == pytest.approx(report.regret)
    words = problem_in_words(model.team, "A")
    assert "A.x is one of: 0.0 1.25 2.5 3.75 5.0 6.25 7.5 8.75 10.0." in words
    assert "(A.x - 2.5) ^ 2" in words


@pytest.mark.parametrize("protocol", ["dsa", "mgm", "dsa-sdp", "mixed-dsa", "regret-matching"])
def test_a_protocol_plays_as_in_the_simulator(protocol: str) -> None:
    model = robochoc.Model()
    colours = [model.robot(f"r{number}").variable("c", range(3)) for number in range(6)]
    model.minimize(sum((one == other) * 3 for one, other in pairwise(colours)) + sum(colours))
    solved = model.solve(protocol, settings={"cycles": 9}, seed=3, answer="final")
    game = play(model.team, GameOptions(others=protocol, rounds=10, seed=3))
    assert game.assignment == solved.assignment


def test_mgm_among_others_still_moves() -> None:
    report = play(lamps(), GameOptions(players={"r0": "script:1", "r3": "greedy"}, others="mgm", rounds=10))
    assert [one.player for one in report.seats] == ["script", "mgm", "mgm", "greedy"]
    assert report.cost is not None
    assert report.cost <= 1 + 1 + 2 + 1


def test_a_program_plays_and_speaks() -> None:
    body = """
if number == 1:
    move["say"] = [{"to": neighbours[0], "text": "I like\\nred \\x1b[31m"}]
    move["tokens"] = 12
"""
    options = GameOptions({"r1": program(body)}, others="greedy", rounds=3, limits=PATIENT)
    report = play(lamps(), options)
    seat = report["r1"]
    assert (seat.player, seat.texts, seat.tokens, seat.breaches) == ("program", 1, 12, ())
    assert seat.messages == 3 * 2 + 1
    assert seat.characters == len("I like red \N{REPLACEMENT CHARACTER}[31m")
    assert len(report.costs) == report.rounds == 3


def test_a_lying_seat_is_named() -> None:
    liar = program("if number > 1: move['announce'] = values[(best + 1) % 3]")
    report = play(lamps(), GameOptions({"r1": liar}, others="greedy", rounds=3, limits=PATIENT))
    assert report["r1"].lies == (2, 3)
    assert [one.lies for one in report.seats if one.robot != "r1"] == [()] * 3


def test_claims_are_checked_and_true_ones_count_as_disclosed() -> None:
    def report_with(cost: str) -> tuple[float, int]:
        claim = f"""
move["say"] = [{{"to": neighbours[0], "claim": {{"value": values[2], "cost": {cost}}}}}] if number == 1 else []
"""
        options = GameOptions({"r1": program(claim)}, others="script:0", rounds=2, limits=PATIENT)
        seat = play(lamps(), options)["r1"]
        assert seat.claims == 1
        return seat.disclosed[str(Kind.DOMAIN)] or 0, len(seat.false_claims)

    silent = play(lamps(), GameOptions({"r1": program()}, others="script:0", rounds=2, limits=PATIENT))["r1"]
    true, false = report_with("costs_of_own[2]"), report_with("costs_of_own[2] + 1")
    assert false == (silent.disclosed[str(Kind.DOMAIN)], 1)
    assert true[0] > false[0]
    assert true[1] == 0


def test_shares_add_up_to_the_cost_and_coalitions_to_the_regret() -> None:
    chance = drawn("seats")
    team = random_cost_team(chance)
    report = play(team, GameOptions(others="greedy", rounds=3, coalitions=(tuple(team.order[:1]),)))
    if report.feasible:
        assignment = {name: int(value) for name, value in report.assignment.items()}
        assert sum(cost_shares(team, assignment).values()) == pytest.approx(assignment_cost(team, assignment))
    if report.regret is not None:
        (group,) = report.coalitions
        assert (group.regret or 0) + (group.others or 0) == pytest.approx(report.regret)


def test_a_coalition_that_gains_at_others_expense() -> None:
    model = robochoc.Model("two slots")
    a, b = (model.robot(name).variable("x", range(2)) for name in "ab")
    model.minimize((a == 0) * 3 + (a == 1) * 1 + (b == 0) * 1 + (b == 1) * 5 + (a == b) * 9)
    options = GameOptions(players={"a": "script:1", "b": "script:0"}, coalitions=(("a",), ("b",)), rounds=1)
    assert play(model.team, options).regret == 0
    model = robochoc.Model("a takes the cheap slot")
    a, b = (model.robot(name).variable("x", range(2)) for name in "ab")
    model.minimize((a == 0) * 2 + (b == 0) * 9 + (a == b) * 20)
    selfish = GameOptions(players={"a": "script:1", "b": "script:0"}, coalitions=(("a",), ("b",)), rounds=1)
    report = play(model.team, selfish)
    assert report.regret == 7
    assert [one.gains_at_others_expense for one in report.coalitions] == [True, False]


def test_the_journal_of_a_game_can_be_measured() -> None:
    options = GameOptions(others="greedy", rounds=3)
    recorder = JournalRecorder(header_of(lamps(), options))
    report = play(lamps(), options, recorder)
    journal = read_journal(recorder.content())
    assert journal.outcome is not None
    assert journal.outcome.cost == report.cost
    measured = privacy_of(journal)
    assert {one.subject for one in measured.losses} == {"r0", "r1", "r2", "r3"}
    for seat in report.seats:
        for kind, loss in seat.disclosed.items():
            assert loss == pytest.approx(measured.loss_of(seat.robot, Kind(kind), "entropy"))  # type: ignore[arg-type]


def test_options_that_do_not_fit_are_refused() -> None:
    team = lamps()
    for options, words in (
        (GameOptions(players={"r9": "random"}), "no robot 'r9'"),
        (GameOptions({"r1": ["true"]}, {"r1": "random"}), "two players"),
        (GameOptions(others="dpop"), "cannot play in rounds"),
        (GameOptions(others="script:7"), "7 is not one of them"),
        (GameOptions(others="script:x"), "write indices"),
        (GameOptions(others="optimal", optimum=None), "not known"),
        (GameOptions({"r1": ["/no/such/program"]}), "cannot be started"),
        (GameOptions(rounds=0), "at least 1"),
        (GameOptions(rounds=10**12), "at most 1,000,000"),
        (GameOptions(optimum="dsa"), "dsa is incomplete"),
        (GameOptions(coalitions=(("r1", "r0", "r1"),)), "names r1 twice"),
    ):
        with pytest.raises(UnsupportedError, match=words):
            play(team, options)
    with pytest.raises(PlayerError, match="the player of r0, r1"):
        play(team, GameOptions(others="dsaa"))


def test_the_welcome_has_the_own_problem_only(tmp_path: Path) -> None:
    copy = tmp_path / "seen"
    body = f"open({str(copy)!r}, 'a').write(line)"
    command = program()
    first = '    if seen["type"] == "welcome":'
    command[-1] = command[-1].replace(first, f"    {body}\n{first}", 1)
    play(lamps(), GameOptions({"r0": command}, others="greedy", rounds=1, limits=PATIENT))
    welcome = json.loads(copy.read_text().splitlines()[0])
    assert welcome["robot"] == "r0"
    assert [one["robot"] for one in welcome["neighbours"]] == ["r1"]
    assert welcome["values"][2] == {"value": {"r0.c": 2}, "cost": 2}
    assert "r2" not in json.dumps(welcome)
    assert "Cost" in welcome["problem"]
