"""How failures become one clear message and an exit status (FORMAT.md)."""

from __future__ import annotations

from collections.abc import Callable
from functools import wraps
from typing import NoReturn, ParamSpec, TypeVar

import click

INVALID, USAGE, LIMIT, LOST = 1, 2, 3, 4

P = ParamSpec("P")
R = TypeVar("R")


class Failure(click.ClickException):
    """A message on stderr, as it is, and an exit status."""

    def __init__(self, message: str, exit_code: int) -> None:
        super().__init__(message)
        self.exit_code = exit_code

    def show(self, file: object = None) -> None:  # noqa: ARG002 - click's signature
        """Say it on stderr."""
        click.echo(self.message, err=True)


def fail(message: str, exit_code: int) -> NoReturn:
    """End the command."""
    raise Failure(message, exit_code)


def invalid_input_fails(command: Callable[P, R]) -> Callable[P, R]:
    """Let `command` end with its diagnostics, and status 1, when its input is invalid."""

    @wraps(command)
    def guarded(*args: P.args, **kwargs: P.kwargs) -> R:
        from robochoc.formats import InvalidInput

        try:
            return command(*args, **kwargs)
        except InvalidInput as invalid:
            fail(str(invalid), INVALID)

    return guarded
