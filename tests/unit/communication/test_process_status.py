"""How a process ended, where that takes its time to be known."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from collections.abc import Iterator
from multiprocessing.process import BaseProcess
from typing import cast

import pytest

from robochoc.communication.processes import process_status as statuses
from robochoc.communication.processes.process_status import ProcessStatus, describe_end, process_status
from tests.support.limits import wait_until

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="looks into /proc")


class Slow:
    """A process whose sentinel is ready, and whose exit code is there at the fourth look."""

    def __init__(self, pid: int) -> None:
        self.pid = pid
        self._looks = iter([None, None, None, -signal.SIGKILL])

    @property
    def exitcode(self) -> int | None:
        return next(self._looks)


@pytest.fixture
def dying() -> Iterator[int]:
    """A process that has no memory any more, and of which nobody has taken leave."""
    with subprocess.Popen(["true"]) as process:
        wait_until(lambda: process_status(process.pid) is ProcessStatus.DYING, "it lives on")
        yield process.pid


def test_one_that_dies_is_waited_for_however_busy_the_machine_is(dying: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """Its files are closed, so its end is known, seconds before a high `nice` value lets it end."""
    monkeypatch.setattr(statuses, "_EXIT_CODE_S", -1.0)
    assert describe_end(cast("BaseProcess", Slow(dying))) == "its process was killed by SIGKILL"


def test_one_that_lives_on_without_its_files_is_not(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(statuses, "_EXIT_CODE_S", -1.0)
    assert describe_end(cast("BaseProcess", Slow(os.getpid()))) == "its process cannot be reached any more"
