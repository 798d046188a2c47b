"""The process of OR-Tools: CP-SAT (https://developers.google.com/optimization/cp/cp_solver) solves tables of codes.

Started by `solver/external_process.py`, never imported: a search in native code ignores signals and does not free its
memory, but its process can be ended.

    python -m robochoc.solver.cp_sat_process SOCKET
"""

from __future__ import annotations

import math
import time
from collections.abc import Sequence
from typing import Any

from robochoc.solver.network_task import NetworkTask, TaskAnswer, TaskComparison, TaskJunction
from robochoc.solver.task_process import serve

WORKERS = 1
"""One thread, for comparable measurements, and because robots need the other cores."""


def _solve(task: NetworkTask) -> TaskAnswer:
    """Return the answer of CP-SAT."""
    from ortools.sat.python import cp_model  # noqa: PLC0415 - here, so that its absence can be reported

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
            return TaskAnswer(codes, proven=True, bound=sum(unit * codes[place] for place, unit in task.costs))
        return TaskAnswer(codes, proven=False, bound=math.ceil(solver.best_objective_bound - 1e-6))
    if status == cp_model.INFEASIBLE:
        return TaskAnswer(None, proven=True)
    if status == cp_model.UNKNOWN:
        return TaskAnswer(None, proven=False)
    raise ValueError(f"CP-SAT rejected the model: {model.validate()}")


def _model_of(task: NetworkTask, cp_model: Any) -> tuple[Any, list[Any]]:  # noqa: ANN401 - imported late
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
    formula: TaskComparison | TaskJunction,
    given: tuple[Any, ...],
) -> None:
    """Add `formula` to a model; it is enforced if the literals in `given` are true."""
    if isinstance(formula, TaskComparison):
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
    serve(_solve)
