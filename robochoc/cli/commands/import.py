"""`robochoc import`: converts problem files of other tools to team folders."""  # noqa: N999 - the name of the command

from __future__ import annotations

import os
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import click

from robochoc.cli.options.generate import next_step
from robochoc.cli.options.order import GIVEN, ORDER_NAME, order_for
from robochoc.cli.options.order import NAMES as ORDERS
from robochoc.cli.options.paths import InputPath
from robochoc.cli.options.problems import format_option, reading_options
from robochoc.cli.reports.failures import INVALID, Failure
from robochoc.cli.reports.notes import note_lines

if TYPE_CHECKING:
    from robochoc.formats.dialects.dialect import ImportOptions, ImportResult


class _Source(NamedTuple):
    """The files of one problem, and the folder for its team."""

    files: Sequence[Path]
    folder: Path


@click.command("import")
@click.argument("paths", nargs=-1, required=True, type=InputPath(), metavar="FILE|FOLDER ...")
@click.option("-o", "--output", type=InputPath(), metavar="DIR", help="Folder to write.  [default: instances/NAME]")
@format_option
@reading_options
@click.option("--allow-code", is_flag=True, help="Execute the Python files that a pyDCOP problem refers to.")
@click.option(
    "--order",
    type=ORDER_NAME,
    default=GIVEN,
    show_default=True,
    metavar="NAME|FILE",
    help=f"Priority order of the robots: {', '.join(ORDERS)}, or a file with one robot's name per line.",
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
    """Convert problem files of other tools to teams.

    \b
    frodo    FRODO's XCSP 2.1, one file or one per agent; XCSP 2.0 and 2.1
    xdiscsp  XDisCSP 1.0 of DisChoco and DCOPSolver
    pydcop   pyDCOP's YAML, with distribution files and scenarios
    tasks    robots, and the tasks to be assigned to them (YAML)
    xcsp3    XCSP3
    cfn      cost function networks of toulbar2; wcsp: its older format

    Several FILEs are one problem. In a FOLDER, each file is a separate problem, except files with the parts of single
    agents, which are one problem. Changes by the conversion are printed; names.json in the team's folder has the
    original names.
    """  # noqa: D301 - \\b keeps click from wrapping the lines
    from robochoc.formats.dialects.dialect import ImportOptions

    options = ImportOptions(**asked)
    entries = []
    for source in _sources(paths, output, dialect):
        entry = _import(source, options, dialect, order, force=force)
        entries.append(entry)
        if report != Path("-"):
            _print_entry(entry)
    done = sum(entry["imported"] for entry in entries)
    if report:
        _write_report(report, entries)
    if len(entries) > 1 and report != Path("-"):
        click.echo(f"{done} of {len(entries)} problems imported")
    if done < len(entries):
        context.exit(INVALID)


def _sources(paths: Sequence[Path], output: Path | None, dialect: str | None) -> list[_Source]:
    """Return the problems found at `paths`. Raises `Failure` if there are none."""
    folders = [path for path in paths if path.is_dir()]
    if folders and len(folders) < len(paths):
        raise click.UsageError("Give either the files of one problem, or folders.")
    if not folders:
        default = Path("instances") / _stem(paths[0])
        return [_Source(paths, output or default)]
    sources = []
    for folder in folders:
        below = output or Path("instances") / folder.resolve().name
        top = below / folder.resolve().name if len(folders) > 1 and output else below
        sources += [_Source(files, top / place) for place, files in _problems_below(folder, dialect)]
    if not sources:
        shown = ", ".join(map(str, folders))
        hint = "a team's folder needs no import; otherwise name the format with --format"
        raise Failure(INVALID, f"{shown}: no file with a known format ({hint})")
    return sources


def _problems_below(folder: Path, dialect: str | None) -> Iterator[tuple[Path, list[Path]]]:
    """Yield, for each problem in or below `folder`, the relative folder for its team, and its files.

    Files of unknown formats, hidden files and symbolic links to folders are skipped.

    Args:
        folder: The folder.
        dialect: The name of the files' dialect. None: it is detected.
    """
    from robochoc.model.priorities import natural_key

    for place, subfolders, names in os.walk(folder):
        subfolders[:] = sorted((name for name in subfolders if not name.startswith(".")), key=natural_key)
        here = Path(place)
        files = [here / name for name in sorted(names, key=natural_key) if not name.startswith(".")]
        problems, parts = _split(files, dialect)
        relative = here.relative_to(folder)
        stems: set[str] = set()
        for file in problems:
            stem = file.stem if file.stem not in stems else file.name.replace(".", "-")
            stems.add(stem)
            yield relative / stem, [file]
        if parts:
            alone = not problems and not subfolders
            yield relative if alone else relative / f"{here.resolve().name}-agents", parts


def _split(files: list[Path], name: str | None) -> tuple[list[Path], list[Path]]:
    """Return the files that are complete problems, and the files that together form one problem."""
    from robochoc.formats.dialects.registry import find_dialect, first_bytes, recognise

    problems: list[Path] = []
    parts: list[Path] = []
    for file in files:
        dialect = find_dialect(name) if name else recognise(file)
        beginning = first_bytes(file)
        if dialect is None or beginning is None:
            continue
        (parts if dialect.is_part and dialect.is_part(file, beginning) else problems).append(file)
    return problems, parts


def _stem(path: Path) -> str:
    return path.stem or "team"


def _import(
    source: _Source, options: ImportOptions, dialect: str | None, order: str | Path, *, force: bool
) -> dict[str, Any]:
    """Write the team for one problem, and return its entry in the report."""
    from robochoc.formats import InvalidInputError, encodable, write_team
    from robochoc.formats.dialects.registry import read_foreign
    from robochoc.formats.names_file import NAMES_FILE, names_json
    from robochoc.model.orders import OrderError, with_order

    entry: dict[str, Any] = {"files": [encodable(str(path)) for path in source.files], "imported": False}
    try:
        imported = read_foreign(source.files, options, dialect)
        team = with_order(imported.team, order_for(imported.team, order))
        files = {NAMES_FILE: names_json(imported.dialect, imported.names), **imported.files}
        write_team(team, source.folder, replace=force, extra_files=files)
    except InvalidInputError as invalid:
        return entry | {"errors": [str(diagnostic) for diagnostic in invalid.diagnostics]}
    except OrderError as error:
        return entry | {"errors": [f"{source.files[0]}: {error}"]}
    return entry | {"imported": True, "team": encodable(str(source.folder)), **_contents(imported)}


def _contents(imported: ImportResult) -> dict[str, Any]:
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


def _print_entry(entry: dict[str, Any]) -> None:
    from robochoc.formats import on_one_line
    from robochoc.formats.dialects.dialect import ConversionNote

    if not entry["imported"]:
        Failure(INVALID, "\n".join(entry["errors"])).show()
        return
    sizes = {what: entry[what] for what in ("robots", "variables", "constraints")}
    counts = ", ".join(f"{number:,} {what if number != 1 else what[:-1]}" for what, number in sizes.items())
    folder = on_one_line(entry["team"])
    click.echo(f"{folder}: {counts}, from {entry['format']}; {next_step(folder, sizes['robots'])}")
    for line in note_lines([ConversionNote(**note) for note in entry["notes"]], "--report lists them"):
        click.echo(line)


def _write_report(place: Path, entries: list[dict[str, Any]]) -> None:
    import msgspec

    content = msgspec.json.format(msgspec.json.encode(entries)) + b"\n"
    if place == Path("-"):
        click.echo(content, nl=False)
    else:
        from robochoc.system.files import write_atomically

        write_atomically(place, content)
