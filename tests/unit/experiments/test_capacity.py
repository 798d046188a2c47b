"""The capacity of a machine: how problems grow, which sizes are measured, and which limit is named."""

from __future__ import annotations

import errno
from pathlib import Path
from typing import Any

import msgspec
import pytest

from robochoc.experiments.capacity import measurement, search
from robochoc.experiments.capacity.growth import Growth, grown_list, growth_of
from robochoc.experiments.capacity.measurement import Limit, Step, measured
from robochoc.experiments.capacity.search import Capacity, find_capacity
from robochoc.formats import check_team, read_team, write_team
from robochoc.formats.problems import read_problem
from robochoc.model.copies import copied_team
from robochoc.model.outcome import Outcome, Verdict
from robochoc.model.problem import Team
from robochoc.run import Options, Runtime, solve
from robochoc.solver.errors import TooLargeError, UnsupportedError
from tests.support.example_teams import example
from tests.support.program import ROOT, robochoc_within
from tests.support.small_teams import triangle
from tests.support.task_lists import LIST

SIMULATED = Options(runtime=Runtime.SIMULATOR)


# How problems grow


@pytest.mark.parametrize("name", ["rescue", "scouts", "secrets", "patrol"])
def test_copies_are_a_valid_team_that_can_be_written(name: str, tmp_path: Path) -> None:
    team = example(name)
    found = copied_team(team, 3)
    check_team(found)
    assert len(found.order) == 3 * len(team.order)
    write_team(found, tmp_path / "team")
    assert {*read_team(tmp_path / "team").order} == {*found.order}


def test_copies_have_the_costs_of_the_team_each() -> None:
    team = example("scouts")
    once, twice = (solve(copied_team(team, copies), SIMULATED) for copies in (1, 2))
    assert twice.cost is not None
    assert once.cost is not None
    assert twice.cost == 2 * once.cost


def test_names_of_copies_do_not_clash() -> None:
    names = copied_team(copied_team(triangle(3), 2), 2).order
    assert len({*names}) == 16
    assert {"RA", "RA_2", "RA_2_", "RA_2_2_"} <= {*names}


def test_a_list_grows_with_its_density(tmp_path: Path) -> None:
    path = tmp_path / "tasks.yaml"
    path.write_text(LIST)
    growth = growth_of([path])
    assert "in one list" in growth.text
    one, four = growth.team_at(1), growth.team_at(4)
    assert len(four.order) == 4 * len(one.order)
    best = [solve(team, SIMULATED).cost for team in (one, growth.team_at(2))]
    assert best[0] is not None
    assert best[1] is not None
    assert best[1] >= 2 * best[0]  # each copy can be done as before
    assert not list(tmp_path.glob("*.json"))


def test_copies_of_a_list_lie_beside_each_other_and_keep_their_words() -> None:
    listed: dict[str, Any] = {
        "robots": {"a": {"at": [0, 0], "skills": ["t"]}},
        "tasks": {"t": {"at": [3, 4, 1], "needs": "t", "worth": 5, "after": "u"}, "u": {"worth": 2}},
        "synergies": [{"tasks": ["t", "u"], "worth": 1}],
    }
    found = grown_list(listed, 3)
    assert [*found["robots"]] == ["a", "a_2", "a_3"]
    assert found["robots"]["a_2"] == {"at": [5, 0], "skills": ["t"]}
    assert found["tasks"]["t_3"] == {"at": [3, 10, 1], "needs": "t", "worth": 5, "after": "u_3"}
    assert found["synergies"][1] == {"tasks": ["t_2", "u_2"], "worth": 1}
    assert grown_list(listed, 2, moved=False)["robots"]["a_2"]["at"] == [0, 0]


def test_several_problems_are_measured_as_they_are(tmp_path: Path) -> None:
    for number in (2, 1):
        write_team(copied_team(triangle(3), number), tmp_path / f"t{number}")
    growth = growth_of([tmp_path / "t2", tmp_path / "t1"])
    assert [len(growth.team_at(size).order) for size in (1, 2)] == [4, 8]
    found = find_capacity(growth, SIMULATED, deadline_s=1000, timeout_s=10_000)
    assert [step.robots for step in found.steps] == [4, 8]
    assert found.limit is None


# Which sizes are measured


def measured_until(most: int, limit: Limit, monkeypatch: pytest.MonkeyPatch, *, robot_bytes: int = 0) -> Capacity:
    """Measure a problem whose sizes up to `most` are solved."""

    def step(size: int, team: Team, *_: object, **__: object) -> Step:
        robots = len(team.order)
        return Step(size, robots, robots, limit=None if size <= most else limit, why="why", robot_bytes=robot_bytes)

    monkeypatch.setattr(search, "measured", step)
    growth = Growth("copies", lambda size: copied_team(triangle(3), size))
    return find_capacity(growth, SIMULATED, deadline_s=1, timeout_s=1)


@pytest.mark.parametrize("most", [1, 2, 3, 7, 29, 64])
def test_the_largest_size_is_found_within_a_tenth(most: int, monkeypatch: pytest.MonkeyPatch) -> None:
    found = measured_until(most, Limit.CPU, monkeypatch)
    assert found.limit == Limit.CPU
    assert 4 * most * 10 / 11 - 4 < found.robots <= 4 * most
    sizes = [step.size for step in found.steps]
    assert sizes == sorted({*sizes})
    assert len(sizes) < 14


def test_a_problem_that_is_too_large_at_first() -> None:
    with pytest.MonkeyPatch.context() as patch:
        found = measured_until(0, Limit.DEADLINE, patch)
    assert (found.robots, found.limit, len(found.steps)) == (0, Limit.DEADLINE, 1)


