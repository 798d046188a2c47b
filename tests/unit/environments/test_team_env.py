"""The PettingZoo environments: PettingZoo's own tests, rewards, observations, and errors."""

from __future__ import annotations

import math
import warnings
from collections.abc import Callable
from contextlib import suppress
from random import Random
from typing import Any, cast

import numpy as np
import pytest
from pettingzoo.test import api_test, parallel_api_test, parallel_seed_test, seed_test

import robochoc
from robochoc.environments import TeamEnv, env, parallel_env
from robochoc.generators.coloring import coloring
from robochoc.model.problem import Team
from robochoc.rounds import TeamRounds, certified_optimum
from robochoc.solver.errors import UnsupportedError
from robochoc.system.errors import OptionError
from tests.support.cost_problems import random_complex_cost_team, random_cost_team
from tests.support.examples import drawn
from tests.support.pkc_problems import random_pkc_team
from tests.support.program import ROOT


def chain() -> Team:
    """Return three robots in a chain: costs and a hard constraint. The optimum is 1: values 2, 1, 1."""
    model = robochoc.Model("chain")
    x, y, z = (model.robot(f"r{number}").variable(f"x{number}", range(3)) for number in range(3))
    model.add(x != y)
    model.minimize(abs(y - z) * 2 + (2 - x) * 3 + (2 - z))
    return model.team


TEAMS: dict[str, Callable[[], Team]] = {
    "chain": chain,
    "hard colouring": lambda: coloring(6, 3, 2, seed=1, conflicts="hard"),
    "several variables": lambda: random_complex_cost_team(Random(2)),
    "partially known": lambda: random_pkc_team(Random(1)),
}


