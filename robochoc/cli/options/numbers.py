"""Numbers within limits, as option values: what is wrong with one is said in plain English."""

from __future__ import annotations

from typing import Any

import click


def _limits(kind: click.IntRange | click.FloatRange) -> str:
    """Return the limits of a range in words.

    >>> _limits(click.IntRange(1)), _limits(click.FloatRange(0, 0.9)), _limits(click.FloatRange(0, min_open=True))
    (' of at least 1', ' from 0 to 0.9', ' greater than 0')
    """
    low, high = kind.min, kind.max
    if low is None or high is None:
        return "" if low is None else f" greater than {low:g}" if kind.min_open else f" of at least {low:g}"
    return f" from {low:g} to {high:g}" + (f", but not {low:g}" if kind.min_open else "")


class WholeNumber(click.IntRange):
    """A whole number within limits."""

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:  # noqa: ANN401 - click's signature
        """Return the number."""
        try:
            return super().convert(value, param, ctx)
        except click.BadParameter:
            self.fail(f"{value!r} is no whole number{_limits(self)}", param, ctx)


class Number(click.FloatRange):
    """A number within limits."""

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:  # noqa: ANN401 - click's signature
        """Return the number."""
        try:
            return super().convert(value, param, ctx)
        except click.BadParameter:
            self.fail(f"{value!r} is no number{_limits(self)}", param, ctx)
