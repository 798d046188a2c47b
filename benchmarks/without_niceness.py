"""The `robochoc` command with robots that all have the same priority for the scheduler: a benchmark's switch only."""

from __future__ import annotations

from collections.abc import Sequence

from robochoc.cli.main import main
from robochoc.communication.processes import robot_process


def _set_no_niceness(name: str, order: Sequence[str]) -> None:
    """Stay as you are."""


if __name__ == "__main__":
    robot_process._set_niceness = _set_no_niceness  # noqa: SLF001 - what is being switched off
    main()
