"""What the proof in docs/explanation/sfb.md rests on, looked at in every message of random runs."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Mapping, Sequence
from random import Random
from typing import Any

import numpy as np

from robochoc.communication.simulator.schedule import RandomChannels
from robochoc.communication.simulator.simulator import Simulation
from robochoc.journal.events import Sent
from robochoc.model.outcome import Verdict
from robochoc.model.problem import INFINITE, Team
from robochoc.protocols.optimization.sfb import SFB, Explored, Solution
from robochoc.protocols.optimization.sfb_bounds import BOUND, COST, VALUES
from robochoc.protocols.order import PriorityOrder
from robochoc.solver.agent_problem import RunParameters, agent_problems
from robochoc.solver.local_problem import LocalProblem
from tests.support.agents import replies
from tests.support.brute_force import least_cost
from tests.support.cost_problems import cost_of, random_cost_team
from tests.support.examples import count
from tests.support.sfb_robots import CHAIN, introduced, team


class Prices:
    """What partial assignments cost, and their bounds, from the team's constraints and nothing of SFB's."""

    def __init__(self, problem: Team) -> None:
        self.names = PriorityOrder(problem.order).names
        parts = agent_problems(problem, shared_scopes=True)
        values = [LocalProblem(parts[name]).values for name in self.names]
        self.domains = [[value[0] for value in own if value[0] is not None] for own in values]
        self.variables = [problem[name].interface[0] for name in self.names]
        self.constraints = list(problem.constraints())

    def cost(self, places: Sequence[int]) -> float:
        return cost_of(self._chosen(places), self._within({*self.variables[: len(places)]}))

    def bound(self, places: Sequence[int]) -> float:
        chosen, higher = self._chosen(places), {*self.variables[: len(places)]}
        total = self.cost(places)
        for variable, domain in [*zip(self.variables, self.domains, strict=True)][len(places) :]:
            due = [one for one in self._within({*higher, variable}) if variable in one.variables]
            total += min(cost_of({**chosen, variable: value}, due) for value in domain)
        return total

    def _chosen(self, places: Sequence[int]) -> dict[str, int]:
        return {name: domain[place] for name, domain, place in zip(self.variables, self.domains, places, strict=False)}

    def _within(self, names: set[str]) -> list[Any]:
        return [one for one in self.constraints if names.issuperset(one.variables)]


class Auditor:
    """Holds each message of a run against the statements of the proof."""

    def __init__(self, problem: Team, least: float) -> None:
        self.prices = Prices(problem)
        self.least = least
        self.prefixes: set[tuple[int, ...]] = set()
        self.found: dict[str, list[int]] = {name: [] for name in self.prices.names}
        self.said: Counter[tuple[str, str]] = Counter()

    def __call__(self, event: object) -> None:
        if not isinstance(event, Sent):
            return
        self.said[event.type, event.sender] += 1
        if event.type == "CPAs":
            self._cpas(event)
        elif event.type == "Solution":
            self._solution(event.sender, event.content)

    def _cpas(self, event: Sent) -> None:
        said, rank = event.content, self.prices.names.index(event.sender)
        below = self.found[event.receiver]
        assert said["least"] in {said["ceiling"], *below}, "the bound is the cost of a solution that came from below"
        for row in rows_of(said, sum(map(len, self.prices.domains[rank + 1 :])), rank):
            prefix = tuple(row[VALUES : VALUES + rank + 1])
            assert prefix not in self.prefixes, "no partial assignment is made twice"
            self.prefixes.add(prefix)
            assert (row[COST], row[BOUND]) == (self.prices.cost(prefix), self.prices.bound(prefix))
            assert row[BOUND] < said["least"]

    def _solution(self, sender: str, said: Mapping[str, Any]) -> None:
        assert said["cost"] == self.prices.cost(said["places"])
        assert self.least <= said["cost"] < min([math.inf, *self.found[sender]]), "each is cheaper than the one before"
        self.found[sender].append(said["cost"])


def rows_of(said: Mapping[str, Any], below: int, rank: int) -> list[list[int]]:
    """The partial assignments in a message, as numbers."""
    columns = VALUES + rank + 1 + below
    kind = {1: "<u1", 2: "<u2", 4: "<u4", 8: "<i8"}[len(said["rows"]) // (said["count"] * columns)]
    rows: list[list[int]] = np.frombuffer(said["rows"], kind).reshape(said["count"], columns).tolist()
    return rows


@count("teams", 12, 3600)
def test_every_message_is_as_the_proof_says_and_the_answer_is_right(teams: int) -> None:
    chance = Random("sfb proof")
    looked_at = 0
    for seed in range(teams):
        problem = random_cost_team(chance)
        if not all(robot.interface for robot in problem.robots):
            continue
        looked_at += 1
        choices = {"window": (1, 2, 3), "memory": (1, 60, 2000, 1 << 26), "batch": (1, 3, 4096)}
        settings = {name: str(chance.choice(several)) for name, several in choices.items()}
        least = least_cost(problem)
        auditor = Auditor(problem, least)
        parameters = RunParameters(settings=settings)
        end = Simulation(problem, SFB, RandomChannels(seed), observer=auditor, parameters=parameters).run(60)
        assert (end.verdict is Verdict.NO_SOLUTION) == (least == INFINITE)
        assert least == min([INFINITE, *auditor.found[auditor.prices.names[1]]])
        for above, below in zip(auditor.prices.names, auditor.prices.names[1:], strict=False):
            assert auditor.said["CPAs", above] == auditor.said["Explored", below], "each message is answered once"
    assert looked_at > teams / 3


def test_messages_that_overtake_others_would_make_the_answer_wrong() -> None:
    """The proof needs channels that keep the order: here the end of the search is faster than its only solution."""
    robots, _ = introduced(team(CHAIN))
    replies(robots["RA"], ("RB", Explored()))
    replies(robots["RA"], ("RB", Solution(1, [1, 0, 0])))
    assert robots["RA"].verdict is Verdict.NO_SOLUTION