def quietly(test: Callable[..., None], *arguments: object) -> None:
    """Run a test of PettingZoo, which warns of dictionaries and large bounds as observations."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        test(*arguments)


@pytest.mark.parametrize("name", TEAMS)
@pytest.mark.parametrize("signals", [0, 3])
def test_the_tests_of_pettingzoo_pass(name: str, signals: int, capsys: pytest.CaptureFixture[str]) -> None:
    team = TEAMS[name]()

    def parallel() -> TeamEnv:
        return parallel_env(team, rounds=20, signals=signals, optimum=None, reward="own")

    quietly(parallel_api_test, parallel(), 100)
    quietly(parallel_seed_test, parallel, 40)
    quietly(api_test, env(team, rounds=20, signals=signals, optimum=None), 100)
    quietly(seed_test, lambda: env(team, rounds=20, signals=signals, optimum=None), 40)
    assert "Passed Parallel API test" in capsys.readouterr().out


def wander(environment: TeamEnv, steps: int, seed: int) -> None:
    """Take random steps, and check observations, rewards and infos against the checker."""
    chance = np.random.default_rng(seed)
    for _ in range(steps):
        if not environment.agents:
            observations, infos = environment.reset(seed=int(chance.integers(1 << 30)))
        else:
            actions = {name: environment.action_space(name).sample() for name in environment.agents}
            observations, rewards, _, _, infos = environment.step(actions)
            assert all(map(math.isfinite, rewards.values()))
        for name, observation in observations.items():
            assert environment.observation_space(name).contains(observation), (name, observation)
            info = infos[name]
            assert (info["violations"] > 0) is (info["cost"] is None)
            assert info["regret"] is None or info["regret"] >= 0


def test_random_steps_on_random_teams() -> None:
    chance = drawn("environments")
    for make in (random_cost_team, random_complex_cost_team, random_pkc_team):
        team = make(chance)
        with suppress(UnsupportedError):  # a random robot may have no possible value
            wander(parallel_env(team, rounds=5, signals=chance.choice([0, 2])), 60, chance.randrange(1 << 30))


@pytest.mark.slow
def test_a_hundred_thousand_random_steps() -> None:
    wander(parallel_env(chain(), rounds=100), 50_000, 1)
    wander(parallel_env(coloring(8, 3, 3, seed=1), rounds=100, signals=2, reward="own"), 50_000, 2)


@pytest.mark.parametrize("reward", ["own", "team"])
def test_rewards_add_up_to_the_decrease_of_costs(reward: str) -> None:
    team = chain()
    environment = parallel_env(team, rounds=10, reward=reward, optimum=None)
    environment.reset(seed=3)
    rounds = TeamRounds(team)

    def costs() -> dict[str, float]:
        rounds.choose(dict(zip(environment.possible_agents, map(int, environment.state()), strict=True)))
        own = {name: rounds.costs(name)[rounds.values[name]] for name in rounds.problems}
        return {name: rounds.weighed(rounds.team_cost if reward == "team" else own[name]) for name in own}

    first = costs()
    total = dict.fromkeys(first, 0.0)
    while environment.agents:
        actions = {name: environment.action_space(name).sample() for name in environment.agents}
        for name, value in environment.step(actions)[1].items():
            total[name] += value
    assert total == {name: first[name] - last for name, last in costs().items()}


def test_the_observed_costs_are_those_of_moves_against_fixed_neighbours() -> None:
    team = chain()
    environment = parallel_env(team, optimum=None)
    observations, infos = environment.reset(options={"values": {"r0": 0, "r1": 1, "r2": 0}})
    assert infos["r0"]["violations"] == 0
    assert infos["r0"]["cost"] == 2 + 6 + 2
    assert observations["r0"]["costs"].tolist() == [6, 3, 0]
    assert observations["r0"]["violations"].tolist() == [0, 1, 0]
    assert observations["r2"]["costs"].tolist() == [4, 1, 2]
    assert observations["r1"]["neighbours"].tolist() == [0, 0]
    after, rewards, *_ = environment.step({"r0": 2, "r2": 1})
    assert rewards == dict.fromkeys(environment.agents, 9)
    assert after["r1"]["neighbours"].tolist() == [2, 1]


def test_signals_reach_the_neighbours_in_the_next_round() -> None:
    environment = parallel_env(chain(), signals=3, optimum=None)
    observations, _ = environment.reset(seed=1)
    assert observations["r1"]["signals"].tolist() == [0, 0]
    observations, *_ = environment.step({"r0": (0, 2), "r1": (0, 0), "r2": (0, 1)})
    assert observations["r1"]["signals"].tolist() == [2, 1]
    assert observations["r0"]["signals"].tolist() == [0]


def test_regret_is_measured_against_the_certified_optimum() -> None:
    environment = parallel_env(chain(), optimum="dpop")
    assert environment.optimum is not None
    assert environment.optimum.cost == certified_optimum(chain()).cost == 1
    assert environment.optimum.certified_by == "dpop"
    _, infos = environment.reset(options={"values": {"r0": 2, "r1": 1, "r2": 1}})
    assert infos["r1"]["regret"] == 0
    _, infos = environment.reset(options={"values": {"r0": 1, "r1": 1, "r2": 1}})
    assert infos["r1"]["regret"] == math.inf


def test_an_optimum_needs_a_proof() -> None:
    with pytest.raises(UnsupportedError, match="dsa is incomplete"):
        certified_optimum(chain(), "dsa")
    assert certified_optimum(coloring(4, 2, 3, conflicts="hard")).regret(0) is None  # three colours are needed


def test_a_maximised_utility() -> None:
    model = robochoc.Model("worth")
    x, y = (model.robot(name).variable(f"{name}.x", range(3)) for name in ("a", "b"))
    model.maximize(x * y)
    environment = parallel_env(model)
    _, infos = environment.reset(options={"values": {"a": 1, "b": 2}})
    assert (infos["a"]["cost"], infos["a"]["regret"]) == (2, 2)
    _, rewards, *_ = environment.step({"a": 2})
    assert rewards["a"] == 2


def test_the_text_of_a_round(capsys: pytest.CaptureFixture[str]) -> None:
    environment = parallel_env(chain(), rounds=7, optimum=None, render_mode="ansi")
    environment.reset(options={"values": {"r0": 2, "r1": 1, "r2": 1}})
    assert environment.render() == "round 0 of 7: cost 1\n  r0: r0.x0 = 2\n  r1: r1.x1 = 1\n  r2: r2.x2 = 1"
    human = parallel_env(chain(), optimum=None, render_mode="human")
    human.reset(options={"values": {"r0": 1, "r1": 1, "r2": 1}})
    assert human.render() is None
    assert "violated hard constraints: 1" in capsys.readouterr().out


def test_wrong_arguments_are_refused() -> None:
    team = chain()
    for options, word in (
        ({"rounds": 0}, "rounds is 0"),
        ({"reward": "all"}, "'own' or 'team'"),
        ({"signals": 1}, "signals is 1"),
        ({"render_mode": "rgb_array"}, "render_mode"),
        ({"render_mode": []}, "render_mode"),
        ({"rounds": 2.5}, "rounds is 2.5"),
        ({"rounds": True}, "rounds is True"),
        ({"rounds": "5"}, "rounds is '5'"),
        ({"signals": 2.5}, "signals is 2.5"),
        ({"reward": ["own"]}, "reward is"),
        ({"violation_cost": float("nan")}, "violation_cost is nan"),
        ({"violation_cost": "x"}, "violation_cost is 'x'"),
        ({"violation_cost": -1}, "violation_cost is -1"),
        ({"optimum": 3}, "optimum is 3"),
    ):
        with pytest.raises(OptionError, match=word):
            parallel_env(team, **{"optimum": None} | options)
    with pytest.raises(OptionError, match="use a Team"):
        parallel_env(cast("Any", None))
    environment = parallel_env(team, optimum=None, render_mode="ansi")
    for early in (environment.state, environment.render, lambda: environment.step({})):
        with pytest.raises(OptionError, match="call reset first"):
            early()
    for given, word in (({"r9": 0}, "'r9' is not a robot"), (None, "a mapping"), ([1], "a mapping")):
        with pytest.raises(OptionError, match=word):
            environment.reset(options={"values": given})
    with pytest.raises(OptionError, match="'zz' is not a robot"):
        environment.values("zz")
    environment.reset()
    for wrong in (3, -1, 0.5, "0"):
        with pytest.raises(OptionError, match="action of r0"):
            environment.step({"r0": wrong})


def test_a_refused_step_changes_nothing() -> None:
    environment = parallel_env(chain(), optimum=None, signals=2)
    environment.reset(seed=1)
    before = environment.state().tolist()
    for wrong in (1, (0, 0, 0), (0, float("nan")), (0, "x"), (0, 0.7), (True, 1), (0, 2)):
        with pytest.raises(OptionError, match="of r1 is"):
            environment.step({"r0": (2, 1), "r1": wrong})
    assert environment.state().tolist() == before
    observations = environment.step({})[0]
    assert observations["r1"]["signals"].tolist() == [0, 0]


def test_a_team_that_changes_is_refused() -> None:
    with pytest.raises(UnsupportedError, match="scenario"):
        parallel_env(robochoc.load(ROOT / "docs" / "examples" / "rescue"))
