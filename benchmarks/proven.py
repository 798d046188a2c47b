"""Explores every order of deliveries of small problems with all protocols, and writes docs/explanation/proven.md.

Each protocol has 100 problems; results are rows in out/proven.jsonl. If it is stopped, the same command continues. Rows
that were explored by other code are not recognized: remove the file to repeat them.
"""

from __future__ import annotations

import argparse
import itertools
import json
import sys
import time
from collections import defaultdict
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

from report import Row, table

from robochoc.exploration.check import CheckOptions, case_of, explore
from robochoc.exploration.judgement import TeamJudge
from robochoc.exploration.problems import small_teams
from robochoc.model.problem import INFINITE, ProblemKind, Team
from robochoc.run.options import Options, Runtime
from robochoc.run.registry import protocol_named, protocol_names
from robochoc.system.parallel_map import ParallelMap
from robochoc.system.posix import usable_processors

ROOT = Path(__file__).parents[1]
ROWS, PAGE = ROOT / "out" / "proven.jsonl", ROOT / "docs" / "explanation" / "proven.md"
SIZES = ((3, 2, 40), (4, 3, 40))
"""The maximum numbers of robots and of values, and the number of problems, which have costs if the protocol has."""
WITHOUT_COSTS = 20
"""The number of problems without costs, of the first size. Some of them have no solution."""
SEED = 1
STATES, LIMIT_S = 10_000, 60.0
"""The maximum number of states, and of seconds of CPU time, per problem."""
CYCLES = "5"
"""The number of cycles of local searches."""
BEGIN, END = "<!-- {}: written by benchmarks/proven.py -->", "<!-- end of {} -->"

Found = dict[str, Any]


class Work(NamedTuple):
    """A problem for a protocol."""

    protocol: str
    team: Team


def main() -> None:
    """Explore what is missing, and write the tables."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("protocols", nargs="*", metavar="PROTOCOL", help="protocols to explore (default: all)")
    parser.add_argument("--jobs", type=int, default=usable_processors(), help="number of processes")
    parser.add_argument("--table", action="store_true", help="only write the tables of the existing rows")
    options = parser.parse_args()
    names = options.protocols or protocol_names()
    if not options.table:
        _explore(names, options.jobs)
    _write_page(_rows())


def _explore(names: Sequence[str], jobs: int) -> None:
    done = {(row["protocol"], row["team"]) for row in _rows()}
    ROWS.parent.mkdir(exist_ok=True)
    with ROWS.open("a") as file, ParallelMap(_explored, jobs) as processes:
        for name in names:
            work = [Work(name, team) for team in _teams(name) if (name, team.name) not in done]
            for _, row in processes.results(work):
                file.write(json.dumps(row) + "\n")
                file.flush()
            print(f"{name}: {len(work)} problems explored", file=sys.stderr)


def _teams(protocol: str) -> Iterator[Team]:
    traits = protocol_named(protocol).traits
    for robots, values, count in SIZES:
        yield from itertools.islice(small_teams(traits, robots, values, SEED), count)
    without = replace(traits, costs=False, asymmetric=False)
    yield from itertools.islice(small_teams(without, *SIZES[0][:2], SEED + 1), WITHOUT_COSTS)


def _explored(work: Work, report: Callable[[int], None]) -> Found:
    """Return the row of a problem."""
    protocol = protocol_named(work.protocol)
    settings = {"cycles": CYCLES} if hasattr(protocol.settings, "cycles") else {}
    run = Options(protocol=work.protocol, runtime=Runtime.SIMULATOR, settings=settings)
    began = time.process_time()
    case = case_of(work.team, protocol, run)

    def is_over(states: int) -> bool:
        report(states)
        return time.process_time() - began > LIMIT_S

    found = explore(case, CheckOptions(protocol, run, STATES, random_steps=0), is_over)
    minimum = TeamJudge(case.compiled, case.phase).minimum
    return {
        "protocol": work.protocol,
        "team": work.team.name,
        "answer": "none" if minimum == INFINITE else "optimal" if work.team.kind == ProblemKind.DISWCSP else "solution",
        "states": found.states,
        "steps": found.steps,
        "ends": found.ends,
        "complete": found.is_complete,
        "fault": found.fault or None,
        "cpu_s": round(time.process_time() - began, 3),
    }


def _rows() -> list[Found]:
    """Return the row of each problem: the first one, if there are several."""
    rows = [json.loads(line) for line in ROWS.read_text().splitlines()] if ROWS.exists() else []
    return list({(row["protocol"], row["team"]): row for row in reversed(rows)}.values())


def _write_page(rows: Sequence[Found]) -> None:
    """Replace the tables of the page."""
    by_protocol = defaultdict(list)
    for row in rows:
        by_protocol[row["protocol"]].append(row)
    text = PAGE.read_text()
    for title, answers in (("complete protocols", COLUMNS), ("incomplete protocols", ())):
        wanted = [name for name in protocol_names() if protocol_named(name).traits.complete is bool(answers)]
        lines = table(_table({name: by_protocol[name] for name in wanted if name in by_protocol}, answers))
        before, _, rest = text.partition(BEGIN.format(title))
        _, _, after = rest.partition(END.format(title))
        text = f"{before}{BEGIN.format(title)}\n\n{lines}\n\n{END.format(title)}{after}"
    PAGE.write_text(text)


COLUMNS = ("solution", "none", "optimal")
"""The answers that complete protocols find; also the values of `answer` in rows."""


def _table(found: dict[str, list[Found]], answers: Sequence[str]) -> list[Row]:
    lines: list[Row] = [("protocol", "problems", "all explored", *answers, "states", "ends", "CPU s", "faults")]
    everything = [row for rows in found.values() for row in rows]
    for name, rows in [*found.items(), ("**in all**", everything)]:
        whole = [row for row in rows if row["complete"]]
        numbers = [len(rows), len(whole), *(sum(row["answer"] == answer for row in whole) for answer in answers)]
        numbers += [sum(row[key] for row in rows) for key in ("states", "ends")]
        numbers += [round(sum(row["cpu_s"] for row in rows)), sum(row["fault"] is not None for row in rows)]
        lines.append((name, *(f"{number:,}" for number in numbers)))
    return lines


if __name__ == "__main__":
    main()
