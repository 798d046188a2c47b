"""Compare breakout with ABT and AFC on the same random graphs: the number of colourings found, and the costs."""

from __future__ import annotations

from random import Random
from statistics import median

from graphs import soluble
from printing import show

from robochoc.model.outcome import Verdict
from robochoc.run import solve
from robochoc.run.options import Options, Runtime

TEAMS = [soluble(15, 32, Random(seed)) for seed in range(20)]
ENOUGH = 20_000
"""The number of messages after which a run ends."""


def row(protocol: str) -> str:
    """Return a line of the table; the medians are over the runs that found a solution."""
    options = Options(protocol=protocol, runtime=Runtime.SIMULATOR, messages=ENOUGH)
    solved = [outcome for team in TEAMS if (outcome := solve(team, options)).verdict is Verdict.SOLUTION]
    messages = median(sum(outcome.metrics.messages.values()) for outcome in solved)
    ncccs = median(outcome.metrics.ncccs for outcome in solved)
    return f"{protocol:10} {len(solved):3} of {len(TEAMS)} {messages:10,.0f} {ncccs:8,.0f}"


if __name__ == "__main__":
    show("protocol   solved     messages    NCCCs")
    for name in ("breakout", "abt", "afc"):
        show(row(name))
