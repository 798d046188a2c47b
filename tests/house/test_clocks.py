"""The tests' own clocks: what stood still is not what took long."""

from __future__ import annotations

import os
import subprocess
import sys
import time

import pytest

from tests.support.clocks import waiting, working

STOP_AND_GO = """
import os, signal, sys, time
stopped = int(sys.argv[1])
os.kill(stopped, signal.SIGSTOP)
time.sleep(1.5)
os.kill(stopped, signal.SIGCONT)
"""


def spin(seconds: float) -> None:
    end = time.process_time() + seconds
    while time.process_time() < end:
        pass


def test_what_computes_for_long() -> None:
    with pytest.raises(AssertionError, match="s of the processor"), working(0.1):
        spin(0.2)
    with working(0.1):
        time.sleep(0.3)


def test_what_waits_for_long_or_not_long_enough() -> None:
    with pytest.raises(AssertionError, match="of which the machine stood still for"), waiting(0.2):
        time.sleep(0.5)
    with pytest.raises(AssertionError, match="of which the machine stood still for"), waiting(0.2):
        spin(0.5)
    with pytest.raises(AssertionError, match=r"0\.\d+ s"), waiting(2, at_least_s=1):
        pass


def test_a_standstill_is_not_the_programs_fault() -> None:
    with waiting(1, at_least_s=1.4):
        subprocess.run([sys.executable, "-c", STOP_AND_GO, str(os.getpid())], check=True)
