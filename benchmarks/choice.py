"""The table behind `--protocol auto` in docs/guides/which-protocol.md: protocols and orders on small problems.

.venv/bin/python benchmarks/choice.py            # two to five minutes
.venv/bin/python benchmarks/choice.py --limit 20
"""

from __future__ import annotations

import argparse
import statistics
from collections.abc import Callable, Sequence

from robochoc.generators.coloring import coloring
from robochoc.generators.meetings import meetings
from robochoc.generators.queens3d import queens3d
from robochoc.generators.random_csp import random_csp
from robochoc.model.orders import Order
from robochoc.model.outcome import Verdict
from robochoc.model.problem import Team
from robochoc.run import Options, Runtime, solve

PROBLEMS: tuple[tuple[str, int, Callable[[int], Team]], ...] = (
    (
        "meetings: 20 of 12 persons, 7 slots",
        3,
        lambda seed: meetings(12, 20, 3, 7, seed, max_length=2, max_value=None, model="eav"),
    ),
    (
        "random, 20 robots, 10 values, density .25, tightness .6",
        3,
        lambda seed: random_csp(20, 10, 0.25, 0.6, seed, connected=True),
    ),
    ("random, 30 robots, 8 values, .2, .5", 3, lambda seed: random_csp(30, 8, 0.2, 0.5, seed, connected=True)),
    ("random, 20 robots, 8 values, .7, .25", 3, lambda seed: random_csp(20, 8, 0.7, 0.25, seed, connected=True)),
    ("3-colouring, 60 robots, degree 4.5", 3, lambda seed: coloring(60, 3, 4.5, seed, conflicts="hard")),
    ("3-colouring, 200 robots, degree 4", 3, lambda seed: coloring(200, 3, 4, seed, conflicts="hard")),
    ("3D queens, n = 11, planar", 1, lambda _: queens3d(11)),
    ("3-colouring, 1,000 robots, degree 3", 2, lambda seed: coloring(1000, 3, 3, seed, conflicts="hard")),
)
"""A name, how many problems, and what makes one of a seed."""
COLUMNS = (
    ("sfb", Order.MIN_WIDTH),
    ("sfb", Order.MAX_DEGREE),
    ("sfb", Order.GIVEN),
    ("abt", Order.MAX_DEGREE),
    ("afc-ng", Order.DFS),
)


def cell(teams: Sequence[Team], protocol: str, order: Order, limit_s: float) -> str:
    """Return the median of messages, or of how many teams there was a verdict."""
    options = Options(protocol, Runtime.SIMULATOR, timeout=limit_s, order=order, cache=False)
    found = [solve(team, options) for team in teams]
    decided = [one for one in found if one.verdict is not Verdict.UNKNOWN]
    if len(decided) < len(teams):
        return f"{len(decided)} of {len(teams)}"
    return f"{statistics.median(sum(one.metrics.messages.values()) for one in decided):,.0f}"


def main() -> None:
    """Print the table."""
    arguments = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    arguments.add_argument("--limit", type=float, default=10, metavar="SECONDS", help="Limit of a run.")
    limit_s = arguments.parse_args().limit
    print(f"| problem | {' | '.join(f'`{protocol}` {order}' for protocol, order in COLUMNS)} |")
    print("|" + " --- |" * (len(COLUMNS) + 1))
    for name, count, make in PROBLEMS:
        teams = [make(seed) for seed in range(count)]
        cells = [cell(teams, protocol, order, limit_s) for protocol, order in COLUMNS]
        print(f"| {name} | {' | '.join(cells)} |", flush=True)


if __name__ == "__main__":
    main()
