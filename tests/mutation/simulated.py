"""Plays the first simulations of `make simulate` that use given protocols. Exit status 1: a property does not hold."""

from __future__ import annotations

import argparse
import itertools
import sys

from tests.simulation.drawing import drawn_plan
from tests.simulation.playing import examine

SEEDS = 1500
"""The seeds among which the simulations are."""


def main() -> int:
    """Run the command line."""
    parser = argparse.ArgumentParser(description="Play the first simulations that use given protocols.")
    parser.add_argument("protocols", nargs="+", metavar="PROTOCOL", help="a protocol of the simulations")
    parser.add_argument("--count", type=int, default=12, help="the number of simulations [12]")
    options = parser.parse_args()
    plans = (plan for plan in map(drawn_plan, range(1, SEEDS)) if plan.options.protocol in options.protocols)
    for plan in itertools.islice(plans, options.count):
        for finding in examine(plan).findings:
            sys.stdout.write(f"seed {plan.seed}: {finding.kind}: {finding.detail}\n")
            return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
