"""`robochoc export`: a team's problem in a format that other programs read."""

from __future__ import annotations

from pathlib import Path

import click

from robochoc.cli.options.paths import InputPath, OutputFile, refuse_same_places
from robochoc.cli.reports.failures import failures_told


@click.command()
@click.argument("folder", type=InputPath(), metavar="TEAM")
@click.option("--format", "kind", type=click.Choice(["xcsp3"]), default="xcsp3", show_default=True)
@click.option("-o", "--output", type=OutputFile(), metavar="FILE", help="File to write  [default: standard output]")
def export(folder: Path, kind: str, output: Path | None) -> None:  # noqa: ARG001 - the only format there is
    """Write the problem of the team in the folder TEAM, all its files merged, for other solvers.

    xcsp3: one XCSP3-core file (tables, allDifferent; of a DisWCSP, the sum of costs to be minimised), which ACE, Choco
    and others read.
    """
    from robochoc.formats import read_team
    from robochoc.formats.xcsp3 import xcsp3
    from robochoc.system.files import write_atomically

    refuse_same_places({"-o": output}, teams=[folder])
    with failures_told(folder):
        team = read_team(folder)
        document = xcsp3(team)
    if output is None:
        click.echo(document, nl=False)
    else:
        write_atomically(output, document)
        click.echo(f"{output}: {len(document):,} bytes, {len(team.variables)} variables")
