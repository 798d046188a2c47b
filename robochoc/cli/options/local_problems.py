"""Options for all commands that compile robots' local problems."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, TypeVar

import click

from robochoc.cli.options.value_types import Number, WholeNumber

if TYPE_CHECKING:
    from robochoc.solver.compile import CompileLimits

Command = TypeVar("Command", bound=Callable[..., object])

_LOCAL_OPTIONS = (
    click.option(
        "--local-solutions",
        type=WholeNumber(1),
        default=100_000,
        show_default=True,
        metavar="N",
        help="Limit on a robot's solutions.",
    ),
    click.option(
        "--local-timeout",
        type=Number(0, min_open=True),
        default=60.0,
        show_default=True,
        metavar="SECONDS",
        help="Time limit of ACE for one robot.",
    ),
    click.option(
        "--ace",
        "always_ace",
        is_flag=True,
        help="Use ACE for small local problems, too.",
    ),
    click.option(
        "--no-cache",
        is_flag=True,
        help="Do not use the cache of solved local problems.",
    ),
)


def local_options(command: Command) -> Command:
    """Add `--local-solutions`, `--local-timeout`, `--ace` and `--no-cache`."""
    for option in reversed(_LOCAL_OPTIONS):
        command = option(command)
    return command


def limits(local_solutions: int, local_timeout: float, *, always_ace: bool) -> CompileLimits:
    """Return the limits set by the options."""
    from robochoc.solver.compile import CompileLimits

    return CompileLimits(local_solutions, local_timeout, always_ace)
