"""Prints the leaderboard's tables, and writes its site and its page in Markdown."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path

import click

from robochoc.cli.reports.table import print_table
from robochoc.leaderboard.instances import FAMILIES
from robochoc.leaderboard.results import LeaderboardResults
from robochoc.leaderboard.site import EXPLANATION, budget_text
from robochoc.leaderboard.tables import family_tables, overall, peer_remarks, sizes_of
from robochoc.system.files import write_atomically
from robochoc.system.plain_text import on_one_line


def print_board(results: LeaderboardResults) -> None:
    """Print the table over all families, and the table of each family."""
    click.echo(budget_text(results))
    for remark in peer_remarks(results):
        click.echo(on_one_line(remark))
    for size in sizes_of(results):
        headings, lines = overall(results, size)
        click.echo(f"\nall families, {size}")
        print_table(headings, lines, right=headings[1:])
        for one in family_tables(results, size):
            click.echo(f"\n{one.family}, {size}: {FAMILIES[one.family].title}")
            print_table(one.headings, one.lines, right=one.headings[1:])
            for remark in one.remarks:
                click.echo(remark)


def write_markdown(results: LeaderboardResults, path: Path) -> None:
    """Write the tables in Markdown. Raises `OSError`."""
    write_atomically(path, "\n".join(_markdown(results)).encode())


def _markdown(results: LeaderboardResults) -> Iterator[str]:
    yield from (budget_text(results), "", EXPLANATION, "")
    yield from (line for remark in peer_remarks(results) for line in (remark, ""))
    for size in sizes_of(results):
        yield from (f"## All families, {size}", "")
        yield from _table(*overall(results, size))
        yield ""
        for one in family_tables(results, size):
            yield from (f"### {FAMILIES[one.family].title}, {size}", "")
            yield from _table(one.headings, one.lines)
            yield from (line for remark in one.remarks for line in ("", remark))
            yield ""


def _table(headings: Sequence[str], lines: Sequence[Sequence[str]]) -> Iterator[str]:
    yield f"| {' | '.join(headings)} |"
    yield f"| --- |{' ---: |' * (len(headings) - 1)}"
    yield from (f"| {' | '.join(line).replace('*', chr(92) + '*')} |" for line in lines)
