"""What `robochoc compile` tells: a row a robot, for people or for machines."""

from __future__ import annotations

import shutil
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import msgspec
from rich.console import Console
from rich.markup import escape
from rich.table import Table

from robochoc.formats import encodable, on_one_line
from robochoc.model.problem import ProblemKind, Team
from robochoc.solver.compile import Compilation, CompileTimeoutError
from robochoc.solver.domain import TooManySolutionsError

Found = Compilation | TooManySolutionsError | CompileTimeoutError
"""A robot's compilation, or the limit that it reached."""

NARROWEST = 100
"""A table is not squeezed into less: the terminal may break its lines, but no number is cut."""


def json_report(team: Team, found: Sequence[Found], seconds: float) -> bytes:
    """One JSON object; a robot that reached a limit has a `reason`, and nulls for what is not known of it."""
    rows = [_row(team, one) for one in found]
    return msgspec.json.encode({"team": encodable(team.name), "seconds": round(seconds, 6), "robots": rows})


def print_table(team: Team, found: Sequence[Found], seconds: float, folder: Path) -> None:
    """The table, on standard output, and what follows from it."""
    columns = shutil.get_terminal_size().columns if sys.stdout.isatty() else NARROWEST
    console = Console(width=max(columns, NARROWEST), highlight=False, soft_wrap=True)
    console.print(_table(team, found))
    empty = [one.robot for one in found if isinstance(one, Compilation) and not one.domain.values]
    if empty:
        names = on_one_line(", ".join(empty))
        console.print(f"without local solution: {names}; so the team has no solution", markup=False)
    next_step = "" if empty else f"; next: robochoc solve {on_one_line(encodable(str(folder)))}"
    console.print(f"{len(found)} robot{'s' * (len(found) != 1)}, {seconds:.2f} s{next_step}", markup=False)


def _row(team: Team, one: Found) -> dict[str, Any]:
    """`seconds` includes the start of the solver's process where the robot was the first to need it."""
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
    if one.domain.costs and team.kind is ProblemKind.DISWCSP:
        known |= {"cheapest": int(min(one.domain.costs)), "dearest": int(max(one.domain.costs))}
    return {**row, **known, "seconds": round(one.seconds, 6), "source": str(one.source)}


def _table(team: Team, found: Sequence[Found]) -> Table:
    table = Table(title=escape(on_one_line(team.name)), title_justify="left", box=None, header_style="bold")
    table.add_column("robot", no_wrap=True)
    costs = ("cost",) if team.kind is ProblemKind.DISWCSP else ()
    for heading in ("variables", "seen", "private", "local", "groups", *costs, "time"):
        table.add_column(heading, justify="right", no_wrap=True)
    table.add_column("how", no_wrap=True)
    for one in found:
        row = _row(team, one)
        counts = [row[name] for name in ("variables", "interface", "private_constraints", "local_solutions", "groups")]
        seconds, source = row["seconds"], row["source"]
        table.add_row(
            escape(on_one_line(row["robot"])),
            *("?" if count is None else f"{count:,}" for count in counts),
            *(f"{row['cheapest']:,}..{row['dearest']:,}" if "cheapest" in row else "?" for _ in costs),
            "?" if seconds is None else f"{1000 * seconds:,.1f} ms",
            "limit reached" if source is None else {"ace": "ACE", "cache": "cached"}.get(source, source),
        )
    return table
