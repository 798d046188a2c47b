"""The report of `robochoc privacy`: a table with a row per robot, and JSON."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator

import click
import msgspec

from robochoc.cli.reports.table import table_lines
from robochoc.formats import on_one_line
from robochoc.privacy import Kind, Measure, PrivacyReport
from robochoc.system.plain_text import counted, listed

NOT_KNOWN = "not known"
_MEASURE_TEXTS = {
    Measure.LINEAR: "by LinearTS (share of the states that are excluded)",
    Measure.ENTROPY: "by EntropyTS (share of the bits that are known)",
    Measure.KNOWN: "as the share of secrets that are known exactly",
}


def print_privacy(report: PrivacyReport, measure: Measure) -> None:
    """Print the mean losses of each robot, and the system's losses by all measures."""
    of = f", run {report.run} of {report.runs}" if report.runs > 1 else ""
    click.echo(on_one_line(f"{report.team}: {report.protocol}{of}, {counted(len(report.robots), 'robot')}"))
    kinds = report.kinds()
    if not kinds:
        click.echo("  no robot has a secret")
    else:
        click.echo(f"  loss {_MEASURE_TEXTS[measure]}, the mean over all other robots")
        for line in table_lines(["robot", *kinds], _rows(report, kinds, measure), right=kinds):
            click.echo(f"  {line}")
    for line in _notes(report):
        click.echo(on_one_line(f"  {line}"))


def _rows(report: PrivacyReport, kinds: list[Kind], measure: Measure) -> Iterator[list[str]]:
    for robot in report.robots:
        there = {loss.kind for loss in report.losses if loss.subject == robot}
        yield [robot, *(_text(report.loss_of(robot, kind, measure)) if kind in there else "-" for kind in kinds)]
    for one in (measure, *(other for other in Measure if other is not measure)):
        yield [f"system, {one}", *(_text(report.system_loss(kind, one)) for kind in kinds)]


def _notes(report: PrivacyReport) -> Iterator[str]:
    if report.without_rule:
        yield f"not known: no rule defines what these messages prove: {listed(report.without_rule)}"
    if report.undecided:
        yield f"no decisions: {report.undecided}"


def privacy_json(report: PrivacyReport) -> str:
    """Return the report as one JSON object, in which an unknown loss is null."""
    fields: dict[str, object] = {
        "team": report.team,
        "protocol": report.protocol,
        "run": report.run,
        "runs": report.runs,
        "robots": report.robots,
        "system": {
            kind: {measure: report.system_loss(kind, measure) for measure in Measure} for kind in report.kinds()
        },
        "losses": [dataclasses.asdict(loss) for loss in report.losses],
        "without_rule": report.without_rule,
        "undecided": report.undecided,
    }
    return msgspec.json.format(msgspec.json.encode(fields), indent=2).decode()


def _text(loss: float | None) -> str:
    return NOT_KNOWN if loss is None else f"{loss:.3f}"
