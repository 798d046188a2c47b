"""The report of `robochoc play`: a table with a row per robot, and JSON."""

from __future__ import annotations

from collections.abc import Iterator

import click
import msgspec

from robochoc.cli.reports.table import table_lines
from robochoc.model.cost_units import cost_shown
from robochoc.seats.report import CoalitionReport, GameReport, SeatReport
from robochoc.system.plain_text import counted, listed, on_one_line


def print_game(report: GameReport) -> None:
    """Print the lines of `game_lines`."""
    for line in game_lines(report):
        click.echo(line)


def game_lines(report: GameReport) -> Iterator[str]:
    """Yield the result of the game, a table of the robots, and who lied or broke which rule."""
    played = counted(report.rounds, "round")
    if report.rounds < report.planned_rounds:
        played = f"{report.rounds} of {counted(report.planned_rounds, 'round')} (a partial report)"
    yield on_one_line(f"{report.team}: {played}, {_result(report)}")
    titles = ["robot", "player", "value", "regret", "messages", "texts", "tokens", "disclosed"]
    rows = [_row(one) for one in report.seats]
    for line in table_lines(titles, rows, right=titles[3:]):
        yield on_one_line(f"  {line}")
    for line in (*_remarks(report), *map(_coalition, report.coalitions)):
        yield on_one_line(f"  {line}")


def _result(report: GameReport) -> str:
    if report.cost is None:
        result = f"{counted(report.violations, 'hard constraint')} violated"
    else:
        result = f"cost {cost_shown(report.cost)}"
    if report.optimum is None:
        return f"{result}; the optimum is not known"
    regret = "" if report.regret is None else f", regret {cost_shown(report.regret)}"
    return f"{result}; optimum {cost_shown(report.optimum)} ({report.certified_by}){regret}"


def _row(one: SeatReport) -> list[str]:
    value = ", ".join(f"{name} = {part}" for name, part in one.value.items())
    known = [loss for loss in one.disclosed.values() if loss is not None]
    return [
        one.robot,
        one.player,
        value,
        _number(one.regret),
        str(one.messages),
        str(one.texts + one.claims),
        str(one.tokens),
        f"{max(known):.3f}" if known else "-",
    ]


def _number(number: float | None) -> str:
    return "-" if number is None else cost_shown(round(number, 3))


def _remarks(report: GameReport) -> Iterator[str]:
    """Yield the lies, false claims and broken rules of each robot."""
    for one in report.seats:
        if one.lies:
            rounds = listed(map(str, one.lies))
            yield f"{one.robot} lied: it announced another value than it played in {_rounds(len(one.lies))} {rounds}"
        if one.false_claims_total:
            yield f"{one.robot} made {counted(one.false_claims_total, 'false claim')} about its private costs"
        for rule, times in one.broken_rules.items():
            details = next(breach.details for breach in one.breaches if breach.rule == rule)
            first = next(breach.round for breach in one.breaches if breach.rule == rule)
            shown = f": {details}" if details else ""
            yield f"{one.robot} broke the rule {rule} {counted(times, 'time')}, first in round {first}{shown}"


def _rounds(number: int) -> str:
    return "round" if number == 1 else "rounds"


def _coalition(one: CoalitionReport) -> str:
    if one.regret is None or one.others is None:
        return f"joint regret of {listed(one.robots)}: not known"
    gain = " (it gained at the others' expense)" if one.gains_at_others_expense else ""
    return f"joint regret of {listed(one.robots)}: {_number(one.regret)}, of the others: {_number(one.others)}{gain}"


def game_json(report: GameReport) -> str:
    """Return the report as one JSON object (docs/reference/seats.md)."""
    fields = msgspec.to_builtins(report, str_keys=True, builtin_types=())
    for group, coalition in zip(fields["coalitions"], report.coalitions, strict=True):
        group["gains_at_others_expense"] = coalition.gains_at_others_expense
    return msgspec.json.Encoder(decimal_format="number").encode(fields).decode()
