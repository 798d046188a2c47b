"""The tables behind `--protocol auto` in docs/guides/which-protocol.md: protocols and orders on small problems.

.venv/bin/python benchmarks/choice.py            # two to five minutes
.venv/bin/python benchmarks/choice.py --limit 20
.venv/bin/python benchmarks/choice.py --limit 6 --changes    # problems that change: to go on, or to begin anew
"""

from __future__ import annotations

import argparse
import statistics
from collections.abc import Callable, Sequence

from robochoc.generators.coloring import coloring
from robochoc.generators.meetings import meetings
from robochoc.generators.queens3d import queens3d
from robochoc.generators.random_csp import random_csp
from robochoc.generators.scenario import random_scenario
from robochoc.model.orders import Order
from robochoc.model.outcome import Verdict
from robochoc.model.problem import Team
from robochoc.run import Options, Runtime, solve
from robochoc.run.facts import Facts

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
CHANGING: tuple[tuple[str, Callable[[int], Team]], ...] = (
    ("random, 15 robots, 8 values, density .5, tightness .28", lambda seed: _linked(15, 8, 0.5, 0.28, seed)),
    ("random, 15 robots, 8 values, .5, .36", lambda seed: _linked(15, 8, 0.5, 0.36, seed)),
    ("random, 15 robots, 8 values, .5, .44", lambda seed: _linked(15, 8, 0.5, 0.44, seed)),
    ("random, 20 robots, 5 values, .22, .45", lambda seed: _linked(20, 5, 0.22, 0.45, seed)),
    ("3-colouring, 25 robots, degree 4", lambda seed: coloring(25, 3, 4, seed, conflicts="hard")),
    ("random, 25 robots, 5 values, .18, .42", lambda seed: _linked(25, 5, 0.18, 0.42, seed)),
    ("random, 40 robots, 5 values, .08, .55", lambda seed: _linked(40, 5, 0.08, 0.55, seed)),
)
"""A name, and what makes a problem of a seed; ten events change it."""
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


def _linked(robots: int, values: int, density: float, tightness: float, seed: int) -> Team:
    return random_csp(robots, values, density, tightness, seed, connected=True)


def changing(limit_s: float) -> None:
    """Print messages and bytes of protocols on problems that change."""
    protocols = ("dynabt", "sfb")
    heads = " | ".join(f"`{name}`: messages | bytes" for name in protocols)
    print(f"| problem | constrainedness | {heads} |\n| --- | --- |{' --- |' * 2 * len(protocols)}")
    for name, make in CHANGING:
        teams = [random_scenario(make(seed), 10, 0.02, seed) for seed in range(3)]
        cells = []
        for protocol in protocols:
            options = Options(protocol, Runtime.SIMULATOR, timeout=limit_s, cache=False)
            found = [solve(team, options) for team in teams]
            undecided = sum(one.verdict is Verdict.UNKNOWN for one in found)
            messages = statistics.median(sum(one.metrics.messages.values()) for one in found)
            sent = statistics.median(one.metrics.bytes for one in found)
            cells.append(f"{undecided} undecided | " if undecided else f"{messages:,.0f} | {sent:,.0f}")
        print(f"| {name} | {Facts(teams[0]).constrainedness:.2f} | {' | '.join(cells)} |", flush=True)


def main() -> None:
    """Print the table."""
    arguments = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    arguments.add_argument("--limit", type=float, default=10, metavar="SECONDS", help="Limit of a run.")
    arguments.add_argument("--changes", action="store_true", help="The table of problems that change.")
    limit_s = arguments.parse_args().limit
    if arguments.parse_args().changes:
        changing(limit_s)
        return
    print(f"| problem | {' | '.join(f'`{protocol}` {order}' for protocol, order in COLUMNS)} |")
    print("|" + " --- |" * (len(COLUMNS) + 1))
    for name, count, make in PROBLEMS:
        teams = [make(seed) for seed in range(count)]
        cells = [cell(teams, protocol, order, limit_s) for protocol, order in COLUMNS]
        print(f"| {name} | {' | '.join(cells)} |", flush=True)


if __name__ == "__main__":
    main()
