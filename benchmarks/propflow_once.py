"""Solve a problem with PropFlow's damped Max-Sum: `propflow_once.py CYCLES FILE`, a JSON file of `peer_problems.py`.

Runs in the peer's own Python, which has propflow and networkx installed, and no robochoc. PropFlow takes connected
graphs only, so each connected part is a graph of its own.
"""

from __future__ import annotations

import argparse
import json
from pathlib import Path

import networkx as nx
import numpy as np
from propflow import DampingEngine, FactorAgent, FactorGraph, VariableAgent  # type: ignore[import-not-found]


def main() -> None:
    """Build the factor graphs, run the cycles, and print the cost and the count of messages as JSON."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("cycles", type=int, metavar="CYCLES")
    parser.add_argument("file", type=Path, metavar="FILE")
    asked = parser.parse_args()
    told = json.loads(asked.file.read_text())
    joined = nx.Graph([scope for scope, _ in told["constraints"]])
    values: dict[str, int] = {}
    messages = 0
    for part in nx.connected_components(joined):
        within = [(scope, rows) for scope, rows in told["constraints"] if scope[0] in part]
        engine = DampingEngine(factor_graph=_graph(told["domains"], within), damping_factor=0.9)
        engine.run(max_iter=asked.cycles)
        values |= {name: int(place) for name, place in engine.assignments.items()}
        messages += 4 * len(within) * engine.iteration_count
    cost = sum(
        np.reshape(rows, _shape(told["domains"], scope))[tuple(values[name] for name in scope)]
        for scope, rows in told["constraints"]
    )
    print(json.dumps({"cost": float(cost), "messages": messages}))


def _graph(domains: dict[str, list[int]], constraints: list[tuple[list[str], list[float]]]) -> FactorGraph:
    variables = {name: VariableAgent(name, domain=len(domains[name])) for scope, _ in constraints for name in scope}
    edges = {}
    for number, (scope, rows) in enumerate(constraints):
        table = np.reshape(np.asarray(rows, dtype=float), _shape(domains, scope))
        factor = FactorAgent.create_from_cost_table(name=f"f{number}", cost_table=table)
        edges[factor] = [variables[name] for name in scope]
    return FactorGraph(variable_li=list(variables.values()), factor_li=list(edges), edges=edges)


def _shape(domains: dict[str, list[int]], scope: list[str]) -> tuple[int, ...]:
    return tuple(len(domains[name]) for name in scope)


if __name__ == "__main__":
    main()
