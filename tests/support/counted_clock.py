"""A clock on which time passes whenever somebody looks at it: so as much is done by a deadline on every machine."""

from __future__ import annotations

import itertools
import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from types import SimpleNamespace
from unittest.mock import patch

MODULES = (
    "communication.arrays.session",
    "communication.simulator.simulator",
    "run.context",
    "run.orchestrator",
    "run.improvement",
)
"""Where the time of a simulated run is looked at."""


@contextmanager
def time_passes_at_each_look(seconds: float = 1.0) -> Iterator[None]:
    """Let so many seconds pass in simulated runs whenever they look at the clock, and no other time."""
    began, looks = time.monotonic(), itertools.count()
    clock = SimpleNamespace(monotonic=lambda: began + seconds * next(looks))
    with ExitStack() as patches:
        for module in MODULES:
            patches.enter_context(patch(f"robochoc.{module}.time", clock))
        yield
