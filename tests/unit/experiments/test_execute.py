"""One run: its row says what the run itself says; whatever goes wrong is a row, too."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path

import msgspec
import pytest

from robochoc.experiments.digests import digest_of_files
from robochoc.experiments.execute import TaskRunner, team_of
from robochoc.experiments.task import ASSIGNMENT, Limits, ProblemSpec, Recording, Row, Setup, Status, Task, options_of
from robochoc.formats.team_writer import write_team
from robochoc.generators.queens3d import queens3d
from robochoc.journal.events import Improved, Sent
from robochoc.journal.journal import Header, JournalRecorder, read_journal
from robochoc.model.problem import Team
from robochoc.run.orchestrator import solve
from robochoc.run.recording import objective_to_record

RANDOM = ProblemSpec(family="random", parameters={"agents": 6, "domain": 3, "density": 0.5, "tightness": 0.4})
COSTS = ProblemSpec(
    family="random", parameters={"agents": 5, "domain": 3, "density": 0.5, "max_cost": 9, "places": 2, "maximize": True}
)
ABT = {"protocol": "abt"}
BOTH = ("cost-over-time", "robots")


@pytest.fixture(scope="module")
def bench() -> Iterator[TaskRunner]:
    with TaskRunner() as one:
        yield one


def row(
    bench: TaskRunner, problem: ProblemSpec, setup: Mapping[str, object] = ABT, record: tuple[str, ...] = ()
) -> Row:
    """Return what comes of a run, as a worker sends it."""
    task = Task(problem=problem, setup=msgspec.convert(setup, Setup), seed=3, record=record)
    return msgspec.json.decode(msgspec.json.encode(bench.run(task)), type=Row)


@pytest.mark.parametrize(
    ("problem", "setup"),
    [
        (RANDOM, {"protocol": "abt"}),
        (RANDOM, {"protocol": "afc-ng", "order": "random", "delay": 20}),
        (RANDOM, {"protocol": "abt", "channel": {"name": "mine", "latency_ms": 3.0}}),
        (RANDOM, {"protocol": "central"}),
        (COSTS, {"protocol": "sfb"}),
        (COSTS, {"protocol": "dsa", "settings": {"cycles": "5", "variant": "A"}}),
        (ProblemSpec(family="queens3d", parameters={"n": 3}), {"protocol": "abt", "withdraw": "minimum"}),
    ],
)  # fmt: skip
def test_a_row_says_what_the_run_says(problem: ProblemSpec, setup: dict[str, object], bench: TaskRunner) -> None:
    found = row(bench, problem, setup)
    team = team_of(problem)
    outcome = solve(team, options_of(msgspec.convert(setup, Setup), seed=3))
    metrics = outcome.metrics
    assert (found.status, found.verdict, found.team) == (Status.DONE, outcome.verdict, team.name)
    assert found.cost == (str(outcome.cost) if problem is COSTS else None)
    assert found.maximises is (problem is COSTS)
    if setup["protocol"] == "central":  # it sends nothing, which is no count to compare with
        assert (found.messages, found.ncccs, found.bytes, found.checks, found.largest) == (None,) * 5
        return
    assert (found.messages, found.ncccs, found.bytes) == (sum(metrics.messages.values()), metrics.ncccs, metrics.bytes)
    assert (found.checks, found.largest) == (metrics.checks, metrics.largest)
    assert found.messages_by_type == metrics.messages
    assert found.simulated_s == (metrics.simulated_s or None)
    assert (found.withdrawn, found.verified) == (len(outcome.withdrawn), outcome.verified)
    assert (found.robots, found.constraints) == (len(team.robots), len(list(team.constraints())))


def test_the_cost_over_time_is_that_of_the_journal(bench: TaskRunner) -> None:
    setup: dict[str, object] = {"protocol": "dsa", "settings": {"cycles": "8"}}
    found = row(bench, COSTS, setup, BOTH)
    assert [(point.time, point.cost) for point in found.cost_over_time] == _improved(team_of(COSTS), setup)
    assert found.cost_over_time[-1].cost == found.cost
    assert [point.messages for point in found.cost_over_time] == sorted(p.messages for p in found.cost_over_time)
    assert sum(load.messages for load in found.loads) == found.messages
    assert sum(load.bytes for load in found.loads) == found.bytes
    assert row(bench, RANDOM, record=BOTH).cost_over_time == []


def _improved(team: Team, setup: dict[str, object]) -> list[tuple[float, str]]:
    options = options_of(msgspec.convert(setup, Setup), seed=3)
    header = Header(team=team.name, protocol="dsa", runtime="simulator", seed=3)
    recorder = JournalRecorder(header, objective_to_record(team, options))
    solve(team, options, observer=recorder)
    events = read_journal(recorder.content()).events
    return [(event.t, str(event.cost)) for event in events if isinstance(event, Improved)]


def test_what_cannot_be_run_is_a_row_that_says_why(bench: TaskRunner, tmp_path: Path) -> None:
    refused = row(bench, COSTS)
    assert refused.status is Status.REFUSED
    assert "abt" in str(refused.reason)
    family = ProblemSpec(family="random", parameters={"agents": 3, "domain": 2, "density": 3.0, "tightness": 0.5})
    invalid = row(bench, family)
    assert (invalid.status, invalid.messages) == (Status.INVALID, None)
    assert "density is 3.0" in str(invalid.reason)
    missing = row(bench, ProblemSpec(path=str(tmp_path / "nothing")))
    assert missing.status is Status.INVALID
    unknown = row(bench, RANDOM, {"protocol": "nobody's"})
    assert (unknown.status, "no protocol" in str(unknown.reason)) == (Status.REFUSED, True)


def test_a_limit_is_a_row_with_what_was_counted_until_then(bench: TaskRunner) -> None:
    found = bench.run(Task(problem=RANDOM, setup=Setup(protocol="abt"), limits=Limits(messages=5)))
    assert (found.status, found.verdict) == (Status.LIMIT, "unknown")
    assert found.messages is not None
    assert found.messages >= 5


def test_limits_on_cycles_and_ncccs(bench: TaskRunner) -> None:
    in_step = Setup(protocol="abt", schedule="cycles")
    whole = bench.run(Task(problem=RANDOM, setup=in_step))
    assert whole.status is Status.DONE
    assert whole.cycles
    found = bench.run(Task(problem=RANDOM, setup=in_step, limits=Limits(cycles=whole.cycles - 1)))
    assert (found.status, found.cycles) == (Status.LIMIT, whole.cycles - 1)
    found = bench.run(Task(problem=RANDOM, setup=in_step, limits=Limits(ncccs=3)))
    assert found.status is Status.LIMIT
    assert row(bench, RANDOM).cycles is None


def test_limits_are_for_those_that_can_keep_them() -> None:
    limits = Limits(timeout=9, messages=8, ncccs=7, cycles=6, memory_mb=5)
    assert limits.applicable_to(Setup(protocol="abt", schedule="cycles")) == limits
    assert limits.applicable_to(Setup(protocol="abt")) == Limits(timeout=9, messages=8, ncccs=7, memory_mb=5)
    assert limits.applicable_to(Setup(protocol="abt", runtime="processes")) == Limits(
        timeout=9, messages=8, memory_mb=5
    )
    assert limits.applicable_to(Setup(protocol="central")) == Limits(timeout=9, memory_mb=5)


def test_a_journal_is_that_of_the_run(bench: TaskRunner) -> None:
    found = row(bench, COSTS, {"protocol": "syncbb"}, (Recording.JOURNAL,))
    journal = read_journal(found.journal)
    assert (journal.header.protocol, journal.header.seed) == ("syncbb", 3)
    assert sum(isinstance(event, Sent) for event in journal.events) == found.messages
    assert any(isinstance(event, Improved) for event in journal.events)
    assert journal.outcome is not None
    assert str(journal.outcome.verdict) == found.verdict


def test_what_ends_by_itself_is_no_limit(bench: TaskRunner) -> None:
    """A problem without a solution: local search comes to its end all the same."""
    found = row(
        bench, ProblemSpec(family="queens3d", parameters={"n": 4}), {"protocol": "dsa", "settings": {"cycles": "3"}}
    )
    assert (found.status, found.verdict) == (Status.ENDED, "unknown")
    assert found.messages


def test_problems_differ_by_how_files_are_read_and_by_their_scenarios(bench: TaskRunner, tmp_path: Path) -> None:
    write_team(team_of(RANDOM), tmp_path / "team")
    path, digest = str(tmp_path / "team"), digest_of_files(tmp_path / "team")
    scenarios = [{"events": 3, "rate": 0.3, "seed": seed} for seed in (1, 2)]
    found = [
        row(bench, ProblemSpec(path=path, digest=digest, scenario=scenario), {"protocol": "dynabt"})
        for scenario in ({}, *scenarios)
    ]
    assert len({one.digest for one in found}) == 3


def test_files_that_have_changed_since_the_plan_are_not_run(tmp_path: Path) -> None:
    """A bench that has run the problem before would not read the files again."""
    write_team(queens3d(3), tmp_path / "team")
    planned = digest_of_files(tmp_path / "team")
    with (tmp_path / "team" / "Robot1.1.xml").open("a") as file:
        file.write("\n")
    with TaskRunner() as bench:
        found = row(bench, ProblemSpec(path=str(tmp_path / "team"), digest=planned))
    assert found.status is Status.INVALID
    assert "has changed since the start of the study" in str(found.reason)


def test_a_protocol_that_fails_is_a_row(bench: TaskRunner, monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(*_: object, **__: object) -> None:
        raise KeyError("mine")

    monkeypatch.setattr("robochoc.experiments.execute.prepare", fail)
    found = bench.run(Task(problem=RANDOM, setup=Setup(protocol="abt")))
    assert (found.status, found.reason) == (Status.ERROR, "KeyError: 'mine'")
    monkeypatch.setattr("robochoc.experiments.execute.prepare", _no_memory)
    assert bench.run(Task(problem=RANDOM, setup=Setup(protocol="abt"))).status is Status.MEMORY


def _no_memory(*_: object, **__: object) -> None:
    raise MemoryError


def test_problems_in_files_and_generated_ones_are_the_same_problem(bench: TaskRunner, tmp_path: Path) -> None:
    path = tmp_path / "queens"
    write_team(queens3d(3), path)
    counts = [
        (found.messages, found.ncccs, found.verdict)
        for found in (
            row(bench, ProblemSpec(path=str(path), digest=digest_of_files(path))),
            row(bench, ProblemSpec(family="queens3d", parameters={"n": 3})),
        )
    ]
    assert counts[0] == counts[1]


def test_a_run_that_ends_before_the_last_problem_has_no_cost(bench: TaskRunner) -> None:
    problem = msgspec.structs.replace(COSTS, scenario={"events": 1, "rate": 0.2, "seed": 1, "kinds": "add-constraint"})
    setup = Setup(protocol="dsa", settings={"cycles": "10"})
    limits = Limits(messages=20)
    with_limit, without = (
        bench.run(Task(problem=problem, setup=setup, limits=one, record=(ASSIGNMENT,))) for one in (limits, Limits())
    )
    assert (with_limit.status, with_limit.cost, with_limit.bound, with_limit.assignment) == (
        Status.LIMIT,
        None,
        None,
        {},
    )
    assert without.cost is not None
    assert without.assignment


HEIGHTS = ProblemSpec(family="heights", parameters={"agents": 3, "levels": 3})


@pytest.mark.parametrize(
    ("setup", "measured"),
    [
        ({"protocol": "mo-dpop"}, False),
        ({"protocol": "dsa", "objectives": "lexicographic:risk,energy"}, False),
        ({"protocol": "dsa", "objectives": "weighted:energy=1,risk=2"}, True),
    ],
)
def test_several_objectives_are_recorded(setup: dict[str, object], measured: bool, bench: TaskRunner) -> None:  # noqa: FBT001
    found = row(bench, HEIGHTS, setup, tuple(Recording))
    assert found.status is Status.DONE, found.reason
    assert found.journal
    assert bool(found.cost_over_time) is measured  # packed costs are not the user's
    if measured:
        assert found.cost_over_time[-1].cost == found.cost


def test_a_protocol_for_a_single_cost_refuses_several_objectives(bench: TaskRunner) -> None:
    found = row(bench, HEIGHTS, {"protocol": "dpop"}, tuple(Recording))
    assert (found.status, "several objectives (energy, risk)" in (found.reason or "")) == (Status.REFUSED, True)


def test_a_scenario_is_drawn(bench: TaskRunner) -> None:
    problem = msgspec.structs.replace(RANDOM, scenario={"events": 3, "rate": 0.2, "seed": 1, "kinds": "add-constraint"})
    found = row(bench, problem, {"protocol": "dynabt"})
    assert found.status is Status.DONE
    assert "events3" in found.team
    assert found.digest != row(bench, RANDOM).digest
