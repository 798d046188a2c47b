"""Types of option values: frames, points, wind, failures."""

from __future__ import annotations

import math
from typing import Any

import click

from robochoc.cli.options.numbers import Number

AXES = 3


class FrameType(click.ParamType[str]):
    """The name of a frame."""

    name = "frame"

    def convert(self, value: str, param: click.Parameter | None, ctx: click.Context | None) -> str:
        """Return a name without blanks."""
        if not value or not value.isprintable() or " " in value:
            self.fail(f"{value!r} is no name of a frame, such as map", param, ctx)
        return value


class PointType(click.ParamType["tuple[float, ...]"]):
    """Three numbers with commas between them."""

    name = "point"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> tuple[float, ...]:  # noqa: ANN401 - click's signature
        """Return the numbers of `1,2,0.5`."""
        if isinstance(value, tuple):
            return value
        try:
            point = tuple(map(float, value.split(",")))
        except ValueError:
            point = ()
        if len(point) != AXES or not all(map(math.isfinite, point)):
            self.fail(f"{value!r} is not three numbers such as 1,2,3", param, ctx)
        return point


class WindType(PointType):
    """The velocity of wind; a single number is its speed along x."""

    name = "wind"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> tuple[float, ...]:  # noqa: ANN401 - click's signature
        """Return the numbers of `1,2,0.5`, and for `3` those of `3,0,0`."""
        if not isinstance(value, str) or "," in value:
            return super().convert(value, param, ctx)
        try:
            return super().convert(f"{value},0,0", param, ctx)
        except click.BadParameter:
            self.fail(f"{value!r} is no speed such as 3, nor three numbers such as 1,2,3", param, ctx)


class FailureType(click.ParamType["tuple[str, float]"]):
    """A robot or a drone, and when it fails."""

    name = "failure"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> tuple[str, float]:  # noqa: ANN401 - click's signature
        """Return the name and the seconds of `Robot3.1@5`."""
        from robochoc.ros.simulated_feedback import FAILS_S

        if isinstance(value, tuple):
            return value
        name, at, seconds = value.rpartition("@")
        if not at:
            return value, FAILS_S
        try:
            at_s = float(seconds)
        except ValueError:
            at_s = math.nan
        if not name or not 0 <= at_s < math.inf:
            self.fail(f"{value!r} is not ROBOT or ROBOT@SECONDS", param, ctx)
        return name, at_s


class Finite(Number):
    """A finite number in a range."""

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:  # noqa: ANN401 - click's signature
        """Return the number."""
        number = super().convert(value, param, ctx)
        return number if math.isfinite(number) else self.fail(f"{value} is not a finite number", param, ctx)
