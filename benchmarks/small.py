"""Part `small`: up to which size a local problem is enumerated sooner than ACE is asked."""

from __future__ import annotations

import os
import statistics
import tempfile
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path

from crew import crew
from measure import ROBOCHOC, ROOT, repeated, say, spread, timed_command
from report import Row, Section

from robochoc.formats import write_team
from robochoc.generators.queens3d import queens3d
from robochoc.solver.ace import AceProcess
from robochoc.solver.encoding import Network, components
from robochoc.solver.enumeration import STEPS_BEFORE_ACE, STEPS_EACH, Budget, enumerate_solutions
from robochoc.solver.propagation import propagate

SIDES = (4, 5, 6, 7, 8, 9, 10, 11)
ENOUGH = 10**10
TIMES = 3


def measured() -> Section:
    """Time whole commands with and without ACE, and the same networks here and there."""
    commands: list[Row] = [("robots", "command", "wall s", "CPU s")]
    with tempfile.TemporaryDirectory() as scratch:
        for team in (crew(), queens3d(7, robots="rows")):
            write_team(team, Path(scratch) / team.name)
        for folder in (ROOT / "docs" / "examples" / "arm", *sorted(Path(scratch).iterdir())):
            for words in (("solve", "--no-cache"), ("solve", "--no-cache", "--ace")):
                command = [ROBOCHOC, *words, "--runtime", "simulator", "--json", str(folder)]
                samples = repeated(f"{folder.name}: {' '.join(words)}", partial(timed_command, command), TIMES)
                wall, cpu = (spread(figures) for figures in zip(*((s.wall_s, s.cpu_s) for s in samples), strict=True))
                commands.append((folder.name, " ".join(words), wall, cpu))
    rows: list[Row] = [("variables", "combinations", "solutions", "steps", "here", "warm ACE", "ACE from its start")]
    rows += [_row(side) for side in SIDES]
    notes = (
        "Above: whole commands in the simulator, without the cache. Below: the local problem of a robot that flies a "
        "row of the board, after propagation; CPU seconds (medians of 3) of this process, and of the process that ACE "
        "lives in: when it has solved others before, and from its start. A problem is enumerated if it takes at most "
        f"{STEPS_EACH:,} steps, and up to {STEPS_BEFORE_ACE:,} more, all problems of a run together, before ACE runs."
    )
    return Section("small", "Small local problems, with and without ACE", notes, (commands, rows))


def _row(side: int) -> Row:
    say(f"a row of {side}")
    robot = queens3d(side, robots="rows").robots[0]
    (part,) = components(robot.variables, robot.private)
    network = propagate(part.network)
    budget = Budget(ENOUGH)
    found = enumerate_solutions(network, budget, limit=None, count_only=False)
    here = _median(lambda: _here_s(network))
    with AceProcess(always=True) as ace:
        ace.solve(_queens(4), strategy="static")
        warm = _median(lambda: _ace_s(ace, network))
    cold = _median(lambda: _cold_s(network))
    size = f"{side}^{side}"
    return str(side), size, f"{found.number:,}", f"{budget.used:,}", f"{here:.3f}", f"{warm:.3f}", f"{cold:.2f}"


def _queens(side: int) -> Network:
    robot = queens3d(side, robots="rows").robots[0]
    (part,) = components(robot.variables, robot.private)
    return part.network


def _median(once: Callable[[], float]) -> float:
    return statistics.median(once() for _ in range(TIMES))


def _here_s(network: Network) -> float:
    began = time.process_time()
    enumerate_solutions(network, Budget(ENOUGH), limit=None, count_only=False)
    return time.process_time() - began


def _ace_s(ace: AceProcess, network: Network) -> float:
    before = _cpu_s(ace.pid)
    ace.solve(network, strategy="static")
    return _cpu_s(ace.pid) - before


def _cold_s(network: Network) -> float:
    with AceProcess(always=True) as ace:
        ace.solve(network, strategy="static")
        return _cpu_s(ace.pid)


def _cpu_s(pid: int | None) -> float:
    """Return the CPU seconds that process `pid` has used until now."""
    fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")
