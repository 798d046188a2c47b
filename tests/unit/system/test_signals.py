"""Ctrl-C and SIGTERM that meet the start of a child process."""

from __future__ import annotations

import signal
import subprocess
import sys
from collections.abc import Iterator

import pytest

from robochoc.system.signals import signals_delayed
from tests.support.limits import HANG_S

CHILD = """
import sys
print("begun", flush=True)
sys.stdin.readline()
from robochoc.system.signals import leave_ctrl_c_to_the_parent
leave_ctrl_c_to_the_parent()
print("past it")
"""


@pytest.fixture(autouse=True)
def _ctrl_c_is_heard() -> Iterator[None]:
    """A shell starts what runs in its background with Ctrl-C ignored, and children inherit that."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


@pytest.mark.parametrize(("signum", "says", "status"), [(signal.SIGINT, "past it\n", 0), (signal.SIGTERM, "", -15)])
def test_a_signal_waits_until_the_child_says_what_it_does(signum: signal.Signals, says: str, status: int) -> None:
    with signals_delayed():
        child = subprocess.Popen(
            [sys.executable, "-c", CHILD], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
        )
    assert signal.pthread_sigmask(signal.SIG_BLOCK, ()).isdisjoint({signal.SIGINT, signal.SIGTERM})
    child.send_signal(signum)  # during the start of Python, or soon after
    assert child.stdout, "a pipe"
    assert child.stdout.readline() == "begun\n"
    said, _ = child.communicate("go on\n", timeout=HANG_S)
    assert (said, child.returncode) == (says, status)


def test_a_signal_is_heard_when_all_is_done() -> None:
    done = []
    with pytest.raises(KeyboardInterrupt), signals_delayed():  # noqa: PT012 - the block is what is tested
        signal.raise_signal(signal.SIGINT)
        done.append("all")
    assert done == ["all"]
