"""The process of OR-Tools: CP-SAT (https://developers.google.com/optimization/cp/cp_solver) solves tables of codes.

Started by `solver/cp_sat.py`, never imported: a search in native code ignores signals and does not free its memory, but
its process can be ended.

    python -m robochoc.solver.cp_sat_process SOCKET
"""

from __future__ import annotations

import math
import os
import queue
import signal
import sys
import threading
import time
from collections.abc import Sequence
from io import BufferedRWPair
from typing import Any

import msgspec

from robochoc.solver.cp_sat_messages import (
    LENGTH,
    CpSatAnswer,
    CpSatComparison,
    CpSatFailed,
    CpSatJunction,
    CpSatTask,
    FromCpSat,
)
from robochoc.solver.process_socket import connect_to_parent
from robochoc.system.posix import IS_POSIX
from robochoc.system.signals import leave_ctrl_c_to_the_parent, signal_when_orphaned

WORKERS = 1
"""One thread, for comparable measurements, and because robots need the other cores."""


def main() -> None:
    """Serve the parent's tasks until it hangs up."""
    if IS_POSIX:
        signal_when_orphaned(signal.SIGKILL)
    leave_ctrl_c_to_the_parent()
    stream = connect_to_parent(sys.argv[1]).makefile("rwb")
    tasks: queue.SimpleQueue[CpSatTask] = queue.SimpleQueue()
    threading.Thread(target=_receive_tasks, args=(stream, tasks), daemon=True).start()
    while True:
        _send(stream, _answer(tasks.get()))


def _receive_tasks(stream: BufferedRWPair, tasks: queue.SimpleQueue[CpSatTask]) -> None:
    """Receive tasks. End the process when the parent hangs up, also during a search."""
    decoder = msgspec.msgpack.Decoder(CpSatTask)
    while len(head := stream.read(LENGTH.size)) == LENGTH.size:
        tasks.put(decoder.decode(stream.read(LENGTH.unpack(head)[0])))
    os._exit(0)


def _send(stream: BufferedRWPair, message: FromCpSat) -> None:
    body = msgspec.msgpack.encode(message)
    stream.write(LENGTH.pack(len(body)) + body)
    stream.flush()


def _answer(task: CpSatTask) -> FromCpSat:
    try:
        return _solve(task)
    except ImportError as error:
        return CpSatFailed(str(error), missing=True)
    except Exception as error:  # noqa: BLE001 - any error is reported to the parent
        return CpSatFailed(f"{type(error).__name__}: {error}")


def _solve(task: CpSatTask) -> CpSatAnswer:
    """Return the answer of CP-SAT."""
    from ortools.sat.python import cp_model  # noqa: PLC0415 - here, so that its absence can be reported

    if any(table.allowed and not table.rows for table in task.tables):
        return CpSatAnswer(None, proven=True)
    model, variables = _model_of(task, cp_model)
    solver = cp_model.CpSolver()
    solver.parameters.num_workers = WORKERS
    solver.parameters.random_seed = 0
    solver.parameters.catch_sigint_signal = False
    if task.deadline is not None:
        solver.parameters.max_time_in_seconds = max(0.01, task.deadline - time.monotonic())
    status = solver.solve(model)
    if status in (cp_model.OPTIMAL, cp_model.FEASIBLE):
        codes = tuple([solver.value(variable) for variable in variables])
        if status == cp_model.OPTIMAL or not task.costs:
            return CpSatAnswer(codes, proven=True, bound=sum(unit * codes[place] for place, unit in task.costs))
        return CpSatAnswer(codes, proven=False, bound=math.ceil(solver.best_objective_bound - 1e-6))
    if status == cp_model.INFEASIBLE:
        return CpSatAnswer(None, proven=True)
    if status == cp_model.UNKNOWN:
        return CpSatAnswer(None, proven=False)
    raise ValueError(f"CP-SAT rejected the model: {model.validate()}")


def _model_of(task: CpSatTask, cp_model: Any) -> tuple[Any, list[Any]]:  # noqa: ANN401 - imported late
    """Return the CP-SAT model of a task, with domains, tables, formulas and the sum of costs, and its variables."""
    model = cp_model.CpModel()
    variables = [
        model.new_int_var_from_domain(cp_model.Domain.from_values(list(codes)), f"x{place}")
        for place, codes in enumerate(task.domains)
    ]
    for table in task.tables:
        scope = [variables[place] for place in table.scope]
        if table.allowed:
            model.add_allowed_assignments(scope, table.rows)
        else:
            model.add_forbidden_assignments(scope, table.rows)
    for formula in task.formulas:
        _post(model, variables, formula, ())
    if task.costs:
        paid, units = zip(*task.costs, strict=True)
        model.minimize(cp_model.LinearExpr.weighted_sum([variables[place] for place in paid], units))
    return model, variables


def _post(
    model: Any,  # noqa: ANN401 - OR-Tools is imported late
    variables: Sequence[Any],
    formula: CpSatComparison | CpSatJunction,
    given: tuple[Any, ...],
) -> None:
    """Add `formula` to a model; it is enforced if the literals in `given` are true."""
    if isinstance(formula, CpSatComparison):
        total = sum(factor * variables[place] for place, factor in formula.terms)
        facts = {"le": total <= formula.bound, "eq": total == formula.bound, "ne": total != formula.bound}
        model.add(facts[formula.sign]).only_enforce_if(*given)
    elif formula.every:
        for part in formula.parts:
            _post(model, variables, part, given)
    else:
        literals = [model.new_bool_var("") for _ in formula.parts]
        for literal, part in zip(literals, formula.parts, strict=True):
            _post(model, variables, part, (literal,))
        model.add_bool_or(literals).only_enforce_if(*given)


if __name__ == "__main__":
    main()
