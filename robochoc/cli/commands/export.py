"""`robochoc export`: writes a team's problem in the format of another tool."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from robochoc.cli.options.paths import OutputFile, refuse_same_places
from robochoc.cli.options.problems import WRITTEN, ProblemPath, reading_options
from robochoc.cli.options.solve import objectives_option
from robochoc.cli.reports.failures import USAGE, Failure, errors_as_failures

if TYPE_CHECKING:
    from robochoc.formats.dialects.dialect import ExportOptions, ExportResult
    from robochoc.model.objectives import ObjectivesMode
    from robochoc.model.problem import Team


@click.command()
@click.argument("folder", type=ProblemPath(), metavar="TEAM")
@click.option(
    "--format", "kind", type=click.Choice(WRITTEN), default="xcsp3", show_default=True, help="Format of the file."
)
@click.option("-o", "--output", type=OutputFile(), metavar="FILE", help="File to write.  [default: standard output]")
@click.option("--intension", is_flag=True, help="Keep predicates and functions (frodo only, for its JaCoP parser).")
@objectives_option
@reading_options
def export(
    folder: Path,
    *,
    kind: str,
    output: Path | None,
    intension: bool,
    objectives: ObjectivesMode | None,
    **reading: Any,  # noqa: ANN401 - the other options
) -> None:
    """Write the problem of the team in the folder TEAM, all files merged, for other tools.

    \b
    xcsp3       one XCSP3-core file (tables, allDifferent; for a DCOP, a sum
                of costs to minimise), for ACE, Choco and others
    frodo       FRODO's XCSP 2.1 (relations, integer costs)
    xdiscsp     XDisCSP 1.0, for DisChoco
    dcopsolver  the part of XDisCSP 1.0 that DCOPSolver reads
    pydcop      pyDCOP's YAML, and a distribution file
    cfn         a cost function network, for toulbar2
    wcsp        toulbar2's older format
    dot         the constraint graph over a pseudo-tree, for Graphviz
    graphml     the constraint graph of the variables, for Gephi and networkx

    Of a team with several objectives, --objectives writes the weighted or
    lexicographic sum. TEAM may also be a problem file of another tool. A team that the format
    cannot express is an error.
    """  # noqa: D301 - \\b keeps click from wrapping the lines
    from robochoc.system.files import write_atomically

    refuse_same_places({"-o": output}, teams=[folder])
    if intension and kind != "frodo":
        raise click.UsageError("--intension requires --format frodo")
    with errors_as_failures(folder):
        from robochoc.formats.dialects.dialect import ExportOptions
        from robochoc.formats.problems import read_problem

        team = read_problem(folder, **reading).team
        if objectives is not None:
            from robochoc.run.objectives import with_single_cost

            team = with_single_cost(team, objectives)
        written = _written(team, kind, ExportOptions(intension=intension))
    if output is None:
        if len(written.files) > 1:
            raise Failure(USAGE, f"{folder}: problem and scenario are two files; name the first one: -o FILE")
        (content,) = written.files.values()
        click.echo(content, nl=not content.endswith(b"\n"))
    else:
        for place, (name, content) in enumerate(written.files.items()):
            path = output if place == 0 else output.with_name(f"{output.stem}{_ending(team, name)}")
            write_atomically(path, content)
            variables = f", {len(team.variables)} variables" if place == 0 else ""
            click.echo(f"{path}: {len(content):,} bytes{variables}")
    for kind_of_note, text in written.notes:
        click.echo(f"  {kind_of_note}: {text}", err=output is None)


def _written(team: Team, kind: str, options: ExportOptions) -> ExportResult:
    """Return the files of `team` in the format `kind`."""
    from robochoc.formats.dialects.dialect import notes_on_features
    from robochoc.formats.dialects.registry import find_dialect
    from robochoc.model.costs import refuse_several_objectives

    dialect = find_dialect(kind)
    if dialect is None or dialect.write is None:
        raise Failure(USAGE, f"this version cannot write {kind}")
    refuse_several_objectives(team)
    written = dialect.write(team, options)
    return written._replace(notes=(*written.notes, *notes_on_features(team, dialect)))


def _ending(team: Team, name: str) -> str:
    """Return the part of a further file's name that follows the team's name, such as `_dist.yaml`."""
    return name.removeprefix(team.name)
