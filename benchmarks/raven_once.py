"""Solve the 3-colouring problem with raven-csp: `raven_once.py ALGORITHM sim|mp EDGES`, edges as JSON.

Runs in the peer's own Python, which has raven-csp and sympy installed, and no robochoc.
"""

from __future__ import annotations

import json
import sys

from csp.core import CSP  # type: ignore[import-not-found]
from dcsp.api import run_distributed_search  # type: ignore[import-not-found]


def main() -> None:
    """Build the problem, search, and print the answer and the count of messages as JSON."""
    graph = json.loads(sys.argv[3])
    problem = CSP()
    for agent in sorted({agent for edge in graph for agent in edge}):
        problem.add_variable(f"v{agent}", {0, 1, 2})
    for i, j in graph:
        problem.add_constraint(f"c{i}_{j}", f"v{i} != v{j}")
    result = run_distributed_search(sys.argv[1], problem, runtime=sys.argv[2])
    print(json.dumps({"solved": result.satisfiable, "messages": result.metrics.get("messages_sent")}))


if __name__ == "__main__":
    main()
