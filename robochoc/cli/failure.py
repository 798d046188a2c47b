"""How failures become one clear message and an exit status (FORMAT.md)."""

from __future__ import annotations

from collections.abc import Callable
from functools import wraps
from typing import IO, Any, ParamSpec, TypeVar

import click

INVALID, USAGE, LIMIT, LOST = 1, 2, 3, 4

P = ParamSpec("P")
R = TypeVar("R")


class BadInput(click.ClickException):
    """The input is invalid: the message goes to stderr as it is."""

    exit_code = INVALID

    def show(self, file: IO[Any] | None = None) -> None:  # noqa: ARG002 - click's signature
        """Say it on stderr."""
        click.echo(self.message, err=True)


def invalid_input_fails(command: Callable[P, R]) -> Callable[P, R]:
    """Let `command` end with its diagnostics, and status 1, when its input is invalid."""

    @wraps(command)
    def guarded(*args: P.args, **kwargs: P.kwargs) -> R:
        from robochoc.formats import InvalidInput

        try:
            return command(*args, **kwargs)
        except InvalidInput as invalid:
            raise BadInput(str(invalid)) from invalid

    return guarded
