"""`robochoc validate`: checks teams, and prints the errors in all files."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from robochoc.cli.options.paths import InputPath, import_hints
from robochoc.cli.options.problems import format_option, reading_options
from robochoc.cli.reports.failures import INVALID

if TYPE_CHECKING:
    from robochoc.formats import InvalidInputError
    from robochoc.formats.dialects.dialect import ConversionNote, Dialect
    from robochoc.model.problem import Robot


@click.command()
@click.argument("paths", nargs=-1, type=InputPath(), metavar="[PATH ...]")
@click.option("--json", "as_json", is_flag=True, help="Print one JSON object per team.")
@format_option
@reading_options
@click.pass_context
def validate(
    context: click.Context,
    /,
    paths: tuple[Path, ...],
    *,
    as_json: bool,
    **reading: Any,  # noqa: ANN401 - arguments of `read_problem`
) -> None:
    """Check all teams in the folders PATH and below (default: instances/), or single robots' files.

    The command checks the XML, the schema, the meaning of each file, and then the team as a whole, and prints the
    errors of all files, with file and line. A file with errors is not compared with the other robots' files, so check
    again after corrections. The exit status is 1 if there are errors. Files of other tools are read as by 'robochoc
    import'.
    """
    from robochoc.formats import InvalidInputError, find_teams

    reports: list[dict[str, Any]] = []
    for path in paths or (Path("instances"),):
        try:
            found = [path] if path.is_file() else find_teams(path)
        except InvalidInputError as invalid:
            reports.append(_invalid(path, invalid, import_hints(path)))
        else:
            reports.extend(_report(place, reading) for place in found)
    for report in reports:
        _print_json(report) if as_json else _print(report)
    if not all(report["valid"] for report in reports):
        context.exit(INVALID)


def _report(place: Path, reading: Mapping[str, Any]) -> dict[str, Any]:
    """Return the report on one team, or on one robot's file."""
    from robochoc.formats import InvalidInputError, encodable, read_robot
    from robochoc.formats.problems import read_problem

    notes: tuple[ConversionNote, ...] = ()
    dialect: Dialect | None = None
    try:
        if place.is_file():
            from robochoc.formats.dialects.registry import find_dialect, recognise_or_raise

            dialect = find_dialect(reading["dialect"] or "") or recognise_or_raise(place)
        if place.is_file() and dialect is None:
            robots: tuple[Robot, ...] = (read_robot(place),)
            events = 0
        else:
            problem = read_problem(place, **reading)
            team = problem.team
            notes = problem.notes
            robots, events = team.robots, len(team.scenario)
    except InvalidInputError as invalid:
        return _invalid(place, invalid)
    report = {"path": encodable(str(place)), "valid": True, **_sizes(robots), "events": events, "errors": []}
    if dialect:
        report |= {"format": dialect.name, "title": dialect.title, "notes": [note._asdict() for note in notes]}
    return report


def _sizes(robots: tuple[Robot, ...]) -> dict[str, int]:
    shared = sum(len(robot.private) + len(robot.shared) for robot in robots)
    parts = sum(len(child.constraints) for robot in robots for child in robot.children)
    return {
        "robots": len(robots),
        "variables": sum(len(robot.variables) for robot in robots),
        "constraints": shared + parts,
    }


def _invalid(place: Path, invalid: InvalidInputError, more: Sequence[str] = ()) -> dict[str, Any]:
    from robochoc.formats import encodable

    errors = [
        {
            "file": encodable(error.file),
            "line": error.line,
            "message": error.message,
            "hint": error.hint,
            "text": str(error),
        }
        for error in invalid.diagnostics
    ]
    errors += [{"file": encodable(str(place)), "line": 0, "message": line, "hint": "", "text": line} for line in more]
    return {"path": encodable(str(place)), "valid": False, "errors": errors}


def _print_json(report: dict[str, Any]) -> None:
    import msgspec

    click.echo(msgspec.json.encode(report))


def _print(report: dict[str, Any]) -> None:
    from robochoc.cli.reports.notes import difference_lines
    from robochoc.formats import on_one_line

    path = on_one_line(report["path"])
    if report["valid"]:
        counts = ", ".join(
            f"{report[what]} {what if report[what] != 1 else what[:-1]}"
            for what in ("robots", "variables", "constraints", "events")
            if what != "events" or report[what]
        )
        alone = "" if Path(report["path"]).is_dir() or "format" in report else " by itself"
        click.echo(f"{path}: {counts}: ok{alone}")
        if "format" in report:
            from robochoc.formats.dialects.dialect import ConversionNote

            click.echo(
                f"  this is {report['title']}: 'robochoc solve' reads it, 'robochoc import' converts it to a team"
            )
            for line in difference_lines([ConversionNote(**note) for note in report["notes"]]):
                click.echo(line)
        return
    errors = report["errors"]
    click.echo(f"{path}: {len(errors)} error{'s' * (len(errors) != 1)}")
    for error in errors:
        click.echo(f"  {error['text']}")
