"""Solves the tasks of AgentsNet with six protocols each, and plays them with the baselines of seats.

`python benchmarks/agents.py [--agents N] [--seeds N]` prints two tables for docs/guides/agent-benchmarks.md: how many
runs end with a feasible answer and the mean score of AgentsNet, and the regret of the players of `robochoc play`. The
graphs are small worlds (4 neighbours), scale-free graphs (2 links) and Delaunay triangulations. Everything runs in the
simulator.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence

from robochoc.generators.agentsnet import Task
from robochoc.generators.agentsnet_score import agentsnet_score
from robochoc.generators.families import FAMILIES
from robochoc.model.outcome import Outcome
from robochoc.model.problem import Team
from robochoc.run.options import Options, Runtime
from robochoc.run.orchestrator import solve
from robochoc.seats import GameOptions, play

GRAPHS = ("small-world", "scale-free", "delaunay")
COMPLETE = ("abt", "abt-do-retro", "agile-abt", "awc", "afc-ng", "afc-tree")
LOCAL = ("dsa", "dsa-sdp", "mgm", "mgm2", "gdba", "lamdls")
MESSAGES = 300_000
"""The limit of a run; `awc` exceeds it on some triangulations."""
PLAYERS = ("random", "greedy", "dsa", "mgm", "optimal")


def protocols(task: str) -> Sequence[str]:
    """Return the six protocols for a task: a vertex cover is a DCOP, the others are DisCSPs."""
    return LOCAL if task == Task.VERTEX_COVER else COMPLETE


def solved(team: Team, protocol: str, seed: int = 1) -> Outcome:
    """Return the outcome of a run in the simulator."""
    return solve(team, Options(protocol=protocol, runtime=Runtime.SIMULATOR, seed=seed, messages=MESSAGES))


def runs_table(agents: int, seeds: int) -> None:
    """Print how many runs of each protocol are feasible, and the mean score."""
    print("| task | graph | protocol | feasible | score | messages |\n| --- | --- | --- | ---: | ---: | ---: |")
    for task in Task:
        for graph in GRAPHS:
            teams = [
                FAMILIES["agentsnet"](task=task, agents=agents, graph=graph, seed=seed, **_connected(graph))
                for seed in range(seeds)
            ]
            for protocol in protocols(task):
                found = [solved(team, protocol) for team in teams]
                feasible = [(team, one) for team, one in zip(teams, found, strict=True) if one.assignment]
                points = sum(agentsnet_score(task, team, one.assignment) for team, one in feasible) / seeds
                messages = sum(sum(one.metrics.messages.values()) for one in found) // seeds
                share = f"{len(feasible)} of {seeds}"
                print(f"| {task} | {graph} | `{protocol}` | {share} | {float(points):.2f} | {messages:,} |", flush=True)


def _connected(graph: str) -> dict[str, bool]:
    return {"connected": True} if graph == "small-world" else {}


def players_table(agents: int, seeds: int) -> None:
    """Print the mean regret of players in vertex covers, and the mean number of violated constraints."""
    print("\n| players of all robots | feasible | regret of feasible games | violated constraints |")
    print("| --- | ---: | ---: | ---: |")
    for player in PLAYERS:
        teams = [
            FAMILIES["agentsnet"](task="vertex-cover", agents=agents, graph=GRAPHS[0], seed=seed)
            for seed in range(seeds)
        ]
        games = [play(team, GameOptions(others=player, rounds=50)) for team in teams]
        regrets = [game.regret for game in games if game.regret is not None]
        mean = f"{sum(regrets) / len(regrets):.1f}" if regrets else "-"
        broken = sum(game.violations for game in games) / seeds
        print(f"| `{player}` | {len(regrets)} of {seeds} | {mean} | {broken:.1f} |")


if __name__ == "__main__":
    parser = argparse.ArgumentParser()
    parser.add_argument("--agents", type=int, default=100)
    parser.add_argument("--seeds", type=int, default=5)
    given = parser.parse_args()
    runs_table(given.agents, given.seeds)
    players_table(given.agents, given.seeds)
