"""Solve a problem with one central solver: `central_once.py ortools|toulbar2 FILE`, a JSON file of `peer_problems.py`.

Runs in a Python of its own, which has ortools and pytoulbar2 installed, and no robochoc. One process knows everything
and no message is sent: what this takes is what a team pays for not having a centre.
"""

from __future__ import annotations

import argparse
import itertools
import json
from pathlib import Path
from typing import Any


def main() -> None:
    """Build the problem, solve it on one core, and print the least cost, or null, as JSON."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("solver", choices=["ortools", "toulbar2"])
    parser.add_argument("file", type=Path, metavar="FILE")
    asked = parser.parse_args()
    solve = {"ortools": _by_ortools, "toulbar2": _by_toulbar2}[asked.solver]
    print(json.dumps({"cost": solve(json.loads(asked.file.read_text()))}))


def _by_ortools(told: dict[str, Any]) -> float | None:
    from ortools.sat.python import cp_model  # noqa: PLC0415 - only where it is asked

    model = cp_model.CpModel()
    sizes = {name: len(values) for name, values in told["domains"].items()}
    variables = {name: model.new_int_var(0, size - 1, name) for name, size in sizes.items()}
    prices = []
    for scope, rows in told["constraints"]:
        places = itertools.product(*(range(sizes[name]) for name in scope))
        table = [(*place, cost) for place, cost in zip(places, rows, strict=True) if cost is not None]
        price = model.new_int_var_from_domain(cp_model.Domain.from_values([row[-1] for row in table] or [0]), "")
        model.add_allowed_assignments([*(variables[name] for name in scope), price], table)
        prices.append(price)
    model.minimize(sum(prices))
    solver = cp_model.CpSolver()
    solver.parameters.num_workers = 1
    status = solver.solve(model)
    return solver.objective_value if status == cp_model.OPTIMAL else None


def _by_toulbar2(told: dict[str, Any]) -> float | None:
    import pytoulbar2  # noqa: PLC0415 - only where it is asked

    rows_of = [rows for _, rows in told["constraints"]]
    forbidden = 1 + sum(max((cost for cost in rows if cost is not None), default=0) for rows in rows_of)
    problem = pytoulbar2.CFN(forbidden)
    for name, values in told["domains"].items():
        problem.AddVariable(name, [f"v{place}" for place in range(len(values))])
    for scope, rows in told["constraints"]:
        problem.AddFunction(scope, [forbidden if cost is None else cost for cost in rows])
    found = problem.Solve()
    return None if found is None else float(found[1])


if __name__ == "__main__":
    main()
