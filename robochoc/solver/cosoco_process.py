"""The process of cosoco (https://github.com/xcsp3team/cosoco): writes a network as XCSP3, and runs the program on it.

The program reads the problem from its standard input, so there is no temporary file. At the deadline it is asked to
end by SIGTERM, and prints the best solution.

    python -m robochoc.solver.cosoco_process SOCKET
"""

from __future__ import annotations

import signal
import subprocess
import sys
import time
from collections.abc import Iterator, Sequence

from robochoc.solver.network_task import NetworkTask, TaskAnswer, TaskTable
from robochoc.solver.task_process import serve
from robochoc.solver.xcsp3_formula import in_xcsp3
from robochoc.system.signals import signal_when_orphaned

REPORT_TIME_S = 0.5
"""The time after the deadline in which cosoco may print its best solution, in seconds."""
_LONGEST_WAIT_S = 1e6
_OPTIONS = ("/dev/stdin", "-model=1", "-colors=0", "-verb=0")
_PROVEN = {"SATISFIABLE", "OPTIMUM FOUND", "UNSATISFIABLE"}


def _solve(task: NetworkTask) -> TaskAnswer:
    """Return the answer of cosoco."""
    from cosoco_bin import PATH  # noqa: PLC0415 - here, so that its absence can be reported

    if not task.tables and not task.formulas:  # cosoco crashes without constraints
        return TaskAnswer(tuple([codes[0] for codes in task.domains]), proven=True)
    verdict, values = _parsed(_output([PATH, *_OPTIONS], "".join(_document(task)).encode(), task.deadline))
    if verdict == "UNSATISFIABLE":
        return TaskAnswer(None, proven=True)
    if values is None:
        return TaskAnswer(None, proven=False)
    codes = tuple(
        [domain[0] if value == "*" else int(value) for domain, value in zip(task.domains, values, strict=True)]
    )
    proven = verdict == "OPTIMUM FOUND" or not task.costs
    cost = sum(unit * codes[place] for place, unit in task.costs)
    return TaskAnswer(codes, proven=proven, bound=cost if proven else 0)


def _output(command: Sequence[str], document: bytes, deadline: float | None) -> str:
    """Return the output of the program. Raises `ValueError` if it has failed."""
    die_with_this_process = (lambda: signal_when_orphaned(signal.SIGKILL)) if sys.platform == "linux" else None
    with subprocess.Popen(  # noqa: S603 - cosoco
        command,
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        preexec_fn=die_with_this_process,  # noqa: PLW1509 - the other thread only reads
    ) as program:
        try:
            output, _ = program.communicate(document, _left_s(deadline))
        except subprocess.TimeoutExpired:
            program.terminate()
            try:
                output, _ = program.communicate(timeout=REPORT_TIME_S)
            except subprocess.TimeoutExpired:
                program.kill()
                return ""
            return output.decode("ascii", "replace")
    if program.returncode < 0:
        raise ValueError(f"cosoco was killed by {signal.Signals(-program.returncode).name}")
    text = output.decode("ascii", "replace")
    if _parsed(text)[0] not in _PROVEN:
        raise ValueError("cosoco stopped without an answer")
    return text


def _left_s(deadline: float | None) -> float | None:
    return None if deadline is None else min(max(0.01, deadline - time.monotonic()), _LONGEST_WAIT_S)


def _parsed(output: str) -> tuple[str, list[str] | None]:
    """Return the verdict and the values in the output. `UNKNOWN`, None: there are none.

    If cosoco finds a contradiction while it reads the problem, it says so, but goes on without the contradiction.
    """
    verdict, values = "UNKNOWN", None
    for line in output.splitlines():
        if line.startswith("s ") and verdict != "UNSATISFIABLE":
            verdict = line[2:].strip()
        elif line.startswith("v "):
            values = line[2:].split()
    return verdict, None if verdict == "UNSATISFIABLE" else values


def _document(task: NetworkTask) -> Iterator[str]:
    """Yield the XCSP3 document of a task. Scopes with the same table share its rows."""
    yield f'<instance format="XCSP3" type="{"COP" if task.costs else "CSP"}"><variables>'
    for place, codes in enumerate(task.domains):
        yield f'<var id="x{place}">{" ".join(map(str, codes))}</var>'
    yield "</variables><constraints>"
    for tables in _alike(task.tables):
        first = tables[0]
        kind = "supports" if first.allowed else "conflicts"
        if len(first.scope) == 1:
            rows = " ".join(str(code) for (code,) in first.rows)
        else:
            rows = "".join(f"({','.join(map(str, row))})" for row in first.rows)
        formal = " ".join(f"%{number}" for number in range(len(first.scope)))
        yield f"<group><extension><list>{formal}</list><{kind}>{rows}</{kind}></extension>"
        for table in tables:
            yield f"<args>{' '.join(f'x{place}' for place in table.scope)}</args>"
        yield "</group>"
    for formula in task.formulas:
        yield f"<intension>{in_xcsp3(formula)}</intension>"
    yield "</constraints>"
    if task.costs:
        listed = " ".join(f"x{place}" for place, _ in task.costs)
        units = " ".join(str(unit) for _, unit in task.costs)
        yield f'<objectives><minimize type="sum"><list>{listed}</list><coeffs>{units}</coeffs></minimize></objectives>'
    yield "</instance>"


def _alike(tables: Sequence[TaskTable]) -> Iterator[list[TaskTable]]:
    groups: dict[tuple[bool, int, tuple[tuple[int, ...], ...]], list[TaskTable]] = {}
    for table in tables:
        if table.rows:
            groups.setdefault((table.allowed, len(table.scope), table.rows), []).append(table)
    yield from groups.values()


if __name__ == "__main__":
    serve(_solve)
