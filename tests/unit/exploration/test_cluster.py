"""`robochoc check --cluster`: the same results as here, and one clear message if the cluster is lost."""

from __future__ import annotations

import signal
from collections.abc import Iterator
from contextlib import ExitStack
from pathlib import Path

import pytest

from tests.support.cases import cases
from tests.support.compiled import plain_python_only
from tests.support.dask_cluster import Cluster
from tests.support.faults import PROGRAM, Run, running
from tests.support.limits import wait_until
from tests.support.program import ROOT, robochoc, robochoc_within

pytestmark = plain_python_only
slow = pytest.mark.slow
SOME = ("--teams", "8", "--states", "2000", "--json")
ENDLESS = ("--robots", "5", "--values", "4", "--teams", "3", "--states", "100000000")


@pytest.fixture
def cluster(tmp_path: Path) -> Iterator[Cluster]:
    with ExitStack() as stack:
        yield Cluster(stack, tmp_path)


def _wait_for_tasks(cluster: Cluster, run: Run) -> None:
    wait_until(lambda: not cluster.is_idle() or run.is_over, lambda: f"no task begins: {run.errors()}")
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
    cluster.wait_until_idle()


@slow
def test_the_time_limit_keeps_the_states_so_far(cluster: Cluster) -> None:
    done = robochoc("check", "abt", *ENDLESS, "--timeout", "3", "--cluster", cluster.file)
    assert done.returncode == 3, done.stderr
    assert "increase --timeout" in done.stderr
    assert cluster.is_idle()


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
        ("missing.json", 1, "missing.json: is not a scheduler's file: No such file or directory (name the JSON file"),
        ("", 1, "--cluster '': is not a scheduler's file: Is a directory (name the JSON file"),
        ("tcp://127.0.0.1", 2, "expected tcp://HOST:PORT, with a port from 1 to 65535"),
        ("tcp://127.0.0.1:65536", 2, "'tcp://127.0.0.1:65536' is not the address of a scheduler"),
        ("tcp://127.0.0.1:0", 2, "'tcp://127.0.0.1:0' is not the address of a scheduler (port 0)"),
    ],
)
def test_each_command_refuses_a_wrong_cluster_in_the_same_way(place: str, status: int, said: str) -> None:
    pytest.importorskip("distributed")
    solve = ("solve", ROOT / "instances" / "queens3d-4", "--runtime", "arrays", "--protocol", "dsa")
    with cases() as each:
        for command in (("check", "abt"), ("capacity", ROOT / "instances" / "queens3d-4"), solve):
            with each(command[0]):
                done = robochoc_within(*command, "--cluster", place)
                assert done.returncode == status, done.stderr
                assert said in done.stderr
                assert done.stderr.count("\n") == 1