def test_measuring_ends_with_its_time(monkeypatch: pytest.MonkeyPatch) -> None:
    assert [step.size for step in measured_until(4, Limit.TIME, monkeypatch).steps] == [1, 2, 4, 8]


def test_no_size_is_tried_that_needs_more_memory_than_there_is(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(search, "available_bytes", lambda: 1000 << 20)
    found = measured_until(10**6, Limit.CPU, monkeypatch, robot_bytes=10 << 20)
    assert found.limit == Limit.MEMORY
    assert 4 * 20 <= found.robots <= 90
    assert "MiB" in found.why


# Which limit is named


@pytest.mark.parametrize(
    ("error", "limit"),
    [
        (OSError(errno.EAGAIN, "Resource temporarily unavailable"), Limit.PROCESSES),
        (OSError(errno.EMFILE, "Too many open files"), Limit.DESCRIPTORS),
        (MemoryError(), Limit.MEMORY),
        (UnsupportedError("the limit of 64 open files is too low"), Limit.DESCRIPTORS),
        (UnsupportedError("it has a table with too many entries"), Limit.PROBLEM),
    ],
)
def test_the_system_refuses(error: Exception, limit: Limit, monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(*_: object, **__: object) -> Outcome:
        raise error

    monkeypatch.setattr(measurement, "solve", refuse)
    step = measured(2, triangle(3), SIMULATED, 1000, float("inf"))
    assert step.limit == limit
    assert step.why == str(error) or "the system" in step.why or "memory" in step.why


def test_a_refused_problem_is_not_called_too_large(tmp_path: Path) -> None:
    path = tmp_path / "team"
    write_team(triangle(3), path)
    done = robochoc_within("capacity", path, "--protocol", "ssi", "--runtime", "simulator")
    assert done.returncode == 2
    assert "too large" not in done.stderr
    assert "..." not in done.stderr
    assert len(done.stderr.splitlines()) == 1


def test_a_given_problem_that_is_too_large_for_the_protocol(monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(*_: object, **__: object) -> Outcome:
        raise TooLargeError("a table has too many entries")

    monkeypatch.setattr(measurement, "solve", refuse)
    assert measured(1, triangle(3), SIMULATED, 1000, float("inf")).limit == Limit.PROBLEM


@pytest.mark.parametrize(
    ("own_s", "ticks", "limit"),
    [(0.0, (10, 90), Limit.DEADLINE), (1e9, (10, 90), Limit.CPU), (0.0, (90, 10), Limit.CPU)],
)
def test_no_decision_in_time(
    own_s: float, ticks: tuple[int, int], limit: Limit, monkeypatch: pytest.MonkeyPatch
) -> None:
    used, times = iter((0.0, own_s)), iter(((0, 0), ticks))
    monkeypatch.setattr(measurement, "cpu_seconds", lambda: next(used))
    monkeypatch.setattr(measurement, "processor_times", lambda: next(times))
    unknown = Outcome(Verdict.UNKNOWN, team="t", protocol="abt", runtime="simulator", seed=0)
    monkeypatch.setattr(measurement, "solve", lambda *_, **__: unknown)
    assert measured(1, triangle(3), SIMULATED, 1000, float("inf")).limit == limit


def test_other_errors_are_errors(monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(*_: object, **__: object) -> Outcome:
        raise OSError(errno.EIO, "Input/output error")

    monkeypatch.setattr(measurement, "solve", refuse)
    with pytest.raises(OSError, match="Input"):
        measured(1, triangle(3), SIMULATED, 1000, float("inf"))


# The command


def test_the_command(tmp_path: Path) -> None:
    path = tmp_path / "tasks.yaml"
    path.write_text(LIST)
    team = read_problem(path).team
    done = robochoc_within(
        "capacity", path, path, "--runtime", "simulator", "--deadline", 1000, "--timeout", 10_000, "--json"
    )
    assert done.returncode == 0, done.stderr
    found = msgspec.json.decode(done.stdout, type=Capacity)
    assert found.robots == len(team.order)
    assert all(step.messages > 0 for step in found.steps)
    assert f"{len(team.order)} robots: " in done.stderr


def test_a_problem_that_this_machine_does_not_hold(tmp_path: Path) -> None:
    path = tmp_path / "team"
    write_team(copied_team(triangle(3), 100), path)
    done = robochoc_within("capacity", path, "--runtime", "simulator", "--deadline", 0.01, "--timeout", 10_000)
    assert done.returncode == 3
    assert "the given problem is too large: " in done.stderr


def test_too_little_time_for_a_measurement(tmp_path: Path) -> None:
    write_team(triangle(3), tmp_path / "team")
    done = robochoc_within("capacity", tmp_path / "team", "--runtime", "simulator", "--timeout", 1e-9)
    assert done.returncode == 3
    assert "team: could not be measured within --timeout 1e-09 s; use a longer --timeout" in done.stderr


def test_wrong_usage(tmp_path: Path) -> None:
    deadline = robochoc_within("capacity", tmp_path, "--deadline", 0.009)
    assert deadline.returncode == 2
    assert f"is not a number of at least {measurement.DEADLINE_MIN_S}" in deadline.stderr
    scenario = robochoc_within("capacity", ROOT / "docs" / "examples" / "rescue")
    assert scenario.returncode == 2
    assert "has a scenario: " in scenario.stderr
    assert len(scenario.stderr.splitlines()) == 1


def test_what_is_no_problem(tmp_path: Path) -> None:
    (tmp_path / "tasks.yaml").write_text("robots: {a: {}}\ntasks: {t: {}}\n")
    done = robochoc_within("capacity", tmp_path / "tasks.yaml")
    assert done.returncode == 1
    assert "worth" in done.stderr
