"""Commands with many options: their help has named sections, and the options that most runs need stand first."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from typing import Any

import click

Sections = Mapping[str, Sequence[str]]
"""Titles of sections, and the options in each: `{"Output": ("--json", "--html")}`."""

COMMON = "Common options"
"""The title of the first section."""
REST = "Other options"
_COLUMN = 26
"""Characters. A longer option has a line of its own before its text."""
_OBVIOUS = re.compile(r"; x>=?[01](?=\])|\s*\[(x>=?[01]|[\d.e-]+<=x<=[\d.e-]+)\]")
"""The parts of click's texts on number ranges that every reader expects. They are left out."""


class SectionedCommand(click.Command):
    """A command whose help shows its options in sections.

    Args:
        sections: Each option by one of its spellings. An option that is in no section stands at the end.
    """

    def __init__(self, *args: Any, sections: Sections, **kwargs: Any) -> None:  # noqa: ANN401 - click's own
        super().__init__(*args, **kwargs)
        self.sections = sections

    def format_options(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """Write the options, section by section."""
        options = [one for one in self.get_params(ctx) if isinstance(one, click.Option)]
        parameters = {spelling: one for one in options for spelling in one.opts}
        placed = {spelling for spellings in self.sections.values() for spelling in spellings}
        rest = [one.opts[0] for one in options if not placed.intersection(one.opts)]
        for title, spellings in {**self.sections, REST: rest}.items():
            records = (parameters[spelling].get_help_record(ctx) for spelling in spellings)
            rows = [(names, _OBVIOUS.sub("", text)) for names, text in filter(None, records)]
            if rows:
                with formatter.section(title):
                    formatter.write_dl(rows, col_max=_COLUMN)
