"""Breakout beside ABT and AFC, on the same random graphs: how often each finds a colouring, and at what cost."""

from __future__ import annotations

from random import Random
from statistics import median

from graphs import soluble

from robochoc.model.outcome import Verdict
from robochoc.run import solve
from robochoc.run.options import Options, Runtime

TEAMS = [soluble(15, 32, Random(seed)) for seed in range(20)]
ENOUGH = 20_000
"""Messages after which a run is given up."""


def row(protocol: str) -> str:
    """One line of the table: the medians are over the runs that came to a solution."""
    options = Options(protocol=protocol, runtime=Runtime.SIMULATOR, messages=ENOUGH)
    solved = [outcome for team in TEAMS if (outcome := solve(team, options)).verdict is Verdict.SOLUTION]
    messages = median(sum(outcome.metrics.messages.values()) for outcome in solved)
    ncccs = median(outcome.metrics.ncccs for outcome in solved)
    return f"{protocol:10} {len(solved):3} of {len(TEAMS)} {messages:10,.0f} {ncccs:8,.0f}"


if __name__ == "__main__":
    print("protocol   solved     messages    NCCCs")
    for name in ("breakout", "abt", "afc"):
        print(row(name))
