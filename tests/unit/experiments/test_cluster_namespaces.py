"""A study on a cluster whose machines share nothing but their cables: network namespaces. As root, with iproute2."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from contextlib import ExitStack
from pathlib import Path

import pytest

from robochoc.formats import write_team
from robochoc.generators.queens3d import queens3d
from tests.support.faults import PROGRAM, running
from tests.support.namespaces import namespaces, veth, why_not
from tests.support.program import robochoc_within
from tests.support.studies import SMALL, comparable

WHY_NOT = why_not()
pytestmark = [pytest.mark.slow, pytest.mark.skipif(bool(WHY_NOT), reason=WHY_NOT or "there are namespaces")]
PORT = 8786
"""Nobody else is in the scheduler's namespace."""


@pytest.fixture
def runner(tmp_path: Path) -> Iterator[list[str]]:
    """The words before a command of the machine that runs the study; a scheduler and two workers are elsewhere."""
    pytest.importorskip("distributed")
    with namespaces(4) as (scheduler, *workers, here), ExitStack() as stack:
        for number, other in enumerate((*workers, here)):
            veth((scheduler, f"10.9.{number}.1/24"), (other, f"10.9.{number}.2/24"))
        words = ["dask_scheduler", "--host", "tcp://0.0.0.0", "--port", str(PORT), "--no-dashboard"]
        stack.enter_context(running(_in(scheduler, *words), tmp_path / "scheduler"))
        for number, worker in enumerate(workers):
            words = ["dask_worker", f"tcp://10.9.{number}.1:{PORT}", "--host", f"10.9.{number}.2", "--nthreads", "1"]
            words += ["--no-dashboard", "--no-nanny", "--local-directory", str(tmp_path / f"files{number}")]
            stack.enter_context(running(_in(worker, *words), tmp_path / f"worker{number}"))
        yield ["ip", "netns", "exec", here]


def _in(namespace: str, *words: str) -> list[str]:
    return ["ip", "netns", "exec", namespace, sys.executable, "-m", f"distributed.cli.{words[0]}", *words[1:]]


def test_machines_that_share_nothing_give_the_same_results(runner: list[str], tmp_path: Path) -> None:
    """Generated problems, and a team in files, which travel."""
    write_team(queens3d(3), tmp_path / "teams" / "queens")
    text = SMALL.replace("[problems]", '[[problems]]\npath = "teams/queens"\n[[problems]]')
    path = tmp_path / "study.toml"
    path.write_text(text)
    words = [PROGRAM, "experiment", "run", str(path), "--cluster", f"tcp://10.9.2.1:{PORT}"]
    with running([*runner, *words], tmp_path / "run") as run:
        assert run.status() == 0, run.errors()
    there = path.with_suffix(".sqlite")
    locally = tmp_path / "here.sqlite"
    assert robochoc_within("experiment", "run", path, "-o", locally).returncode == 0
    assert comparable(there) == comparable(locally)
