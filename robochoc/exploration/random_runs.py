"""Runs in random orders of deliveries, played to their ends: a search that is breadth first may not get that far."""

from __future__ import annotations

from collections.abc import Callable
from random import Random

from robochoc.exploration.state_graph import StateGraph
from robochoc.exploration.team_state import Delivery, Exploration
from robochoc.generators.draws import random_integer


def play_random_runs(
    graph: StateGraph, found: Exploration, chance: Random, steps: int, is_over: Callable[[int], bool]
) -> None:
    """Play runs of up to `steps` steps in all, up to the first fault, and add them to `found`.

    Args:
        graph: The states, in which every robot can start.
        found: The result of a search without a fault.
        chance: Draws the steps.
        steps: The number of steps.
        is_over: Asked before each run, with the number of states found, whether to stop.
    """
    while steps > 0 and not found.fault and not is_over(found.states):
        found.fault, path = _run(graph, chance, steps)
        found.path = path if found.fault else ()
        found.random_runs += 1
        steps -= max(1, len(path))


def _run(graph: StateGraph, chance: Random, most: int) -> tuple[str, list[Delivery]]:
    """Play a run to its end, or up to `most` steps; return its fault (empty: there is none) and its steps."""
    state, path = graph.start().state, list[Delivery]()
    while True:
        fault = graph.fault_on_the_way(state) or (graph.fault_at_the_end(state) if graph.is_end(state) else "")
        moves = [*graph.moves(state)]
        if fault or not moves or len(path) == most:
            return fault, path
        delivery, state, refusal = moves[random_integer(chance, 0, len(moves) - 1)]
        path.append(delivery)
        if refusal:
            return refusal, path
