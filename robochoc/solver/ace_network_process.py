"""The process of ACE as an external solver of one network, with the cliques and symmetries of `CentralSolver`.

It starts ACE in another process (`solver/ace.py`), which ends when this one has ended. So `solver/racing.py` can run
ACE and another solver in parallel, although the search for cliques and symmetries does not wait for others.

    python -m robochoc.solver.ace_network_process SOCKET
"""

from __future__ import annotations

from typing import cast

from robochoc.solver.ace import AceProcess
from robochoc.solver.central import CentralSolver
from robochoc.solver.encoding import CodeTable, Component, Network
from robochoc.solver.errors import SolverTimeoutError
from robochoc.solver.linear import Formula, Junction, LinearComparison, Sign
from robochoc.solver.network_task import NetworkTask, TaskAnswer, TaskComparison, TaskJunction
from robochoc.solver.task_process import serve
from robochoc.system.time_limit import TimeLimitError

_ace = AceProcess(always=True)


def _solve(task: NetworkTask) -> TaskAnswer:
    """Return the answer of ACE."""
    tables = tuple([CodeTable(table.scope, table.allowed, table.rows) for table in task.tables])
    network = Network(task.domains, tables, formulas=tuple(map(_formula, task.formulas)))
    try:
        if task.costs or not network.constrained:
            _ace.submit(network, limit=1, costs=task.costs, deadline=task.deadline)
            answer = _ace.answer(task.deadline)
        else:
            values = range(1 + max(code for domain in task.domains for code in domain))
            part = Component(tuple([f"x{place}" for place in range(len(task.domains))]), values, network)
            answer = CentralSolver(deadline=task.deadline, solver=_ace).first_solution(part)
    except SolverTimeoutError as over:
        return TaskAnswer(over.best, proven=False)
    except TimeLimitError:
        return TaskAnswer(None, proven=False)
    if not answer.found:
        return TaskAnswer(None, proven=True)
    codes = answer.solutions[0]
    return TaskAnswer(codes, proven=True, bound=sum(unit * codes[place] for place, unit in task.costs))


def _formula(message: TaskComparison | TaskJunction) -> Formula:
    if isinstance(message, TaskJunction):
        return Junction(message.every, tuple(map(_formula, message.parts)))
    return LinearComparison(message.terms, cast("Sign", message.sign), message.bound)


if __name__ == "__main__":
    serve(_solve, ends_group=False)
