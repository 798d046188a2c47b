"""Commands whose help has titled sections, with the most used options first."""

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
"""The column, in characters, at which texts start. The text of a longer option starts on the next line."""
_OBVIOUS = re.compile(r"; x>=?[01](?=\])|\s*\[(x>=?[01]|[\d.e-]+<=x<=[\d.e-]+)\]")
"""Obvious ranges of numbers in click's texts, which are left out."""


class SectionedCommand(click.Command):
    """A command whose help shows its options in sections.

    Args:
        sections: The options in each section, each by one of its spellings. Options without a section are listed last.
    """

    def __init__(self, *args: Any, sections: Sections, **kwargs: Any) -> None:  # noqa: ANN401 - click's own
        super().__init__(*args, **kwargs)
        self.sections = sections

    def format_options(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """Write the options section by section."""
        options = [option for option in self.get_params(ctx) if isinstance(option, click.Option)]
        parameters = {spelling: option for option in options for spelling in option.opts}
        placed = {spelling for spellings in self.sections.values() for spelling in spellings}
        rest = [option.opts[0] for option in options if not placed.intersection(option.opts)]
        for title, spellings in {**self.sections, REST: rest}.items():
            records = (parameters[spelling].get_help_record(ctx) for spelling in spellings)
            rows = [(names, _OBVIOUS.sub("", text)) for names, text in filter(None, records)]
            if rows:
                with formatter.section(title):
                    formatter.write_dl(rows, col_max=_COLUMN)
