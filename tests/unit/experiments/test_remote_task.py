"""Runs on other machines: what travels is enough, and the results are the same as here."""

from __future__ import annotations

import random
import shutil
import signal
import time
from collections.abc import Iterator
from contextlib import ExitStack
from pathlib import Path

import msgspec
import pytest

from robochoc.experiments import read
from robochoc.experiments.execute import TaskRunner
from robochoc.experiments.plan import plan_of
from robochoc.experiments.remote_task import files_of, run_one
from robochoc.experiments.task import Row, Task
from robochoc.formats import InvalidInputError, write_team
from robochoc.generators.queens3d import queens3d
from robochoc.generators.random_csp import random_csp
from robochoc.generators.scenario import random_scenario
from tests.support.dask_cluster import Cluster
from tests.support.faults import PROGRAM, running
from tests.support.limits import wait_until
from tests.support.program import robochoc, robochoc_within
from tests.support.studies import SMALL, comparable, results_of, study

slow = pytest.mark.slow
OF_THE_RUN = ("status", "verdict", "messages", "ncccs", "bytes", "checks", "digest", "team", "cost", "reason")


def same(row: Row) -> list[object]:
    return [getattr(row, name) for name in OF_THE_RUN]


def test_files_travel_with_their_runs(tmp_path: Path) -> None:
    write_team(queens3d(3), tmp_path / "here" / "queens")
    changing = random_scenario(random_csp(5, 3, 0.6, 0.3, 1), 3, 0.3, 2)
    write_team(changing, tmp_path / "here" / "changing")
    (tmp_path / "here" / "graph.yaml").write_text(_PYDCOP)
    tasks = [*_of("here", "dynabt", tmp_path), *_of("here/graph.yaml", "dpop", tmp_path)]
    assert len(tasks) == 3
    with TaskRunner() as bench:
        here = [same(bench.run(task)) for task in tasks]
    travelling = [(msgspec.json.encode(task), files_of(Path(task.problem.path))) for task in tasks]
    shutil.rmtree(tmp_path / "here")
    there = [same(msgspec.json.decode(run_one(content, files), type=Row)) for content, files in travelling]
    assert there == here
    assert [row[0] for row in there] == ["done"] * 3


def _of(path: str, protocol: str, place: Path) -> list[Task]:
    """Return the runs of a protocol on all problems at a path."""
    text = f'[problems]\npath = "{path}"\n[runs]\nprotocol = "{protocol}"\n'
    return list(plan_of(study(text, place / "study.toml")).values())


_PYDCOP = """
name: two
objective: min
domains: {d: {values: [1, 2]}}
variables: {a: {domain: d}, b: {domain: d}}
constraints: {c: {type: intention, function: a + b}}
agents: [x, y]
"""


def test_generated_problems_are_made_there() -> None:
    task = next(iter(plan_of(study(SMALL)).values()))
    with TaskRunner() as bench:
        assert same(msgspec.json.decode(run_one(msgspec.json.encode(task), {}), type=Row)) == same(bench.run(task))


@pytest.mark.parametrize(
    ("content", "said"),
    [
        ("{}", "missing required field `address`"),
        ("[1", "is not a scheduler's file"),
        ('{"address": "nonsense"}', "'nonsense' in .* is not the address of a scheduler"),
    ],
)
def test_what_is_no_file_of_a_scheduler_is_told(content: str, said: str, tmp_path: Path) -> None:
    cluster = pytest.importorskip("robochoc.experiments.cluster")
    (tmp_path / "cluster.json").write_text(content)
    invalid = pytest.importorskip("robochoc.communication.cluster_client").InvalidSchedulerError
    with (
        pytest.raises((invalid, InvalidInputError), match=said),
        cluster.ClusterWorkers(str(tmp_path / "cluster.json")),
    ):
        pass


@pytest.fixture
def cluster(tmp_path: Path) -> Iterator[Cluster]:
    with ExitStack() as stack:
        yield Cluster(stack, tmp_path)


@slow
def test_a_cluster_gives_the_same_results(cluster: Cluster, tmp_path: Path) -> None:
    path = tmp_path / "study.toml"
    path.write_text(SMALL)
    done = robochoc_program("experiment", "run", path, "--cluster", cluster.file)
    assert done == (0, "")
    assert comparable(path.with_suffix(".sqlite")) == comparable(results_of(SMALL))


@slow
def test_a_cluster_whose_workers_are_killed_gives_the_same_results(cluster: Cluster, tmp_path: Path) -> None:
    text = SMALL.replace("1..3", "1..40")
    path = tmp_path / "study.toml"
    path.write_text(text)
    with running([PROGRAM, "experiment", "run", str(path), "--cluster", str(cluster.file)], tmp_path / "run") as run:
        for number in range(4):
            time.sleep(random.Random(number).uniform(0.5, 2))
            victim = cluster.workers.pop(0)
            victim.strike(signal.SIGKILL)
            cluster.workers.append(cluster.add_worker(f"another{number}"))
        assert run.status() == 0, run.errors()
    assert comparable(path.with_suffix(".sqlite")) == comparable(results_of(text))


@slow
def test_a_study_whose_scheduler_is_killed_goes_on(cluster: Cluster, tmp_path: Path) -> None:
    text = SMALL.replace("1..3", "1..60")
    path = tmp_path / "study.toml"
    path.write_text(text)
    with running([PROGRAM, "experiment", "run", str(path), "--cluster", str(cluster.file)], tmp_path / "run") as run:
        wait_until(lambda: _rows(path) > 0 or run.is_over, "no row comes back")
        cluster.scheduler.strike(signal.SIGKILL)
        run.end()
        assert run.status() == 4
        assert "the scheduler of the cluster was lost" in run.errors()
        assert "Traceback" not in run.errors()
    assert 0 < _rows(path) < 240
    assert robochoc_within("experiment", "run", path).returncode == 0
    assert comparable(path.with_suffix(".sqlite")) == comparable(results_of(text))


def _rows(path: Path) -> int:
    try:
        return len(read(path.with_suffix(".sqlite")))
    except InvalidInputError:
        return 0


def robochoc_program(*words: object) -> tuple[int, str]:
    """Run the program in a process of its own: a client of Dask leaves threads."""
    done = robochoc(*words)
    return done.returncode, done.stdout
