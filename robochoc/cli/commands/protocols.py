"""`robochoc protocols`: lists and explains the installed protocols."""

from __future__ import annotations

import click

from robochoc.cli.options.value_types import ProtocolName
from robochoc.cli.reports.failures import USAGE, Failure
from robochoc.run.defaults import AUTO
from robochoc.run.purposes import PURPOSES

EVERY = "all"


@click.command()
@click.argument("name", required=False, type=ProtocolName())
@click.option(
    "--for",
    "purpose",
    metavar="PURPOSE",
    type=click.Choice([*PURPOSES, EVERY]),
    help="List only protocols for one purpose; all: the purposes, each with its protocols.",
)
@click.option("--long", is_flag=True, help="List more traits: constraints, privacy, paper.")
@click.option("--json", "as_json", is_flag=True, help="Print one JSON object per protocol.")
def protocols(name: str | None, *, purpose: str | None, as_json: bool, long: bool) -> None:
    """List the installed protocols, or explain the protocol NAME; auto: the rules of the choice.

    \b
    for           satisfaction: any solution; optimisation: minimum cost
    complete      ends on every problem, with a solution or a proof
    use when      when to use the protocol
    synchronous   one robot acts at a time (--long)
    constraints   binary, n-ary; PKC: also partially known (--long)
    dynamic       continues when the problem changes (--long)
    privacy       information hidden from neighbours (--long)

    Purposes: satisfaction, costs, optimum, asymmetric, large-teams, privacy, change, lost-messages, counting,
    objectives, tasks, comparison. A protocol can have several.

    \b
    robochoc protocols --for all            the purposes, each with its protocols
    robochoc protocols --for costs          minimum or low cost; without costs any solution
    robochoc protocols --for large-teams    hundreds of robots or more
    """  # noqa: D301 - \\b keeps click from wrapping the lines
    from robochoc.cli.reports.protocols import (
        ProtocolRow,
        print_protocols,
        print_purposes,
        protocol_text,
        protocols_json,
        rows,
    )
    from robochoc.formats import on_one_line
    from robochoc.run.registry import unknown_protocol

    if name is not None and purpose is not None:
        raise Failure(USAGE, "--for selects rows of the list and cannot be used with NAME: remove one")
    found = [row for row in rows() if purpose in {None, EVERY} or purpose in row.purposes]
    if name == AUTO:
        from robochoc.cli.reports.choice import rules_text

        click.echo(rules_text())
        return
    if purpose == EVERY and not as_json:
        print_purposes(found)
        return
    if name is None:
        click.echo(protocols_json(found), nl=False) if as_json else print_protocols(found, long=long)
        return
    row: ProtocolRow | None = next((row for row in found if row.name == name), None)
    if row is None:
        raise Failure(USAGE, on_one_line(unknown_protocol(name)))
    if as_json:
        click.echo(protocols_json([row], explain=True), nl=False)
    elif row.broken:
        raise Failure(USAGE, on_one_line(f"{row.name}: {row.place} (package {row.package}) {row.broken}"))
    else:
        click.echo(protocol_text(row))
