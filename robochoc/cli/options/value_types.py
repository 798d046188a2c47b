"""Types of option values: numbers within limits, protocol names, and names or files."""

from __future__ import annotations

import math
import os
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from robochoc.cli.options.paths import PathLike

MOST = 10**12
"""The maximum of whole numbers without another one. It is also the maximum of settings (`protocols/settings.py`)."""
LARGEST_SEED = 2**64 - 1
"""The limit in `run/compatibility/option_rules.py`, repeated here because that module is not imported at the start."""

if TYPE_CHECKING:
    from click.shell_completion import CompletionItem


def _limits(kind: click.IntRange | click.FloatRange) -> str:
    """Return the limits of a range in words.

    >>> _limits(click.IntRange(1)), _limits(click.FloatRange(0, 0.9)), _limits(click.FloatRange(0, min_open=True))
    (' of at least 1', ' from 0 to 0.9', ' greater than 0')
    >>> _limits(WholeNumber(1, 1_000_000))
    ' from 1 to 1,000,000'
    """
    low, high = kind.min, kind.max
    if isinstance(low, int) and isinstance(high, int):
        return f" from {low:,} to {high:,}"
    if low is None or high is None:
        return "" if low is None else f" greater than {low:g}" if kind.min_open else f" of at least {low:g}"
    return f" from {low:g} to {high:g}" + (f", but not {low:g}" if kind.min_open else "")


class WholeNumber(click.IntRange):
    """A whole number within limits.

    Args:
        least: The minimum.
        most: The maximum. No number is unlimited: some do not fit the counters of Python's own functions.
    """

    def __init__(self, least: int, most: int = MOST) -> None:
        super().__init__(least, most)

    def _describe_range(self) -> str:
        """Return the range for --help, without a maximum that docs/reference/cli.md states for all commands."""
        return f"x>={self.min}" if self.max in {MOST, LARGEST_SEED} else super()._describe_range()

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:  # noqa: ANN401 - click's signature
        """Return the number, or fail with a message in plain English."""
        try:
            return super().convert(value, param, ctx)
        except click.BadParameter:
            self.fail(f"{value!r} is not a whole number{_limits(self)}", param, ctx)


class Seed(WholeNumber):
    """A random seed."""

    def __init__(self) -> None:
        super().__init__(0, LARGEST_SEED)


class Number(click.FloatRange):
    """A number within limits, which may be infinite."""

    noun = "number"

    def _describe_range(self) -> str:
        """Return the range for --help; empty without limits, for which click would show `x<=None`."""
        return "" if self.min is None and self.max is None else super()._describe_range()

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:  # noqa: ANN401 - click's signature
        """Return the number, or fail with a message in plain English."""
        try:
            number = super().convert(value, param, ctx)
        except click.BadParameter:
            number = math.nan
        if not self._is_allowed(number):
            self.fail(f"{value!r} is not a {self.noun}{_limits(self)}", param, ctx)
        return number

    @staticmethod
    def _is_allowed(number: float) -> bool:
        return not math.isnan(number)


class Finite(Number):
    """A finite number within limits."""

    noun = "finite number"

    @staticmethod
    def _is_allowed(number: float) -> bool:
        return math.isfinite(number)


class Name(click.ParamType[str]):
    """A name. An empty name is an error; otherwise an unset shell variable would mean the default."""

    name = "name"

    def convert(self, value: str, param: click.Parameter | None, ctx: click.Context | None) -> str:
        """Return the name."""
        if not value.strip():
            self.fail("the name is empty", param, ctx)
        return value


class ProtocolName(click.ParamType[str]):
    """The name of an installed protocol, in upper or lower case. The run rejects other words with a hint."""

    name = "protocol"

    def convert(self, value: str, param: click.Parameter | None, ctx: click.Context | None) -> str:  # noqa: ARG002 - click's
        """Return the name in the protocol's own spelling."""
        from robochoc.run.registry import installed_spelling

        return installed_spelling(value)

    def shell_complete(self, ctx: click.Context, param: click.Parameter, incomplete: str) -> list[CompletionItem]:  # noqa: ARG002 - click's
        """Return the protocols whose names begin with `incomplete`."""
        from robochoc.run.defaults import AUTO, CENTRAL
        from robochoc.run.registry import protocol_names

        return _beginning_with(incomplete, (AUTO, *protocol_names(), CENTRAL))


class NameOrFile(click.Path):
    """One of several `names`, or the path of an existing file.

    Args:
        kind: The word for these names in messages, such as `order`.
        names: The names.
        other_spellings: Further spellings of some names.
    """

    def __init__(self, kind: str, names: Sequence[str], other_spellings: dict[str, str] | None = None) -> None:
        super().__init__()
        self._kind = kind
        self._names = names
        self._other_spellings = other_spellings or {}

    def convert(self, value: PathLike, param: click.Parameter | None, ctx: click.Context | None) -> str | Path:
        """Return the name or the path. Any other word is a usage error."""
        word = os.fsdecode(value)
        name = self._other_spellings.get(word, word)
        if name in self._names:
            return name
        if not word or not os.path.lexists(word):
            import difflib

            near = difflib.get_close_matches(name, self._names, 1)
            hint = f"did you mean '{near[0]}'?" if near else f"{self._kind}s: {', '.join(self._names)}"
            self.fail(f"'{word}' is neither a known {self._kind} nor a file; {hint}", param, ctx)
        return Path(word)

    def shell_complete(self, ctx: click.Context, param: click.Parameter, incomplete: str) -> list[CompletionItem]:
        """Return the names that begin with `incomplete`, or files if there are none."""
        return _beginning_with(incomplete, self._names) or super().shell_complete(ctx, param, incomplete)


def _beginning_with(incomplete: str, names: Sequence[str]) -> list[CompletionItem]:
    from click.shell_completion import CompletionItem

    return [CompletionItem(name) for name in names if name.startswith(incomplete.lower())]
