"""The process of toulbar2 (https://toulbar2.github.io/toulbar2): solves a network as a cost function network.

A table whose last columns are costs becomes a cost function over the other columns, so that toulbar2 needs no cost
variables. All other tables become cost functions that cost the upper bound in forbidden rows.

    python -m robochoc.solver.toulbar2_process SOCKET
"""

from __future__ import annotations

import math
import signal
import time
from collections import Counter
from collections.abc import Iterable, Mapping
from typing import Any, NamedTuple

from robochoc.solver.network_task import NetworkTask, TaskAnswer, TaskComparison, TaskJunction, TaskTable
from robochoc.solver.task_process import serve

DENSE_ARITY = 3
"""The largest number of variables in a cost function whose costs are an array."""
_NEVER_S = 10**8


class _CostFunction(NamedTuple):
    """The costs of rows of codes over `scope`; all other rows cost `default`."""

    scope: tuple[int, ...]
    rows: Mapping[tuple[int, ...], int]
    default: int


def _solve(task: NetworkTask) -> TaskAnswer:
    """Return the answer of toulbar2. SIGVTALRM ends its search early; the parent sends it at the deadline."""
    if hasattr(signal, "SIGVTALRM"):
        signal.signal(signal.SIGVTALRM, signal.SIG_IGN)
    import pytoulbar2.pytb2 as tb2  # noqa: PLC0415 - here, so that its absence can be reported
    from pytoulbar2 import CFN  # noqa: PLC0415

    units = dict(task.costs)
    columns = _cost_columns(task.tables, units)
    top = 1 + sum(unit * max(task.domains[place]) for place, unit in task.costs)
    problem = CFN(ubinit=top)
    places = {place: index for index, place in enumerate(p for p in range(len(task.domains)) if p not in columns)}
    index_of = {place: {code: index for index, code in enumerate(task.domains[place])} for place in places}
    try:
        for place in places:
            problem.AddVariable(f"x{place}", [f"v{code}" for code in task.domains[place]])
        for function in _cost_functions(task, units, columns, top):
            _add(problem, function, places, index_of)
        for formula in task.formulas:
            _post(problem, formula, places, task.domains)
        problem.CFN.timer(_NEVER_S)  # this makes toulbar2 react to SIGVTALRM
        found = problem.Solve()
    except tb2.Contradiction:
        found = None
    if found is None:
        return TaskAnswer(None, proven=not _is_over(task))
    codes = [-1] * len(task.domains)
    for place, index in places.items():
        codes[place] = task.domains[place][found[0][index]]
    for table in task.tables:
        _fill(table, columns, codes)
    cost = sum(unit * codes[place] for place, unit in task.costs)
    if not _is_over(task):
        return TaskAnswer(tuple(codes), proven=True, bound=cost)
    bound = min(cost, max(0, math.ceil(problem.GetDDualBound() - 1e-6)))
    return TaskAnswer(tuple(codes), proven=bound == cost, bound=bound)


def _is_over(task: NetworkTask) -> bool:
    return task.deadline is not None and time.monotonic() >= task.deadline - 0.01


def _cost_columns(tables: Iterable[TaskTable], units: Mapping[int, int]) -> set[int]:
    """Return the cost variables that occur in one table only, which allows its rows: their costs need no variable."""
    uses = Counter(place for table in tables for place in table.scope)
    allowed = {place for table in tables if table.allowed for place in table.scope}
    return {place for place in units if uses[place] == 1 and place in allowed}


def _cost_functions(
    task: NetworkTask, units: Mapping[int, int], columns: set[int], top: int
) -> Iterable[_CostFunction]:
    """Yield the tables, and the costs of cost variables that remain, as cost functions."""
    for table in task.tables:
        kept = [number for number, place in enumerate(table.scope) if place not in columns]
        priced = [(number, units[place]) for number, place in enumerate(table.scope) if place in columns]
        rows: dict[tuple[int, ...], int] = {}
        for row in table.rows:
            key = tuple([row[number] for number in kept])
            cost = sum(unit * row[number] for number, unit in priced) if table.allowed else top
            rows[key] = min(cost, rows.get(key, cost))
        yield _CostFunction(tuple([table.scope[number] for number in kept]), rows, top if table.allowed else 0)
    for place in units.keys() - columns:
        yield _CostFunction((place,), {(code,): units[place] * code for code in task.domains[place]}, 0)


def _add(
    problem: Any,  # noqa: ANN401 - toulbar2 is imported late
    function: _CostFunction,
    places: Mapping[int, int],
    index_of: Mapping[int, Mapping[int, int]],
) -> None:
    scope = [places[place] for place in function.scope]
    indices = [index_of[place] for place in function.scope]
    rows = {
        tuple([known[code] for known, code in zip(indices, row, strict=True)]): cost
        for row, cost in function.rows.items()
        if all(code in known for known, code in zip(indices, row, strict=True))
    }
    if not scope:
        problem.AddFunction([], rows.get((), function.default))
    elif len(scope) > DENSE_ARITY:
        if rows:
            problem.AddCompactFunction(scope, function.default, [*map(list, rows)], [*rows.values()])
        elif function.default:
            problem.AddFunction([], function.default)
    else:
        sizes = [len(known) for known in indices]
        costs = [function.default] * math.prod(sizes)
        for row, cost in rows.items():
            at = 0
            for index, size in zip(row, sizes, strict=True):
                at = at * size + index
            costs[at] = cost
        problem.AddFunction(scope, costs)


def _post(
    problem: Any,  # noqa: ANN401 - toulbar2 is imported late
    formula: TaskComparison | TaskJunction,
    places: Mapping[int, int],
    domains: tuple[tuple[int, ...], ...],
) -> None:
    """Add a conjunction of sums compared by `le` or `eq`. The parent sends no other formulas."""
    if isinstance(formula, TaskJunction):
        for part in formula.parts:
            _post(problem, part, places, domains)
        return
    if not formula.terms:
        if not (formula.bound == 0 if formula.sign == "eq" else formula.bound >= 0):
            problem.AddFunction([], problem.UbInit)
        return
    terms = [
        (places[place], index, factor * code)
        for place, factor in formula.terms
        for index, code in enumerate(domains[place])
    ]
    problem.AddGeneralizedLinearConstraint(terms, "==" if formula.sign == "eq" else "<=", formula.bound)


def _fill(table: TaskTable, columns: set[int], codes: list[int]) -> None:
    """Set the codes of the cost variables of `table` to those of the cheapest matching row."""
    priced = [number for number, place in enumerate(table.scope) if place in columns]
    if not priced:
        return
    kept = [(number, codes[place]) for number, place in enumerate(table.scope) if place not in columns]
    matching = [row for row in table.rows if all(row[number] == code for number, code in kept)]
    row = min(matching, key=lambda row: [row[number] for number in priced])
    for number in priced:
        codes[table.scope[number]] = row[number]


if __name__ == "__main__":
    serve(_solve)
