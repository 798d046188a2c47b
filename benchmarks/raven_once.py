"""Solve a problem with raven-csp: `raven_once.py ALGORITHM sim|mp FILE`, a JSON file of `peer_problems.py`.

Runs in the peer's own Python, which has raven-csp and sympy installed, and no robochoc.
"""

from __future__ import annotations

import argparse
import json
from pathlib import Path

from csp.core import CSP  # type: ignore[import-not-found]
from dcsp.api import run_distributed_search  # type: ignore[import-not-found]


def main() -> None:
    """Build the problem, search, and print the answer and the count of messages as JSON."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("algorithm", metavar="ALGORITHM")
    parser.add_argument("runtime", choices=["sim", "mp"])
    parser.add_argument("file", type=Path, metavar="FILE")
    asked = parser.parse_args()
    told = json.loads(asked.file.read_text())
    problem = CSP()
    for name, values in told["domains"].items():
        problem.add_variable(name, set(values))
    for number, (scope, forbidden) in enumerate(told["constraints"]):
        problem.add_constraint_explicit(f"c{number}", _expression(scope, forbidden), scope)
    result = run_distributed_search(asked.algorithm, problem, runtime=asked.runtime)
    print(json.dumps({"solved": result.satisfiable, "messages": result.metrics.get("messages_sent")}))


def _expression(scope: list[str], forbidden: list[list[int]]) -> str:
    """An expression over the variables: the shortest that raven-csp, which evaluates it each time, can be given."""
    pairs = {tuple(pair) for pair in forbidden}
    if pairs and all(len(set(pair)) == 1 for pair in pairs):
        return " != ".join(scope)
    return f"({', '.join(scope)}) not in {pairs or '()'}"


if __name__ == "__main__":
    main()
