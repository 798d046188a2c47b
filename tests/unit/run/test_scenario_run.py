"""A team on its way through events and losses, with a session that does as it is told."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from robochoc.communication.run_result import RunResult
from robochoc.communication.session import Epoch, Session
from robochoc.communication.simulator.schedule import Concurrent
from robochoc.communication.simulator.simulator import Simulation
from robochoc.formats import read_team, write_team
from robochoc.model.change import apply_changes
from robochoc.model.outcome import Metrics, Verdict
from robochoc.model.problem import (
    AddAgent,
    AddConstraint,
    AddValue,
    Change,
    Constraint,
    Domain,
    Parent,
    Relation,
    RemoveAgent,
    RemoveConstraint,
    RemoveValue,
    Robot,
    ScenarioEvent,
    Semantics,
    Team,
    Variable,
)
from robochoc.protocols.satisfaction.dynabt import DynABT
from robochoc.run import Options, Runtime, solve
from robochoc.run.scenario import FinishedEpoch, ScenarioRun
from robochoc.solver.compiled_team import CompiledTeam
from robochoc.solver.explanation import invalidated_by
from tests.support.problems import team_of
from tests.support.small_teams import differ

BASE = team_of(dict.fromkeys("ABC", range(1, 4)), [differ("A", "B"), differ("B", "C")])
DONE = RunResult(Verdict.SOLUTION, None, {}, Metrics({"Ok": 7}))


class Scripted(Session):
    """Ends each search as it was told to, and notes what it is given."""

    def __init__(self, team: Team, *results: RunResult) -> None:
        super().__init__(team)
        self.results = list(results)
        self.epochs: list[Epoch] = []
        self.limits: list[int | None] = []

    @property
    def lossless(self) -> bool:
        return True

    def search(self, timeout: float | None = None, messages: int | None = None) -> RunResult:
        assert timeout is None
        self.limits.append(messages)
        return self.results.pop(0) if self.results else DONE

    def change(self, epoch: Epoch) -> None:
        self.compiled = epoch.compiled
        self.epochs.append(epoch)

    def close(self) -> None:
        """Nothing to close."""


def losing(*names: str) -> RunResult:
    return replace(DONE, verdict=Verdict.UNKNOWN, lost=dict.fromkeys(names, "it was hit by a meteor"))


def event(*changes: Change) -> ScenarioEvent:
    return ScenarioEvent(changes)


def journey_of(team: Team, *, spares: int = 0, messages: int | None = None) -> ScenarioRun:
    return ScenarioRun(team, None, CompiledTeam, lambda: None, messages=messages, spares=spares)


def travel(journey: ScenarioRun, session: Scripted) -> list[FinishedEpoch]:
    return list(journey.epochs(session, lambda _: None))


def teams(played: Sequence[FinishedEpoch]) -> list[tuple[str, ...]]:
    return [one.team.order for one in played]


def newcomer(name: str, *parents: str) -> Robot:
    own = name[1:]
    domain = Domain("D", (range(1, 4),))
    links = tuple(Parent(parent, (differ(parent[1:], own),)) for parent in parents)
    return Robot(name, (Variable(own, domain),), parents=links)


def on_disk(team: Team, folder: Path) -> Team:
    """The team with files that can be read again."""
    write_team(replace(team, scenario=()), folder)
    return replace(read_team(folder), scenario=team.scenario)


def test_a_lost_robot_leaves_and_the_others_go_on() -> None:
    journey, session = journey_of(BASE), Scripted(BASE, losing("RB"))
    assert teams(travel(journey, session)) == [("RA", "RB", "RC"), ("RA", "RC")]
    assert journey.withdrawn == ["RB"]
    assert "RB" in session.epochs[0].invalidated.agents


def test_events_go_on_without_those_that_were_lost() -> None:
    team = replace(
        BASE,
        scenario=(event(AddAgent(newcomer("RD", "RA", "RB"))), event(RemoveAgent("RB")), event(RemoveValue("D", 1))),
    )
    journey = journey_of(team)
    played = travel(journey, Scripted(journey.team, losing("RB")))
    assert teams(played) == [("RA", "RB", "RC"), ("RA", "RC"), *[("RA", "RC", "RD")] * 3]
    assert [parent.name for parent in played[-1].team["RD"].parents] == ["RA"]
    assert list(played[-1].team.variables["D"].domain) == [2, 3]
    assert journey.withdrawn == [], "it would have left by now"


def test_a_team_that_all_have_left_may_be_joined() -> None:
    everybody = event(*map(RemoveAgent, BASE.order))
    team = replace(BASE, scenario=(everybody, event(AddAgent(newcomer("RD")))))
    assert teams(travel(journey_of(team), Scripted(team))) == [("RA", "RB", "RC"), (), ("RD",)]
    news = iter(team.scenario)
    here = Options(protocol="dynabt", runtime=Runtime.SIMULATOR)
    outcome = solve(BASE, here, environment=lambda *_: next(news, None))  # a scenario must leave somebody, as in files
    assert [str(epoch.verdict) for epoch in outcome.epochs] == ["solution"] * 3


def test_all_are_lost() -> None:
    played = travel(journey_of(BASE), Scripted(BASE, losing(*BASE.order)))
    assert len(played) == 1
    assert set(played[0].result.lost) == {"RA", "RB", "RC"}


def test_a_spare_comes_back_at_the_end_of_the_order(tmp_path: Path) -> None:
    journey = journey_of(on_disk(BASE, tmp_path / "team"), spares=1)
    session = Scripted(journey.team, losing("RA"), losing("RC"))
    travel(journey, session)
    assert [epoch.team.order for epoch in session.epochs] == [("RB", "RC", "RA"), ("RB", "RA")]
    assert [epoch.restarted for epoch in session.epochs] == [{"RA"}, set()]
    assert journey.withdrawn == ["RC"]


def test_what_has_happened_meanwhile_happens_to_a_spare_too(tmp_path: Path) -> None:
    happened = event(
        RemoveValue("A", 1), RemoveConstraint("RB", "RA", "C"), AddConstraint("RC", "RA", differ("A", "C", "new"))
    )
    team = on_disk(replace(BASE, scenario=(happened, event(AddValue("A", 1)))), tmp_path / "team")
    journey, session = journey_of(team, spares=1), Scripted(team, DONE, losing("RA"))
    played = travel(journey, session)
    back = played[2].team
    assert list(back.variables["A"].domain) == [2, 3]
    assert [constraint.variables for constraint in back.constraints()] == [("B", "C"), ("A", "C")]
    assert list(played[3].team.variables["A"].domain) == [1, 2, 3]
    assert [constraint.name for constraint in session.epochs[1].team["RA"].shared] == ["new"]


def test_messages_are_counted_over_all_epochs() -> None:
    team = replace(BASE, scenario=(event(AddValue("A", 8)), event(AddValue("A", 9))))
    session = Scripted(BASE)
    played = travel(journey_of(team, messages=10), session)
    assert session.limits == [10, 3]
    assert [one.result.verdict for one in played] == [Verdict.SOLUTION, Verdict.SOLUTION, Verdict.UNKNOWN]


# DynABT between two changes


def test_two_changes_in_a_row_tell_a_new_child() -> None:
    team = team_of(
        {"A": range(1, 4), "B": range(1, 4), "C": range(3, 5), "D": range(3, 5), "Z": range(1, 4)},
        [differ("A", "C"), differ("B", "D")],
    )
    linked = apply_changes(team, [AddConstraint("RB", "RA", differ("A", "B"))])
    less = apply_changes(linked, [RemoveAgent("RZ")])
    session = Simulation(team, DynABT, Concurrent(0))
    session.search()
    session.change(Epoch(CompiledTeam(linked), invalidated_by(team, linked)))  # and before the search goes on
    session.change(Epoch(CompiledTeam(less), invalidated_by(linked, less)))
    result = session.search()
    assert result.verdict is Verdict.SOLUTION
    assert result.assignments["RA"]["A"] != result.assignments["RB"]["B"]


def test_links_that_were_asked_for_outlive_a_change_of_the_interface() -> None:
    def forbids(name: str, scope: tuple[str, ...], *rows: tuple[int, ...]) -> Constraint:
        return Constraint(name, Relation("R", len(scope), Semantics.CONFLICTS, rows), scope, scope)

    def variable(name: str, *values: int) -> Variable:
        return Variable(name, Domain("D", tuple(range(value, value + 1) for value in values)))

    robots = (
        Robot("P", (variable("p", 1),)),
        Robot("X", (variable("x", 1, 2),)),
        Robot("V", (variable("v", 1, 2), variable("w", 1))),
        Robot("Y", (variable("y", 1),)),
    )
    team = apply_changes(
        Team("links", robots),
        [
            AddConstraint("V", "P", forbids("q", ("p", "w"), (5, 5))),
            AddConstraint("Y", "V", forbids("c", ("x", "v", "y"), (1, 1, 1), (2, 1, 1))),
        ],
    )
    hidden = ScenarioEvent((RemoveConstraint("V", "P", "q"), RemoveValue("x", 1)))
    outcome = solve(
        replace(team, scenario=(hidden,)), Options(protocol="dynabt", runtime=Runtime.SIMULATOR, messages=500)
    )
    assert outcome.verdict is Verdict.SOLUTION
