"""The report of `robochoc compile`: the sizes of compiled local problems, as a table and as JSON."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import click
import msgspec

from robochoc.cli.reports.table import print_table
from robochoc.formats import encodable, on_one_line
from robochoc.model.problem import ProblemKind, Team
from robochoc.solver.compile import Compilation, CompileTimeoutError
from robochoc.solver.compiled_domain import TooManySolutionsError

CompileResult = Compilation | TooManySolutionsError | CompileTimeoutError
"""A robot's compilation, or the limit that was reached."""


def sizes_json(team: Team, results: Sequence[CompileResult], seconds: float) -> bytes:
    """Return one JSON object. The entry of a robot that reached a limit has a `reason`, and null for unknown values."""
    rows = [_row(team, result) for result in results]
    return msgspec.json.encode({"team": encodable(team.name), "seconds": round(seconds, 6), "robots": rows})


def print_sizes(team: Team, results: Sequence[CompileResult], seconds: float, folder: Path) -> None:
    """Print the table, the robots without local solutions, and the next step."""
    click.echo(on_one_line(team.name))
    costs = ("cost",) if team.kind == ProblemKind.DISWCSP else ()
    numbers = ("variables", "seen", "private", "local", "groups", *costs, "time")
    print_table(("robot", *numbers, "how"), [_cells(_row(team, result), costs) for result in results], right=numbers)
    empty = [result.robot for result in results if isinstance(result, Compilation) and not result.domain.values]
    if empty:
        names = on_one_line(", ".join(empty))
        click.echo(f"without local solutions: {names}; so the team has no solution")
    next_step = "" if empty else f"; next: robochoc solve {on_one_line(encodable(str(folder)))}"
    click.echo(f"{len(results)} robot{'s' * (len(results) != 1)}, {seconds:.2f} s{next_step}")


def _row(team: Team, result: CompileResult) -> dict[str, Any]:
    """Return the entry for a robot. `seconds` includes the start of ACE for the first robot that needs ACE."""
    robot = team[result.robot]
    row: dict[str, Any] = {
        "robot": encodable(robot.name),
        "variables": len(robot.variables),
        "interface": len(robot.interface),
        "private_constraints": len(robot.private),
        **dict.fromkeys(("local_solutions", "groups", "seconds", "source")),
    }
    if not isinstance(result, Compilation):
        return {**row, "reason": str(result)}
    domain = result.domain
    known = {"local_solutions": domain.total, "groups": len(domain.values)}
    if domain.costs and team.kind == ProblemKind.DISWCSP:
        known |= {"cheapest": int(min(domain.costs)), "dearest": int(max(domain.costs))}
    return {**row, **known, "seconds": round(result.seconds, 6), "source": str(result.source)}


def _cells(row: dict[str, Any], costs: Sequence[str]) -> list[str]:
    counts = [row[name] for name in ("variables", "interface", "private_constraints", "local_solutions", "groups")]
    seconds, source = row["seconds"], row["source"]
    return [
        row["robot"],
        *("?" if count is None else f"{count:,}" for count in counts),
        *(f"{row['cheapest']:,}..{row['dearest']:,}" if "cheapest" in row else "?" for _ in costs),
        "?" if seconds is None else f"{1000 * seconds:,.1f} ms",
        "limit reached" if source is None else {"ace": "ACE", "cache": "cached"}.get(source, source),
    ]
