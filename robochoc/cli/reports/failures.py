"""Failures as one clear message and an exit status (docs/reference/cli.md)."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from functools import wraps
from typing import IO, Any, ParamSpec, TypeVar

import click

from robochoc.system.errors import TransferableError

INVALID, USAGE, LIMIT, LOST = 1, 2, 3, 4

_WORST_FIRST = (INVALID, USAGE, LOST, LIMIT)

P = ParamSpec("P")
R = TypeVar("R")


class Failure(TransferableError, click.ClickException):  # noqa: N818 - it ends a command, as click's do
    """The command ends with `status`, and its message goes to stderr as it is."""

    def __init__(self, status: int, message: str) -> None:
        super().__init__(message)
        self.exit_code = status  # type: ignore[misc]  # click reads it off instances

    def show(self, file: IO[Any] | None = None) -> None:  # noqa: ARG002 - click's signature
        """Say it on stderr, line by line; there may be words of others in it."""
        from robochoc.system.plain_text import on_one_line

        click.echo("\n".join(map(on_one_line, self.message.split("\n"))), err=True)


def invalid_input_fails(command: Callable[P, R]) -> Callable[P, R]:
    """Let `command` end with its diagnostics, and status 1, when its input is invalid."""

    @wraps(command)
    def guarded(*args: P.args, **kwargs: P.kwargs) -> R:
        from robochoc.formats import InvalidInputError

        try:
            return command(*args, **kwargs)
        except InvalidInputError as invalid:
            raise Failure(INVALID, str(invalid)) from invalid

    return guarded


def worst(statuses: Iterable[int]) -> int:
    """The exit status of a command whose parts ended with `statuses`."""
    found = set(statuses)
    return next((status for status in _WORST_FIRST if status in found), 0)


@contextmanager
def failures_told(place: object) -> Iterator[None]:
    """Turn each foreseen error of the work at `place` into a `Failure` with a message of one line."""
    try:
        yield
    except Exception as error:
        status = _status(error)
        if status is None:
            raise
        from robochoc.formats import on_one_line

        raise Failure(status, str(error) if status == INVALID else on_one_line(f"{place}: {error}")) from error


def _status(error: Exception) -> int | None:
    """The exit status that stands for `error`; None for one that should not be. Imports only what may be wanted."""
    from robochoc.communication.run_result import RobotsLostError
    from robochoc.formats import InvalidInputError
    from robochoc.run.registry import UnknownProtocolError
    from robochoc.solver.compile import CompileError, CompileTimeoutError
    from robochoc.solver.domain import TooManySolutionsError
    from robochoc.solver.encoding import UnsupportedError
    from robochoc.solver.failures import SolverLostError, SolverMissingError
    from robochoc.verification.checker import RefutedError

    statuses: dict[int, tuple[type[Exception], ...]] = {
        INVALID: (InvalidInputError,),
        USAGE: (UnknownProtocolError, UnsupportedError, SolverMissingError),
        LIMIT: (TooManySolutionsError, CompileTimeoutError),
        LOST: (RobotsLostError, CompileError, SolverLostError, RefutedError),
    }
    return next((status for status, kinds in statuses.items() if isinstance(error, kinds)), None)
