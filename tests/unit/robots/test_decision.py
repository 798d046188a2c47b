"""A decision that others follow: feedback tells how far it is, others cancel it, and any request is answered."""

from __future__ import annotations

import json
import math
import threading
from functools import cache
from random import Random
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from robochoc.generators.queens3d import queens3d
from robochoc.model.outcome import Outcome, Verdict
from robochoc.model.problem import Team
from robochoc.robots import decision
from robochoc.robots.decision import CancellableDecision
from robochoc.ros.decide_service import DECIDE, DecideService
from robochoc.ros.message_types import types_of
from robochoc.run import Options, Runtime, solve
from robochoc.system.stopping import stop_requested
from tests.support.cases import looped
from tests.support.cost_problems import cost_of, random_cost_team
from tests.support.example_teams import example, hangar
from tests.support.limits import HANG_S
from tests.support.program import ROOT
from tests.support.small_teams import pair

EXAMPLES = ROOT / "docs" / "examples"
SIMULATED = Options(runtime=Runtime.SIMULATOR, timeout=HANG_S)
ENDLESS = Options(protocol="dsa", runtime=Runtime.SIMULATOR, timeout=HANG_S, settings={"cycles": "1000000000"})


class Told(list[dict[str, Any]]):
    """What feedback has told."""

    def __call__(self, text: str) -> None:
        assert "\n" not in text
        self.append(json.loads(text))


@pytest.mark.parametrize("runtime", [Runtime.SIMULATOR, pytest.param(Runtime.PROCESSES, marks=pytest.mark.slow)])
def test_feedback_tells_how_far_it_is(monkeypatch: pytest.MonkeyPatch, runtime: Runtime) -> None:
    monkeypatch.setattr(decision, "PERIOD_S", 0.0)
    for seed in range(5):
        team, told = random_cost_team(Random(seed)), Told()
        outcome = CancellableDecision(told)(team, Options(protocol="adopt", runtime=runtime, timeout=HANG_S))
        assert outcome.assignment == solve(team, Options(protocol="adopt", runtime=runtime)).assignment
        assert [one["state"] for one in told] == ["deciding"] * (len(told) - 1) + ["decided"]
        last = told[-1]
        assert (last["team"], last["verdict"], last["robots"]) == (team.name, outcome.verdict, len(team.robots))
        assert 0 <= last["decided"] <= len(team.robots)
        costs = [float(one["cost"]) for one in told if "cost" in one]
        assert costs == sorted(costs, reverse=True)
        for one in told:
            if "cost" in one:
                assert float(one["cost"]) == cost_of(one["assignment"], [*team.constraints()])
        if runtime is Runtime.SIMULATOR and outcome.verdict is Verdict.OPTIMAL:
            assert costs[-1] == outcome.cost


