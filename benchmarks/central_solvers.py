"""Part `central`: the central solvers side by side on 100 instances, and the choice of `--with auto`.

    python benchmarks/central_solvers.py --solver toulbar2 --family "random WCSP" --number 0 [--limit 10]

One run in this process. Prints JSON: verdict, cost, CPU seconds and wall seconds of everything after the problem was
built, and the peak memory of the largest process of the solver in MiB.
"""

from __future__ import annotations

import argparse
import contextlib
import csv
import json
import os
import re
import resource
import statistics
import sys
import threading
import time
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from central_problems import FAMILIES, instances, problem
from measure import ROOT, Sample, say, timed_command
from report import Row, Section

from robochoc.model.costs import normalized
from robochoc.model.outcome import Verdict
from robochoc.model.problem import ProblemKind, Team
from robochoc.solver.ace import AceProcess
from robochoc.solver.central import CentralAnswer, CentralSolver
from robochoc.solver.errors import SolverLostError, UnsupportedError
from robochoc.solver.external_programs import PROGRAMS
from robochoc.solver.racing import RacingSolver
from robochoc.solver.solver_choice import AutoSolver, only
from robochoc.solver.weighted import priced_components
from robochoc.verification.checker import assignment_cost, violations

SOLVERS = ("ace", *PROGRAMS)
LIMIT_S = 5
"""The limit of CPU for a run, and for each of its processes."""
LOST_S = LIMIT_S / 10
"""Regrets count only if more CPU than this is lost: about as long as the start of a solver."""
KEPT = ROOT / "out" / "bench" / "central.jsonl"
TABLE = Path(__file__).with_name("results") / "central.csv"
Measured = dict[str, Any]


