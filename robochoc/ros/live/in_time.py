"""Calls of libraries that may never return: they get a thread of their own, and limited time."""

from __future__ import annotations

import threading
from collections.abc import Callable


def succeeds_in_time(work: Callable[[], object], limit_s: float) -> bool:
    """Return whether `work` succeeds within `limit_s` seconds. Its thread may be left behind; signals are heard."""
    problems: list[Exception] = []

    def watched() -> None:
        try:
            work()
        except Exception as problem:  # noqa: BLE001 - the caller learns that it failed
            problems.append(problem)

    doing = threading.Thread(target=watched, daemon=True, name="asks a library")
    doing.start()
    doing.join(limit_s)
    return not doing.is_alive() and not problems
