"""`robochoc export`: a team's problem in the format of other solvers."""

from __future__ import annotations

from pathlib import Path

import click

from robochoc.cli.options.paths import OutputFile, TeamFolder, refuse_same_places
from robochoc.cli.reports.failures import failures_told


@click.command()
@click.argument("folder", type=TeamFolder(), metavar="TEAM")
@click.option(
    "--format", "kind", type=click.Choice(["xcsp3"]), default="xcsp3", show_default=True, help="Format to write."
)
@click.option("-o", "--output", type=OutputFile(), metavar="FILE", help="File to write.  [default: standard output]")
def export(folder: Path, kind: str, output: Path | None) -> None:  # noqa: ARG001 - the only format there is
    """Write the problem of the team in the folder TEAM for other solvers, all files merged.

    xcsp3: one XCSP3-core file (tables, allDifferent; for a DisWCSP, a sum of costs to minimise), for ACE, Choco and
    others.
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
