"""`robochoc protocols`: what there is to solve with."""

from __future__ import annotations

import difflib

import click

from robochoc.cli.options.names import ProtocolName
from robochoc.cli.reports.failures import USAGE, Failure


@click.command()
@click.argument("name", required=False, type=ProtocolName())
@click.option("--json", "as_json", is_flag=True, help="Print one JSON object per protocol.")
def protocols(name: str | None, *, as_json: bool) -> None:
    """List the protocols that are installed, of this package and of others, or explain the protocol NAME.

    \b
    for           satisfaction: any solution; optimisation: the cheapest one
    complete      it ends on every problem, with a solution or a proof that there is none
    synchronous   one robot acts at a time
    constraints   binary: between two robots; n-ary: between any number; PKC: partially known ones too
    dynamic       it goes on when the problem changes
    privacy       what neighbours do not come to know
    """  # noqa: D301 - \\b is how click is told to leave the lines as they are
    from robochoc.cli.reports.protocols import Row, explained, json_report, print_table, rows
    from robochoc.formats import on_one_line

    found = rows()
    if name is None:
        click.echo(json_report(found), nl=False) if as_json else print_table(found)
        return
    row: Row | None = next((row for row in found if row.name == name), None)
    if row is None:
        known = [row.name for row in found]
        near = difflib.get_close_matches(name.lower(), known, 1)
        hint = f"; did you mean '{near[0]}'?" if near else ""
        raise Failure(USAGE, on_one_line(f"no protocol '{name}' is installed, only: {', '.join(known)}{hint}"))
    if as_json:
        click.echo(json_report([row], explain=True), nl=False)
    elif row.broken:
        raise Failure(USAGE, on_one_line(f"{row.name}: {row.place} (package {row.package}) {row.broken}"))
    else:
        click.echo(explained(row))
