"""Arrays on a Dask cluster of this machine: the same results as in one process, and errors when something is lost."""

from __future__ import annotations

import json
import signal
import sys
from collections.abc import Iterator
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import pytest

from robochoc.formats import write_team
from robochoc.generators.coloring import coloring
from tests.support.dask_cluster import Cluster
from tests.support.faults import PROGRAM, running
from tests.support.program import robochoc, robochoc_within

pytestmark = pytest.mark.more
IN_PYTHON = """
import sys
import numpy as np
import robochoc
edges = [(robot, (robot + step) % 3000) for robot in range(3000) for step in (1, 60)]
problem = robochoc.ArrayProblem(3000, 4, edges, np.eye(4), charges=np.arange(12000).reshape(3000, 4) % 3)
for protocol in ("dsa", "mgm", "maxsum"):
    whole, blocks = (problem.solve(protocol, cycles=9, cluster=one) for one in (None, sys.argv[1]))
    assert whole.costs == blocks.costs
    assert (whole.values == blocks.values).all()
    assert whole.metrics.messages == blocks.metrics.messages
assert len(problem.solve("dsa", cycles=10**6, timeout=0.5, cluster=sys.argv[1]).costs) < 10**6
"""


@pytest.fixture
def cluster(tmp_path: Path) -> Iterator[Cluster]:
    with ExitStack() as stack:
        yield Cluster(stack, tmp_path, workers=3)


@pytest.fixture
def team(tmp_path: Path) -> Path:
    write_team(coloring(60, 4, 1), tmp_path / "team")
    return tmp_path / "team"


def solved(team: Path, status: int, *words: object) -> dict[str, Any]:
    done = robochoc("solve", team, "--runtime", "arrays", "--json", *words)
    assert done.returncode == status, done.stderr
    outcome: dict[str, Any] = json.loads(done.stdout)
    outcome["metrics"]["wall_s"] = 0
    return outcome


def test_a_cluster_gives_the_same_results(cluster: Cluster, team: Path) -> None:
    for status, *words in ((0, "--protocol", "dsa"), (3, "--protocol", "mgm", "--messages", "2000")):
        assert solved(team, status, *words, "--cluster", cluster.file) == solved(team, status, *words)
    with running([sys.executable, "-c", IN_PYTHON, str(cluster.file)], team.parent / "python") as run:
        assert run.status() == 0, run.errors()


@pytest.mark.parametrize("victim", ["worker", "scheduler"])
def test_a_loss_ends_the_run(cluster: Cluster, team: Path, victim: str) -> None:
    words = ["--runtime", "arrays", "--protocol", "mgm", "--set", "cycles=1000000", "--cluster", str(cluster.file)]
    with running([PROGRAM, "solve", str(team), *words], team.parent / "run") as run:
        cluster.wait_for_blocks(run)
        (cluster.workers[1] if victim == "worker" else cluster.scheduler).strike(signal.SIGKILL)
        run.end()
        assert run.status() == 4, run.errors()
        assert "lost" in run.errors()
        assert "Traceback" not in run.errors()
    if victim == "worker":  # the others are free again
        done = robochoc_within("solve", team, "--runtime", "arrays", "--protocol", "dsa", "--cluster", cluster.file)
        assert done.returncode == 0


def test_two_runs_use_a_cluster_at_the_same_time(cluster: Cluster, team: Path) -> None:
    """Each worker has one thread. The second run does not wait for the first, so they cannot wait for each other."""
    words = ["--runtime", "arrays", "--protocol", "dsa", "--cluster", str(cluster.file)]
    with running([PROGRAM, "solve", str(team), *words, "--set", "cycles=1000000"], team.parent / "run") as run:
        cluster.wait_for_blocks(run)
        assert robochoc("solve", team, *words).returncode == 0
        assert not run.is_over, run.errors()