def test_feedback_of_a_team_that_changes_has_no_cost(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(decision, "PERIOD_S", 0.0)
    told = Told()
    assert CancellableDecision(told)(example("rescue"), SIMULATED).epochs
    assert told[-1]["state"] == "decided"
    assert not any("cost" in one for one in told)


def test_an_assignment_that_is_too_long_is_left_out(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(decision, "FEEDBACK_CHARACTERS_MAX", 10)
    told = Told()
    CancellableDecision(told)(random_cost_team(Random(1)), SIMULATED)
    assert "assignment" not in told[-1]


def test_it_can_be_cancelled() -> None:
    """Feedback comes in the midst of a search that would not end; then somebody cancels, in another thread."""
    answers: list[dict[str, Any]] = []
    asks = threading.Event()

    def cancel() -> None:
        asks.wait(HANG_S)
        answers.append(followed.cancel({}))

    followed = CancellableDecision(lambda _: asks.set())
    canceller = threading.Thread(target=cancel)
    canceller.start()
    outcome = DecideService([queens3d(4)], followed, ENDLESS).decide({})
    canceller.join()
    assert answers == [{"success": True, "message": "the decision of queens3d-4 is cancelled"}]
    assert not outcome["success"]
    assert outcome["message"].startswith("unknown, 1 epoch: somebody has asked to stop")
    assert not stop_requested()
    assert followed.cancel({}) == {"success": False, "message": "no team is deciding"}
    assert DecideService([pair(values=3)], followed, SIMULATED).decide({})["success"], "the next one decides"


def test_nothing_is_left_of_a_decision_that_failed() -> None:
    followed = CancellableDecision(Told())
    answer = DecideService([pair(values=3)], followed, Options("explode", Runtime.SIMULATOR)).decide({})
    assert "explode" in answer["message"]
    assert followed.cancel({})["success"] is False


# Whatever is asked

JSON = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(st.characters(), max_size=8),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=6), inner, max_size=3),
    max_leaves=8,
)
NAMES = st.sampled_from(["port", "Nose", "Fin", "nose", "", "\ud800", "x" * 20_000])
CHANGE = st.fixed_dictionaries(
    {},
    optional={
        "remove_value": st.fixed_dictionaries({"variable": NAMES, "value": st.integers() | JSON}),
        "add_value": st.fixed_dictionaries({"variable": NAMES, "value": st.integers()}),
        "remove_agent": st.fixed_dictionaries({"name": NAMES}) | JSON,
    },
)
CHANGES = st.text(max_size=30) | st.lists(CHANGE | JSON, max_size=4).map(json.dumps) | JSON | st.just("[" * 60_000)
REQUESTS = st.fixed_dictionaries(
    {}, optional={"team": NAMES | st.sampled_from(["hangar", "rescue"]) | JSON, "changes": CHANGES, "timeout": JSON}
) | st.dictionaries(st.text(max_size=5), JSON, max_size=3)


@cache
def decided() -> Outcome:
    return solve(hangar(), SIMULATED)


@settings(max_examples=60)
@given(REQUESTS)
def test_whatever_is_asked_is_answered_in_one_short_line_that_can_be_sent(fields: dict[str, Any]) -> None:
    asked: list[float | None] = []

    def decide(_: Team, options: Options) -> Outcome:
        asked.append(options.timeout)
        return decided()

    answer = DecideService([hangar(), example("rescue")], decide, SIMULATED).decide(fields)
    assert answer["success"] is bool(asked)
    assert all(one is not None and 0 < one <= HANG_S for one in asked)
    assert "\n" not in answer["message"]
    assert len(answer["message"]) <= 1_000
    assert "UnicodeEncodeError" not in answer["message"]
    back = types_of(2).decode(f"{DECIDE}_Response", types_of(2).encode(f"{DECIDE}_Response", answer))
    assert back["message"] == answer["message"]


@looped(
    ("told", "fields"),
    [
        ("timeout is True: it must be seconds, or 0 for the longest time", {"timeout": True}),
        ("timeout is False: it must be seconds, or 0 for the longest time", {"timeout": False}),
        ("timeout is None: it must be seconds, or 0 for the longest time", {"timeout": None}),
        ("", {"timeout": 10**5000}),
        ("timeout is a int: it must be seconds, or 0 for the longest time", {"timeout": -(10**5000)}),
        ("timeout is nan: it must be seconds, or 0 for the longest time", {"timeout": math.nan}),
        ("timeout is '5': it must be seconds, or 0 for the longest time", {"timeout": "5"}),
        ("team is 5: it must be text", {"team": 5}),
        (
            "team must be text that UTF-8 can encode: character 2 is half of a pair (U+DFFF)",
            {"team": "a\udfff"},
        ),
        (
            "changes must be text that UTF-8 can encode: character 29 is half of a pair (U+D800)",
            {"changes": '[{"remove_agent": {"name": "\ud800"}}]'},
        ),
        ("changes is [1]: it must be text", {"changes": [1]}),
    ],
)
def test_the_reason_is_the_right_one(told: str, fields: dict[str, Any]) -> None:
    answer = DecideService([hangar()], lambda *_: decided(), SIMULATED).decide(fields)
    assert answer["message"] == (told or "solution, 1 epoch")
