"""`Metrics.memory` is exact for robots that use much memory; the others are sampled."""

from __future__ import annotations

import sys

import pytest

from robochoc.communication.processes.processes import ProcessesRun
from robochoc.communication.processes.robot_process import MEASURED
from robochoc.communication.resources import resident_memory
from robochoc.generators.queens3d import queens3d
from robochoc.protocols.satisfaction.abt import ABT

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="only Linux reports the memory")
MUCH = 1 << 26


class Greedy(ABT):
    """The second robot, which is not in the sample, uses 64 MiB."""

    def start(self) -> None:
        if self.order.names.index(self.problem.agent) == 1:
            self.hoard = bytearray(b"x") * MUCH
        super().start()


def test_a_robot_that_grows_is_measured() -> None:
    team = queens3d(4)
    assert len(team.robots) >= 2 * MEASURED
    with ProcessesRun(team, Greedy) as run:
        assert run.search().metrics.memory > MUCH
    with ProcessesRun(team, ABT) as run:
        assert 0 < run.search().metrics.memory < MUCH


def test_resident_memory_grows_by_what_is_used() -> None:
    before = resident_memory()
    hoard = bytearray(b"x") * MUCH
    assert MUCH <= resident_memory() - before < 2 * MUCH
    del hoard
