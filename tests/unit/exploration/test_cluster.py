"""`robochoc check --cluster`: the same results as here, and one clear message if the cluster is lost."""

from __future__ import annotations

import signal
from collections.abc import Iterator
from contextlib import ExitStack
from pathlib import Path

import pytest

from tests.support.compiled import plain_python_only
from tests.support.dask_cluster import Cluster
from tests.support.faults import PROGRAM, Run, running
from tests.support.limits import wait_until
from tests.support.program import robochoc, robochoc_within

pytestmark = plain_python_only
slow = pytest.mark.slow
SOME = ("--teams", "8", "--states", "2000", "--json")
ENDLESS = ("--robots", "5", "--values", "4", "--teams", "3", "--states", "100000000")


@pytest.fixture
def cluster(tmp_path: Path) -> Iterator[Cluster]:
    with ExitStack() as stack:
        yield Cluster(stack, tmp_path)


def _is_idle(cluster: Cluster) -> bool:
    """Return whether no worker executes a task."""
    from distributed import Client  # noqa: PLC0415 - an extra

    with Client(scheduler_file=str(cluster.file), set_as_default=False) as client:
        return not any(client.call_stack().values())


def _wait_for_tasks(cluster: Cluster, run: Run) -> None:
    wait_until(lambda: not _is_idle(cluster) or run.is_over, lambda: f"no task begins: {run.errors()}")
    assert not run.is_over, run.errors()


@slow
def test_a_cluster_gives_the_same_results(cluster: Cluster) -> None:
    here, there = robochoc("check", "adopt", *SOME), robochoc("check", "adopt", *SOME, "--cluster", cluster.file)
    assert there.returncode == here.returncode == 3
    assert there.stdout == here.stdout


@slow
def test_a_killed_worker_does_not_change_the_results(cluster: Cluster, tmp_path: Path) -> None:
    words = ["check", "adopt", *SOME[:2], "--states", "6000", "--json"]
    with running([PROGRAM, *words, "--cluster", str(cluster.file)], tmp_path / "run") as run:
        _wait_for_tasks(cluster, run)
        cluster.workers.pop(0).strike(signal.SIGKILL)
        assert run.status() == 3, run.errors()
        there = run.output()
    assert there == robochoc(*words).stdout


@slow
@pytest.mark.parametrize(("signum", "status"), [(signal.SIGINT, 130), (signal.SIGTERM, 143), (signal.SIGKILL, -9)])
def test_a_signal_stops_the_workers(cluster: Cluster, tmp_path: Path, signum: signal.Signals, status: int) -> None:
    with running([PROGRAM, "check", "abt", *ENDLESS, "--cluster", str(cluster.file)], tmp_path / "run") as run:
        _wait_for_tasks(cluster, run)
        run.strike(signum)
        assert run.status() == status, run.errors()
        assert "Traceback" not in run.errors()
    wait_until(lambda: _is_idle(cluster), "the workers continue")


@slow
def test_the_time_limit_keeps_the_states_so_far(cluster: Cluster) -> None:
    done = robochoc("check", "abt", *ENDLESS, "--timeout", "3", "--cluster", cluster.file)
    assert done.returncode == 3, done.stderr
    assert "increase --timeout" in done.stderr
    assert _is_idle(cluster)


@slow
def test_a_lost_scheduler_ends_the_check(cluster: Cluster, tmp_path: Path) -> None:
    with running([PROGRAM, "check", "abt", *ENDLESS, "--cluster", str(cluster.file)], tmp_path / "run") as run:
        _wait_for_tasks(cluster, run)
        cluster.scheduler.strike(signal.SIGKILL)
        run.end()
        assert run.status() == 4
        assert run.errors().splitlines() == ["abt: the scheduler of the cluster was lost: repeat the command"]


@pytest.mark.parametrize(
    ("place", "status", "said"),
    [
        ("missing.json", 1, "missing.json is not a file; name the file of 'dask scheduler --scheduler-file'"),
        ("", 1, "--cluster '' is not a file; name the file of 'dask scheduler --scheduler-file'"),
        ("tcp://127.0.0.1", 2, "expected tcp://HOST:PORT, with a port from 1 to 65535"),
        ("tcp://127.0.0.1:65536", 2, "'tcp://127.0.0.1:65536' is not the address of a scheduler"),
        ("tcp://127.0.0.1:0", 2, "'tcp://127.0.0.1:0' is not the address of a scheduler (port 0)"),
    ],
)
def test_a_wrong_cluster_is_refused(place: str, status: int, said: str) -> None:
    pytest.importorskip("distributed")
    done = robochoc_within("check", "abt", "--cluster", place)
    assert done.returncode == status
    assert said in done.stderr
    assert done.stderr.count("\n") == 1
