"""DynABT in sessions: complex robots, and changes in quick succession; held against brute force."""

from __future__ import annotations

from collections import Counter
from random import Random

from robochoc.communication.search_result import SearchResult
from robochoc.communication.session import Epoch
from robochoc.communication.simulator.schedule import Concurrent, RandomChannels, Schedule
from robochoc.communication.simulator.simulator import Simulation
from robochoc.model.outcome import Verdict
from robochoc.model.problem import AddAgent, Team
from robochoc.run.registry import protocol_named
from robochoc.run.scenario import ScenarioRun
from robochoc.solver.compiled_team import CompiledTeam
from robochoc.solver.explanation import Invalidated, invalidated_by
from robochoc.verification.checker import violations
from tests.support.brute_force import solutions
from tests.support.complex_changes import random_complex_changing_team
from tests.support.examples import count
from tests.support.random_changes import random_changing_team, stages
from tests.support.solver_networks import compiled_by_brute_force


def random_schedule(chance: Random) -> Schedule:
    seed = chance.getrandbits(30)
    return chance.choice((RandomChannels(seed), *(Concurrent(seed, delay) for delay in (0, 3, 20, 200))))


def played(team: Team, schedule: Schedule) -> Counter[Verdict]:
    """The verdicts of all epochs that came to their end; each is right."""
    journey = ScenarioRun(team, None, compiled_by_brute_force, lambda: None)
    seen = Counter[Verdict]()
    with Simulation(journey.compiled(), protocol_named("dynabt"), schedule) as session:
        epochs = list(journey.epochs(session, lambda _: None))
    for now, epoch in zip(stages(team), epochs, strict=True):
        result = epoch.result
        assert now.order == epoch.team.order
        if result.verdict is not Verdict.UNKNOWN:
            check(now, result)
            seen[result.verdict] += 1
    return seen


def check(team: Team, result: SearchResult) -> None:
    assert result.verdict is (Verdict.SOLUTION if any(solutions(team)) else Verdict.NO_SOLUTION)
    if result.verdict is Verdict.SOLUTION:
        assignment = {name: value for own in result.assignments.values() for name, value in own.items()}
        assert not list(violations(team, assignment))


@count("teams", 10, 500)
def test_complex_robots_agree_with_brute_force_after_each_change(teams: int) -> None:
    chance = Random("dynabt complex")
    seen = Counter[Verdict]()
    for _ in range(teams):
        seen += played(random_complex_changing_team(chance), random_schedule(chance))
    assert min(seen[Verdict.SOLUTION], seen[Verdict.NO_SOLUTION]) > teams, seen
    assert seen.total() > 7 * teams


@count("teams", 8, 40)
def test_the_problem_may_change_again_before_the_search_goes_on(teams: int) -> None:
    """So it is when robots are lost before all have taken in an event."""
    chance = Random("twice")
    for _ in range(teams):
        team = random_changing_team(chance, 8)
        now, *later = stages(team)
        with Simulation(now, protocol_named("dynabt"), random_schedule(chance)) as session:
            check(now, session.search())
            for event, new in zip(team.scenario, later, strict=True):
                fresh = frozenset(change.robot.name for change in event.changes if isinstance(change, AddAgent))
                keys, agents = invalidated_by(now, new)
                session.change(Epoch(CompiledTeam(new), Invalidated(keys, agents | fresh), fresh))
                now = new
                if chance.random() < 0.6 or new is later[-1]:
                    check(now, session.search())
