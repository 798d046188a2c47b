"""Why there is `compapo` and no `apo`: with the sessions of APO as published, runs may go on for ever.

APO's sessions go on without robots that are in others (`wait!`), and hold nobody but those that agreed (Mailler, Lesser
2004). Grinshpoun and Meisels (2008) found that its proof fails there. Here these sessions stand in CompAPO's place.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping
from random import Random

from robochoc.communication.search_result import SearchResult
from robochoc.communication.simulator.schedule import RandomChannels
from robochoc.communication.simulator.simulator import Simulation
from robochoc.generators.random_csp import random_csp
from robochoc.model.outcome import Verdict
from robochoc.model.problem import Team
from robochoc.protocols.order import PriorityOrder
from robochoc.protocols.satisfaction.compapo import Assign, Changes, CompAPO, Evaluate, Evaluation, Ok, Release
from robochoc.protocols.satisfaction.mediation import Mediation, allows, sizes_in
from robochoc.run import Options, Runtime, solve
from robochoc.solver.local_problem import LocalProblem
from robochoc.verification.checker import violations
from tests.support.examples import count


class PartialSessions(CompAPO):
    """APO's sessions: of those of the good_list that agree. Other values are as they were last told."""

    def __init__(self, problem: LocalProblem, order: PriorityOrder) -> None:
        super().__init__(problem, order)
        self.absent: set[str] = set()
        self.places: dict[str, int] = {}

    def _open(self) -> None:
        self.absent = set()
        super()._open()

    def _abandon(self, sender: str, session: int) -> None:
        if self.holder == self.name and session == self.session:
            self.absent.add(sender)

    def _advance(self) -> None:
        if len(self.replies) + len(self.absent) < len(self.asked):
            return
        more = self.good_list - self.asked
        for robot in self._ranked(more):
            self.send(robot, Evaluate(self.session, len(self.good_list), robot not in self.tables))
        self.asked |= more
        if not more:
            self._choose_solution()

    def _evaluated(self, sender: str, reply: Evaluation) -> None:
        super()._evaluated(sender, reply)
        self.places[sender] = reply.place

    def _choose_solution(self) -> None:
        self.places |= {robot: self.domains[robot].index(value) for robot, value in self.view.items()}
        self.places |= {robot: reply.place for robot, reply in self.replies.items()}
        super()._choose_solution()

    def _solved(self, places: Mapping[str, int]) -> dict[str, int] | None:
        tables = [table for table in self._known_tables() if {*table.robots} <= {*self.places}]
        sizes = sizes_in(tables, self.places)
        members = {robot: sizes[robot] for robot in self._ranked(self.replies) if robot in sizes}
        seen = [table for table in tables if not members.keys().isdisjoint(table.robots)]
        found = Mediation(seen, members, self.places).best()
        if found is None:
            return None
        after = {**self.places, **found}
        self.good_list.update(*(table.robots for table in tables if not allows(table, after)))
        return {**places, **found}

    def _end(self, found: Mapping[str, int], changes: Changes, held: Iterable[str]) -> None:
        for robot in self._ranked({*held} - self.absent):
            self.send(robot, Assign(found[robot], {}) if robot in found else Release({}))
        self._move(changes.get(self.name, (self._place(), 0))[0])
        self.holder = None

    def _accept(self, mediator: str, place: int, changes: Changes) -> None:
        self._move(place)
        self._release(mediator, changes)

    def _move(self, place: int) -> None:
        if place != self.value:
            self._change(place)
            for neighbour in self.linked:
                self.send(neighbour, Ok(self.problem.values[place], self.count))


def problem(seed: int) -> Team:
    return random_csp(6, 3, 0.5, Random(seed).choice((0.3, 0.4, 0.5)), seed)


def run(protocol: type[CompAPO], seed: int, messages: int) -> SearchResult:
    return Simulation(problem(seed), protocol, RandomChannels(seed)).search(messages=messages)


def test_on_this_problem_partial_sessions_go_round_in_circles() -> None:
    """Found by random search. Its sessions still change values after what is fifty times enough for CompAPO."""
    endless = run(PartialSessions, 52, 2500)
    assert endless.verdict is Verdict.UNKNOWN
    assert endless.metrics.messages["Assign"] > 150
    complete = run(CompAPO, 52, 2500)
    assert complete.verdict is Verdict.SOLUTION
    assert sum(complete.metrics.messages.values()) < 50


@count("problems", 15, 60)
def test_where_they_end_they_are_right(problems: int) -> None:
    seen = Counter[Verdict]()
    for seed in range(problems):
        result = run(PartialSessions, seed, 1000)
        seen[result.verdict] += 1
        if result.verdict is Verdict.SOLUTION:
            values = {name: value for given in result.assignments.values() for name, value in given.items()}
            assert not [*violations(problem(seed), values)]
        elif result.verdict is Verdict.NO_SOLUTION:
            options = Options(protocol="abt", runtime=Runtime.SIMULATOR)
            assert solve(problem(seed), options).verdict is Verdict.NO_SOLUTION
    assert {Verdict.SOLUTION, Verdict.NO_SOLUTION} <= {*seen}
