"""`robochoc protocols`: the installed protocols."""

from __future__ import annotations

import click

from robochoc.cli.options.names import ProtocolName
from robochoc.cli.reports.failures import USAGE, Failure
from robochoc.run.defaults import AUTO

PURPOSES = ("satisfaction", "costs", "asymmetric")


@click.command()
@click.argument("name", required=False, type=ProtocolName())
@click.option("--for", "purpose", type=click.Choice(PURPOSES), help="List only those for one kind of problem.")
@click.option("--long", is_flag=True, help="List more traits: constraints, privacy, paper.")
@click.option("--json", "as_json", is_flag=True, help="Print one JSON object per protocol.")
def protocols(name: str | None, *, purpose: str | None, as_json: bool, long: bool) -> None:
    """List the installed protocols, or explain the protocol NAME; auto: how one is chosen.

    \b
    for           satisfaction: any solution; optimisation: minimum cost
    complete      ends on every problem, with a solution or a proof
    use when      when to choose it
    synchronous   one robot acts at a time (--long)
    constraints   binary, n-ary; PKC: also partially known (--long)
    dynamic       continues when the problem changes (--long)
    privacy       what neighbours do not learn (--long)

    \b
    robochoc protocols --for satisfaction    any solution, no costs
    robochoc protocols --for costs           the least cost, or a low one; without costs any solution
    robochoc protocols --for asymmetric      of these, with costs of each side
    """  # noqa: D301 - \\b is how click is told to leave the lines as they are
    from robochoc.cli.reports.protocols import Row, print_protocols, protocol_text, protocols_json, rows
    from robochoc.formats import on_one_line
    from robochoc.run.registry import unknown_protocol

    if name is not None and purpose is not None:
        raise Failure(USAGE, "--for is for the list, and not for one protocol: leave out one of the two")
    found = [row for row in rows() if purpose is None or row.is_for(purpose)]
    if name == AUTO:
        from robochoc.cli.reports.choice import rules_text

        click.echo(rules_text())
        return
    if name is None:
        click.echo(protocols_json(found), nl=False) if as_json else print_protocols(found, long=long)
        return
    row: Row | None = next((row for row in found if row.name == name), None)
    if row is None:
        raise Failure(USAGE, on_one_line(unknown_protocol(name)))
    if as_json:
        click.echo(protocols_json([row], explain=True), nl=False)
    elif row.broken:
        raise Failure(USAGE, on_one_line(f"{row.name}: {row.place} (package {row.package}) {row.broken}"))
    else:
        click.echo(protocol_text(row))