def measured() -> Section:
    """Measure all instances, write the table, and return a summary."""
    rows = list(_measured())
    with TABLE.open("w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, ["family", "number", "costs", "small", "solver", *_FIGURES], lineterminator="\n")
        writer.writeheader()
        writer.writerows(rows)
    return _section(rows)


_FIGURES = ("verdict", "cost", "cpu_s", "wall_s", "mib")


def _measured() -> Iterator[Measured]:
    """Yield the figures of each instance and solver; keep them."""
    KEPT.parent.mkdir(parents=True, exist_ok=True)
    KEPT.touch()
    kept = {
        (row["family"], row["number"], row["solver"]): row for row in map(json.loads, KEPT.read_text().splitlines())
    }
    with KEPT.open("a") as file:
        for family, number in instances():
            for solver in (*SOLVERS, "auto"):
                if (row := kept.get((family, number, solver))) is None:
                    say(f"{family} {number}: {solver}")
                    command = [
                        sys.executable,
                        __file__,
                        "--solver",
                        solver,
                        "--family",
                        family,
                        "--number",
                        str(number),
                    ]
                    sample = timed_command(command, limit_s=8 * LIMIT_S)
                    row = {"family": family, "number": number, "solver": solver, **(sample.answer or _cut(sample))}
                    print(json.dumps(row), file=file, flush=True)
                yield row


def _cut(sample: Sample) -> Measured:
    """Return the figures of a run that was ended because it took too long."""
    times = {"cpu_s": round(sample.cpu_s, 3), "wall_s": round(sample.wall_s, 3)}
    return {"costs": None, "small": False, "verdict": Verdict.UNKNOWN, "cost": None, **times, "mib": 0}


def _section(rows: Sequence[Measured]) -> Section:
    by_instance: dict[tuple[str, int], dict[str, Measured]] = {}
    for row in rows:
        by_instance.setdefault((row["family"], row["number"]), {})[row["solver"]] = row
    for which, found in by_instance.items():
        answers = {(one["verdict"], one["cost"]) for one in found.values() if _is_decided(one)}
        if len(answers) > 1:
            raise ValueError(f"the solvers disagree on {which}: {answers}")
    searched = [found for found in by_instance.values() if not found["ace"]["small"]]
    notes = (
        f"{len(by_instance)} instances; the solvers agree on all answers. `auto` enumerates"
        f" {len(by_instance) - len(searched)} of them in this process, without a solver; the tables have the other"
        f" {len(searched)}. First table: the instances decided with at most {LIMIT_S} s of CPU in all processes, the"
        f" median CPU seconds of a run ({LIMIT_S} if not decided), and the peak memory of the solver's largest process"
        " (0: not started). `ace` enumerates small problems, too (with more steps than `auto`), and adds cliques and"
        " symmetries."
        " Second table: the result of always choosing one solver, for problems without and with costs, and that of"
        f" `auto`, whose solvers have {LIMIT_S} s each. A choice is poor if it takes {LIMIT_S / 10} s more than one and"
        " a half times the CPU of the best solver. All figures are in `results/central.csv`."
    )
    first: list[Row] = [("family", "instances", *SOLVERS)]
    for family in FAMILIES:
        held = [found for (one, _), found in by_instance.items() if one == family and not found["ace"]["small"]]
        if held:
            first.append((family, str(len(held)), *(_cell([found[name] for found in held]) for name in SOLVERS)))
    second: list[Row] = [("problems", "choice", "decided", "CPU s in all", "poor choices", "CPU s of the best")]
    for kind in (False, True):
        group = [found for found in searched if found["ace"]["costs"] == kind]
        second += [_regret("with costs" if kind else "without costs", name, group) for name in (*SOLVERS, "auto")]
    return Section("central", "Central solvers", notes, (first, second), ("By family", "The choice"))


def _is_decided(row: Measured) -> bool:
    """Return whether there is an answer; that of `auto` may have taken the CPU of several solvers."""
    within = row["solver"] == "auto" or row["cpu_s"] <= LIMIT_S
    return row["verdict"] not in {Verdict.UNKNOWN, "refused"} and within


def _seconds(row: Measured) -> float:
    return row["cpu_s"] if _is_decided(row) else LIMIT_S


def _cell(rows: Sequence[Measured]) -> str:
    """Return the number of decided instances, the median time, and the memory."""
    if all(row["verdict"] == "refused" for row in rows):
        return "not supported"
    median = statistics.median(map(_seconds, rows))
    return f"{sum(map(_is_decided, rows))}, {median:.2f} s, {max(row['mib'] for row in rows)} MiB"


def _regret(kind: str, name: str, group: Sequence[Mapping[str, Measured]]) -> Row:
    """Return the result of always choosing `name`."""
    best = [min(_seconds(found[one]) for one in SOLVERS) for found in group]
    chosen = [_seconds(found[name]) for found in group]
    poor = sum(one > LOST_S + 1.5 * least for one, least in zip(chosen, best, strict=True))
    decided = sum(_is_decided(found[name]) for found in group)
    return (kind, name, f"{decided} of {len(group)}", f"{sum(chosen):.1f}", str(poor), f"{sum(best):.1f}")


def main() -> None:
    """Solve one instance by one solver."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--solver", required=True, choices=[*SOLVERS, "auto"])
    parser.add_argument("--family", required=True, choices=[*FAMILIES], metavar="FAMILY")
    parser.add_argument("--number", type=int, required=True, help="the number of the instance in its family")
    parser.add_argument("--limit", type=int, default=LIMIT_S, help="CPU seconds of each process")
    chosen = parser.parse_args()
    team = normalized(problem(chosen.family, chosen.number))
    small = _is_small(team)
    memory = PeakMemory()
    memory.start()
    before, began = _cpu_s(), time.perf_counter()
    resource.setrlimit(resource.RLIMIT_CPU, (int(_cpu_s()) + 1 + chosen.limit, resource.RLIM_INFINITY))
    try:
        answer = _solver(chosen.solver).solve(team)
        verdict = str(answer.verdict)
    except SolverLostError:  # killed at the limit
        answer, verdict = CentralAnswer(Verdict.UNKNOWN), str(Verdict.UNKNOWN)
    except UnsupportedError:
        answer, verdict = CentralAnswer(Verdict.UNKNOWN), "refused"
    wall_s, cpu_s = time.perf_counter() - began, _cpu_s() - before
    if answer.assignment and (list(violations(team, answer.assignment)) or _costs_differ(team, answer)):
        raise ValueError("the answer is wrong")
    figures = (verdict, answer.cost, round(cpu_s, 3), round(wall_s, 3), memory.mib)
    costs = team.kind == ProblemKind.DISWCSP
    print(json.dumps({"costs": costs, "small": small, **dict(zip(_FIGURES, figures, strict=True))}))


def _solver(name: str) -> CentralSolver | AutoSolver | RacingSolver:
    match name:
        case "ace":
            return CentralSolver()
        case "auto":
            return AutoSolver()
        case _:
            return only(PROGRAMS[name])


def _is_small(team: Team) -> bool:
    """Return whether `auto` enumerates all components."""
    with AceProcess() as solver:
        parts = priced_components(team)
        return all(part.network.impossible or solver.without_search(part.network, part.costs) for part in parts)


def _costs_differ(team: Team, answer: CentralAnswer) -> bool:
    return answer.cost is not None and answer.cost != assignment_cost(team, answer.assignment)


def _cpu_s() -> float:
    used = [resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)]
    return sum(one.ru_utime + one.ru_stime for one in used)


class PeakMemory(threading.Thread):
    """Reads the peak memory of the largest process below this one, 50 times a second."""

    def __init__(self) -> None:
        super().__init__(daemon=True)
        self.mib = 0

    def run(self) -> None:
        """Read until the process ends."""
        while True:
            for pid in _below(os.getpid()):
                with contextlib.suppress(OSError):
                    status = Path(f"/proc/{pid}/status").read_text(encoding="utf-8")
                    peak = re.search(r"^VmHWM:\s+(\d+) kB", status, re.MULTILINE)
                    self.mib = max(self.mib, int(peak[1]) // 1024 if peak else 0)
            time.sleep(0.02)


def _below(pid: int) -> Iterator[int]:
    """Yield the processes below `pid`."""
    with contextlib.suppress(OSError):
        for task in Path(f"/proc/{pid}/task").iterdir():
            for child in map(int, (task / "children").read_text(encoding="ascii").split()):
                yield child
                yield from _below(child)


if __name__ == "__main__":
    main()
