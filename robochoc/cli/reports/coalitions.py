"""The report of `robochoc privacy --coalition`: a table with a row for each coalition, and JSON."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator
from statistics import mean

import click
import msgspec

from robochoc.cli.reports.table import table_lines
from robochoc.formats import on_one_line
from robochoc.privacy import CoalitionReport
from robochoc.system.plain_text import counted

_MOST_ROWS = 50
_COLUMNS = ("coalition", "tables", "by own values", "by messages")


def print_coalitions(report: CoalitionReport) -> None:
    """Print the share of the other robots' tables that each coalition can exclude."""
    robots = counted(report.size, "robot")
    click.echo(on_one_line(f"{report.team}: {report.protocol}, coalitions of {robots} of {len(report.robots)}"))
    if not report.losses:
        click.echo("  every coalition shares all constraints: there is nothing left to learn")
        return
    click.echo(
        "  share of the other robots' tables that a coalition can exclude: by its own values in the answer, and of"
    )
    click.echo("  the rest by all messages")
    for line in table_lines(_COLUMNS, _rows(report), right=_COLUMNS[1:]):
        click.echo(on_one_line(f"  {line}"))
    if not report.is_exact and any(one.excluded_by_messages for one in report.losses):
        tried = counted(report.coins, "seed")
        note = f"the other robots draw random numbers, tried with {tried}: more seeds may exclude fewer (--coins)"
        click.echo(f"  {note}")


def _rows(report: CoalitionReport) -> Iterator[list[str]]:
    for one in report.losses[:_MOST_ROWS]:
        shares = (f"{one.excluded_by_values:.3f}", f"{one.excluded_by_messages:.3f}")
        yield [", ".join(one.members), f"{one.tables:,}", *shares]
    if len(report.losses) > _MOST_ROWS:
        yield [f"and {len(report.losses) - _MOST_ROWS} more (--json)", "", "", ""]
    values, messages = (
        mean([getattr(one, name) for one in report.losses]) for name in ("excluded_by_values", "excluded_by_messages")
    )
    yield ["mean", "", f"{values:.3f}", f"{messages:.3f}"]


def coalitions_json(report: CoalitionReport) -> str:
    """Return the report as one JSON object."""
    fields = dataclasses.asdict(report)
    fields["losses"] = [
        {
            **dataclasses.asdict(one),
            "excluded_by_values": one.excluded_by_values,
            "excluded_by_messages": one.excluded_by_messages,
        }
        for one in report.losses
    ]
    return msgspec.json.format(msgspec.json.encode(fields), indent=2).decode()
