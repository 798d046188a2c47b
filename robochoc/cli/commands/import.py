"""`robochoc import`: problems in the files of other tools, as folders of teams."""  # noqa: N999 - the name of the command

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import click

from robochoc.cli.options.generated import next_step
from robochoc.cli.options.order import GIVEN, ORDER_NAME, order_for
from robochoc.cli.options.order import NAMES as ORDERS
from robochoc.cli.options.paths import InputPath
from robochoc.cli.options.problems import format_option, reading_options
from robochoc.cli.reports.failures import INVALID, Failure
from robochoc.cli.reports.notes import notes_told

if TYPE_CHECKING:
    from robochoc.formats import InvalidInputError
    from robochoc.formats.dialects.dialect import Imported, ImportOptions


class _Source(NamedTuple):
    """The files of one problem, and the folder of its team."""

    files: Sequence[Path]
    folder: Path


@click.command("import")
@click.argument("paths", nargs=-1, required=True, type=InputPath(), metavar="FILE|FOLDER ...")
@click.option("-o", "--output", type=InputPath(), metavar="DIR", help="Folder to write.  [default: instances/NAME]")
@format_option
@reading_options
@click.option("--allow-code", is_flag=True, help="Execute the Python files that a pyDCOP problem names.")
@click.option(
    "--order",
    type=ORDER_NAME,
    default=GIVEN,
    show_default=True,
    metavar="NAME|FILE",
    help=f"Priority order of the robots: {', '.join(ORDERS)}, or a file with one robot's name a line.",
)
@click.option(
    "--report", type=click.Path(allow_dash=True, path_type=Path), metavar="FILE|-", help="Write a report as JSON."
)
@click.option("--force", is_flag=True, help="Replace folders that exist.")
@click.pass_context
def import_(
    context: click.Context,
    /,
    paths: tuple[Path, ...],
    *,
    output: Path | None,
    dialect: str | None,
    order: str | Path,
    report: Path | None,
    force: bool,
    **asked: Any,  # noqa: ANN401 - `ImportOptions`
) -> None:
    """Make teams of problems in the files of other tools.

    \b
    frodo    FRODO's XCSP 2.1, one file or one per agent; XCSP 2.0 and 2.1
    xdiscsp  XDisCSP 1.0 of DisChoco and DCOPSolver
    pydcop   pyDCOP's YAML, with distribution files and scenarios
    tasks    robots, and tasks that are to be shared out among them (YAML)
    xcsp3    XCSP3
    cfn      cost function networks of toulbar2; wcsp: its older format

    Several FILEs are one problem. Of a FOLDER, each file is a problem of its own; files that each hold what one agent
    knows belong together. What was changed on the way is told; original names stand in names.json beside the team.
    """  # noqa: D301 - \\b is how click is told to leave the lines as they are
    from robochoc.formats.dialects.dialect import ImportOptions

    options = ImportOptions(**asked)
    told = []
    for source in _sources(paths, output, dialect):
        entry = _imported(source, options, dialect, order, force=force)
        told.append(entry)
        if report != Path("-"):
            _tell(entry)
    done = sum(entry["imported"] for entry in told)
    if report:
        _write_report(report, told)
    if len(told) > 1 and report != Path("-"):
        click.echo(f"{done} of {len(told)} problems imported")
    if done < len(told):
        context.exit(INVALID)


def _sources(paths: Sequence[Path], output: Path | None, dialect: str | None) -> list[_Source]:
    """Return the problems at `paths`. Raises `Failure` where there is none."""
    from robochoc.cli.options.foreign_files import problems_below

    folders = [path for path in paths if path.is_dir()]
    if folders and len(folders) < len(paths):
        raise click.UsageError("Give the files of one problem, or folders.")
    if not folders:
        default = Path("instances") / _stem(paths[0])
        return [_Source(paths, output or default)]
    sources = []
    for folder in folders:
        below = output or Path("instances") / folder.resolve().name
        top = below / folder.resolve().name if len(folders) > 1 and output else below
        sources += [_Source(files, top / place) for place, files in problems_below(folder, dialect)]
    if not sources:
        shown = ", ".join(map(str, folders))
        hint = "a team's folder needs no import; otherwise name the format with --format"
        raise Failure(INVALID, f"{shown}: no file here is of a format that is read ({hint})")
    return sources


def _stem(path: Path) -> str:
    return path.stem or "team"


def _imported(
    source: _Source, options: ImportOptions, dialect: str | None, order: str | Path, *, force: bool
) -> dict[str, Any]:
    """Write the team of one problem, and return the entry of the report."""
    from robochoc.formats import InvalidInputError, encodable, write_team
    from robochoc.formats.dialects.names_file import NAMES_FILE, names_json
    from robochoc.formats.dialects.registry import read_foreign
    from robochoc.model.orders import OrderError, with_order

    entry: dict[str, Any] = {"files": [encodable(str(path)) for path in source.files], "imported": False}
    try:
        imported = read_foreign(source.files, options, dialect)
        team = with_order(imported.team, order_for(imported.team, order))
        write_team(team, source.folder, replace=force, beside={NAMES_FILE: names_json(imported)})
    except InvalidInputError as invalid:
        return entry | {"errors": _errors(invalid)}
    except OrderError as error:
        return entry | {"errors": [f"{source.files[0]}: {error}"]}
    return entry | {"imported": True, "team": encodable(str(source.folder)), **_contents(imported)}


def _errors(invalid: InvalidInputError) -> list[str]:
    return [str(one) for one in invalid.diagnostics]


def _contents(imported: Imported) -> dict[str, Any]:
    team = imported.team
    return {
        "format": imported.dialect,
        "type": str(team.kind),
        "robots": len(team.robots),
        "variables": len(team.variables),
        "constraints": sum(1 for _ in team.constraints()),
        "names": dict(imported.names),
        "notes": [note._asdict() for note in imported.notes],
    }


def _tell(entry: dict[str, Any]) -> None:
    from robochoc.formats import on_one_line
    from robochoc.formats.dialects.dialect import Note

    if not entry["imported"]:
        Failure(INVALID, "\n".join(entry["errors"])).show()
        return
    sizes = {what: entry[what] for what in ("robots", "variables", "constraints")}
    counts = ", ".join(f"{number:,} {what if number != 1 else what[:-1]}" for what, number in sizes.items())
    folder = on_one_line(entry["team"])
    click.echo(f"{folder}: {counts}, from {entry['format']}; {next_step(folder, sizes['robots'])}")
    for line in notes_told([Note(**note) for note in entry["notes"]], "--report lists them"):
        click.echo(line)


def _write_report(place: Path, told: list[dict[str, Any]]) -> None:
    import msgspec

    content = msgspec.json.format(msgspec.json.encode(told)) + b"\n"
    if place == Path("-"):
        click.echo(content, nl=False)
    else:
        from robochoc.system.files import write_atomically

        write_atomically(place, content)
