"""Names on the command line: completed by the shell, and with a hint where one is misspelt."""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import click

from robochoc.cli.options.paths import PathLike

if TYPE_CHECKING:
    from click.shell_completion import CompletionItem


class ProtocolName(click.ParamType[str]):
    """The name of an installed protocol, in any case, or another word, which the run refuses with a hint."""

    name = "protocol"

    def convert(self, value: str, param: click.Parameter | None, ctx: click.Context | None) -> str:  # noqa: ARG002 - click's
        """Return the name as the protocol's package spells it."""
        from robochoc.run.registry import installed_spelling

        return installed_spelling(value)

    def shell_complete(self, ctx: click.Context, param: click.Parameter, incomplete: str) -> list[CompletionItem]:  # noqa: ARG002 - click's
        """Return the protocols whose names begin with `incomplete`."""
        from robochoc.run.defaults import AUTO
        from robochoc.run.options import CENTRAL
        from robochoc.run.registry import protocol_names

        return _beginning_with(incomplete, (AUTO, *protocol_names(), CENTRAL))


class NameOrFile(click.Path):
    """One of `names`, or else the path of a file that is there.

    Args:
        kind: What the names are of, for messages: `order`.
        names: The names.
        other_spellings: Further spellings of some of them.
    """

    def __init__(self, kind: str, names: Sequence[str], other_spellings: dict[str, str] | None = None) -> None:
        super().__init__()
        self._kind = kind
        self._names = names
        self._other_spellings = other_spellings or {}

    def convert(self, value: PathLike, param: click.Parameter | None, ctx: click.Context | None) -> str | Path:
        """Return the name, or the path. Fail, as wrong usage, where it is neither."""
        word = os.fsdecode(value)
        name = self._other_spellings.get(word, word)
        if name in self._names:
            return name
        if not word or not os.path.lexists(word):
            import difflib

            near = difflib.get_close_matches(name, self._names, 1)
            hint = f"did you mean '{near[0]}'?" if near else f"{self._kind}s: {', '.join(self._names)}"
            self.fail(f"'{word}' is no {self._kind} and no file; {hint}", param, ctx)
        return Path(word)

    def shell_complete(self, ctx: click.Context, param: click.Parameter, incomplete: str) -> list[CompletionItem]:
        """Return the names that begin with `incomplete`, and where there is none, files."""
        return _beginning_with(incomplete, self._names) or super().shell_complete(ctx, param, incomplete)


def _beginning_with(incomplete: str, names: Sequence[str]) -> list[CompletionItem]:
    from click.shell_completion import CompletionItem

    return [CompletionItem(name) for name in names if name.startswith(incomplete.lower())]
