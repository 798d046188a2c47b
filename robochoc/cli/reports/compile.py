"""The sizes of compiled local problems, for people and for machines."""

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
from robochoc.solver.domain import TooManySolutionsError

Found = Compilation | TooManySolutionsError | CompileTimeoutError
"""A robot's compilation, or the limit that it reached."""


def sizes_json(team: Team, found: Sequence[Found], seconds: float) -> bytes:
    """Return one JSON object. A robot that reached a limit has a `reason`, and null for all that is unknown."""
    rows = [_row(team, one) for one in found]
    return msgspec.json.encode({"team": encodable(team.name), "seconds": round(seconds, 6), "robots": rows})


def print_sizes(team: Team, found: Sequence[Found], seconds: float, folder: Path) -> None:
    """Print the table, the robots without local solution, and the next step."""
    click.echo(on_one_line(team.name))
    costs = ("cost",) if team.kind == ProblemKind.DISWCSP else ()
    numbers = ("variables", "seen", "private", "local", "groups", *costs, "time")
    print_table(("robot", *numbers, "how"), [_cells(_row(team, one), costs) for one in found], right=numbers)
    empty = [one.robot for one in found if isinstance(one, Compilation) and not one.domain.values]
    if empty:
        names = on_one_line(", ".join(empty))
        click.echo(f"without local solution: {names}; so the team has no solution")
    next_step = "" if empty else f"; next: robochoc solve {on_one_line(encodable(str(folder)))}"
    click.echo(f"{len(found)} robot{'s' * (len(found) != 1)}, {seconds:.2f} s{next_step}")


def _row(team: Team, one: Found) -> dict[str, Any]:
    """Return what is known of a robot. `seconds` includes the start of ACE for the first robot that needs it."""
    robot = team[one.robot]
    row: dict[str, Any] = {
        "robot": encodable(robot.name),
        "variables": len(robot.variables),
        "interface": len(robot.interface),
        "private_constraints": len(robot.private),
        **dict.fromkeys(("local_solutions", "groups", "seconds", "source")),
    }
    if not isinstance(one, Compilation):
        return {**row, "reason": str(one)}
    known = {"local_solutions": one.domain.total, "groups": len(one.domain.values)}
    if one.domain.costs and team.kind == ProblemKind.DISWCSP:
        known |= {"cheapest": int(min(one.domain.costs)), "dearest": int(max(one.domain.costs))}
    return {**row, **known, "seconds": round(one.seconds, 6), "source": str(one.source)}


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
