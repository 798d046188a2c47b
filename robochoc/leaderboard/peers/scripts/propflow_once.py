"""Solve a problem with an engine of PropFlow: `propflow_once.py [--engine NAME] CYCLES FILE`.

This runs in a Python that has propflow and no robochoc. FILE is JSON: `domains`, and `constraints` as pairs of
variables and costs. PropFlow accepts connected graphs only, so each connected part is a graph of its own.
"""

from __future__ import annotations

import argparse
import json
import sys
from pathlib import Path
from typing import Any

import networkx as nx
import numpy as np
import propflow  # type: ignore[import-not-found]
from propflow import FactorAgent, FactorGraph, VariableAgent

DAMPING = 0.9


def main() -> None:
    """Build the factor graphs, run the cycles, and print the answer and the number of messages as JSON."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--version", action="version", version=propflow.__version__)
    parser.add_argument("--engine", default="DampingEngine", help="class of the engine")
    parser.add_argument("cycles", type=int, metavar="CYCLES")
    parser.add_argument("file", type=Path, metavar="FILE")
    given = parser.parse_args()
    problem = json.loads(given.file.read_text())
    joined = nx.Graph()
    joined.add_nodes_from(problem["domains"])
    for scope, _ in problem["constraints"]:
        nx.add_path(joined, scope)
    values: dict[str, int] = {}
    messages = 0
    for part in nx.connected_components(joined):
        within = [(scope, rows) for scope, rows in problem["constraints"] if scope[0] in part]
        if not within:
            values |= dict.fromkeys(part, 0)
            continue
        engine = _engine(given.engine, _graph(problem["domains"], within))
        engine.run(max_iter=given.cycles)
        values |= {name: int(place) for name, place in engine.assignments.items()}
        messages += 2 * sum(len(scope) for scope, _ in within) * engine.iteration_count
    cost = sum(
        np.reshape(rows, _shape(problem["domains"], scope))[tuple(values[name] for name in scope)]
        for scope, rows in problem["constraints"]
    )
    sys.stdout.write(json.dumps({"cost": float(cost), "messages": messages, "assignment": values}) + "\n")


def _engine(name: str, graph: FactorGraph) -> Any:  # noqa: ANN401 - a class of PropFlow
    settings = {"damping_factor": DAMPING} if name.startswith("Damping") else {}
    return getattr(propflow, name)(factor_graph=graph, **settings)


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
