"""`Failure`: an error that ends a command with a message and an exit status (docs/reference/cli.md)."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from functools import wraps
from typing import IO, Any, ParamSpec, TypeVar

import click

from robochoc.system.errors import RobochocError

INVALID, USAGE, LIMIT, LOST = 1, 2, 3, 4

_WORST_FIRST = (INVALID, USAGE, LOST, LIMIT)

P = ParamSpec("P")
R = TypeVar("R")


class Failure(RobochocError, click.ClickException):  # noqa: N818 - it ends a command, as click's do
    """An error that ends the command with `status`. Its message is printed on standard error without a prefix."""

    def __init__(self, status: int, message: str) -> None:
        super().__init__(message)
        self.exit_code = status  # type: ignore[misc]  # click reads it off instances

    def show(self, file: IO[Any] | None = None) -> None:  # noqa: ARG002 - click's signature
        """Print the message line by line. Unprintable characters are escaped, since it may quote untrusted input."""
        from robochoc.system.plain_text import on_one_line

        click.echo("\n".join(map(on_one_line, self.message.split("\n"))), err=True)


def invalid_input_fails(command: Callable[P, R]) -> Callable[P, R]:
    """Make `command` end with diagnostics and status 1 if its input is invalid."""

    @wraps(command)
    def guarded(*args: P.args, **kwargs: P.kwargs) -> R:
        from robochoc.formats import InvalidInputError

        try:
            return command(*args, **kwargs)
        except InvalidInputError as invalid:
            raise Failure(INVALID, str(invalid)) from invalid

    return guarded


def worst(statuses: Iterable[int]) -> int:
    """Return the exit status of a command whose parts ended with `statuses`."""
    found = set(statuses)
    return next((status for status in _WORST_FIRST if status in found), 0)


@contextmanager
def errors_as_failures(place: object) -> Iterator[None]:
    """Convert each foreseen error while working on `place` to a `Failure` with a message of one line."""
    try:
        yield
    except Exception as error:
        status = _status(error)
        if status is None:
            raise
        from robochoc.formats import on_one_line

        raise Failure(status, str(error) if status == INVALID else on_one_line(f"{place}: {error}")) from error


def _status(error: Exception) -> int | None:
    """Return the exit status for `error`, or None for an unforeseen error."""
    from robochoc.communication.search_result import ClusterLostError, RobotsLostError
    from robochoc.formats import InvalidInputError
    from robochoc.model.costs import SeveralObjectivesError
    from robochoc.run.registry import UnknownProtocolError
    from robochoc.solver.compile import CompileError, CompileTimeoutError
    from robochoc.solver.compiled_domain import TooManySolutionsError
    from robochoc.solver.errors import SolverLostError, SolverMissingError, UnsupportedError
    from robochoc.system.parallel_map import ChildDiedError
    from robochoc.verification.checker import RefutedError

    statuses: dict[int, tuple[type[Exception], ...]] = {
        INVALID: (InvalidInputError,),
        USAGE: (UnknownProtocolError, UnsupportedError, SolverMissingError, SeveralObjectivesError),
        LIMIT: (TooManySolutionsError, CompileTimeoutError),
        LOST: (RobotsLostError, ClusterLostError, CompileError, SolverLostError, RefutedError, ChildDiedError),
    }
    return next((status for status, kinds in statuses.items() if isinstance(error, kinds)), None)
