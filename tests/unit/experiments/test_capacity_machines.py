"""The capacity of the machines of a Dask cluster, each by itself."""

from __future__ import annotations

import signal
from collections.abc import Iterator
from contextlib import ExitStack
from pathlib import Path

import msgspec
import pytest

from robochoc.experiments.capacity.growth import check_is_complete
from robochoc.experiments.capacity.search import Capacity
from robochoc.experiments.remote_task import files_of
from robochoc.formats import write_team
from robochoc.solver.errors import UnsupportedError
from tests.support.dask_cluster import Cluster
from tests.support.faults import PROGRAM, running
from tests.support.program import robochoc_within
from tests.support.small_teams import triangle
from tests.support.task_lists import LIST

machines = pytest.importorskip("robochoc.experiments.capacity.machines")
_FAST = ["--runtime", "simulator", "--deadline", "1000"]


def test_a_worker_runs_the_command_on_the_files_that_it_gets(tmp_path: Path) -> None:
    for number in (1, 2):
        write_team(triangle(3), tmp_path / str(number) / "team")
    files = [("team", files_of(tmp_path / str(number) / "team")) for number in (1, 2)]
    content, _ = machines.run_capacity(files, [*_FAST, "--timeout", "10000"], 10_000)
    found = msgspec.json.decode(content, type=Capacity)
    assert [step.robots for step in found.steps] == [4, 4]


def test_a_worker_without_a_result_says_why(tmp_path: Path) -> None:
    (tmp_path / "tasks.yaml").write_text("robots: {a: {}}\ntasks: {t: {}}\n")
    content, why = machines.run_capacity([("tasks.yaml", files_of(tmp_path / "tasks.yaml"))], _FAST, 10_000)
    assert not content
    assert "worth" in why
    assert machines.run_capacity([], _FAST, 0.001) == (b"", "no result within 0.001 s")
    assert machines.run_capacity([], _FAST, 10_000, lambda: True) == (b"", "no result within 10000 s")


def test_one_worker_of_each_machine_is_chosen() -> None:
    workers = {"tcp://b:2": {"host": "b"}, "tcp://a:2": {"host": "a"}, "tcp://a:1": {"host": "a"}}
    assert machines.worker_of_each_host(workers) == {"a": "tcp://a:1", "b": "tcp://b:2"}


def test_a_list_with_a_map_is_refused(tmp_path: Path) -> None:
    (tmp_path / "tasks.yaml").write_text(f"map: m.yaml\n{LIST}")
    with pytest.raises(UnsupportedError, match="has a map, which is not sent"):
        check_is_complete([tmp_path / "tasks.yaml"])


@pytest.fixture
def cluster(tmp_path: Path) -> Iterator[Cluster]:
    from distributed import Client  # noqa: PLC0415 - an extra

    with ExitStack() as stack:
        found = Cluster(stack, tmp_path, workers=1)
        with Client(scheduler_file=str(found.file), set_as_default=False) as client:
            client.wait_for_workers(1)
        yield found


@pytest.mark.slow
def test_a_cluster_is_measured(cluster: Cluster, tmp_path: Path) -> None:
    write_team(triangle(3), tmp_path / "team")
    paths = [tmp_path / "team"] * 2
    done = robochoc_within("capacity", *paths, *_FAST, "--timeout", 10_000, "--cluster", cluster.file, "--json")
    assert done.returncode == 0, done.stderr
    (machine,) = msgspec.json.decode(done.stdout)["machines"]
    assert (machine["error"], machine["capacity"]["robots"]) == ("", 4)


@pytest.mark.slow
def test_an_interrupted_command_stops_the_workers(cluster: Cluster, tmp_path: Path) -> None:
    write_team(triangle(3), tmp_path / "team")
    words = [PROGRAM, "capacity", str(tmp_path / "team"), "--timeout", "1000", "--cluster", str(cluster.file)]
    with running(words, tmp_path / "run") as run:
        cluster.wait_for_blocks(run)
        run.strike(signal.SIGINT)
        assert run.status() == 130, run.errors()
    cluster.wait_until_idle()


@pytest.mark.slow
@pytest.mark.parametrize(
    ("lost", "told"),
    [("worker", "127.0.0.1: the worker was lost"), ("scheduler", "the scheduler of the cluster was lost")],
)
def test_a_lost_machine_ends_the_command(lost: str, told: str, cluster: Cluster, tmp_path: Path) -> None:
    write_team(triangle(3), tmp_path / "team")
    words = [PROGRAM, "capacity", str(tmp_path / "team"), "--timeout", "1000", "--cluster", str(cluster.file)]
    with running(words, tmp_path / "run") as run:
        cluster.wait_for_blocks(run)
        (cluster.scheduler if lost == "scheduler" else cluster.workers[0]).strike(signal.SIGKILL)
        run.end()
        assert run.status() == 4
        assert told in run.errors()
        assert "Traceback" not in run.errors()
