"""Measure answers for samples of random variables, for the table in docs/guides/uncertainty.md.

    python benchmarks/samples.py [FIRST [LAST]]

The expected cost of each assignment of a random problem is computed from all of its 15,625 or 16,384 scenarios. The
table has the number of answers that are optimal, the mean and the largest distance of their expected cost from the
optimum, and the number of confidence intervals that contain the expected cost. Each interval is from 1,000 samples.
"""

from __future__ import annotations

import argparse
import itertools
from collections.abc import Iterable
from fractions import Fraction
from random import Random
from statistics import mean
from typing import NamedTuple

import numpy as np

import robochoc
from robochoc.run.options import Options, Runtime
from robochoc.run.orchestrator import solve
from robochoc.verification import estimates, policies

PROBLEMS = 200
SAMPLES = (1, 10, 100)
VALUES = range(6)
NAMES = ("R0.x", "R1.x", "R2.x")


class Answer(NamedTuple):
    """An answer: its distance from the optimum, as a fraction, and whether the interval contains its expected cost."""

    gap: float
    is_inside: bool
    width: float


class Problem:
    """A random problem with three robots and six or seven random variables."""

    def __init__(self, number: int) -> None:
        chance = Random(f"samples {number}")
        outcomes = chance.choice([4, 5])
        count = {4: 7, 5: 6}[outcomes]
        self.laws = []
        for _ in range(count):
            cuts = sorted(chance.sample(range(1, 100), outcomes - 1))
            weights = [after - before for before, after in itertools.pairwise([0, *cuts, 100])]
            self.laws.append((sorted(chance.sample(range(10), outcomes)), weights))
        self.factors = [[chance.randint(1, 3) for _ in range(count)] for _ in range(2)]
        self.offsets = [chance.randint(0, 10) for _ in range(2)]
        self.steps = [chance.randint(3, 9) for _ in range(2)]
        self.prices = [chance.randint(0, 6) for _ in range(3)]

    def model(self) -> robochoc.Model:
        """Return the problem as a model."""
        model = robochoc.Model("samples")
        random = [
            model.random(f"g{place}", {value: Fraction(weight, 100) for value, weight in zip(*law, strict=True)})
            for place, law in enumerate(self.laws)
        ]
        x = [model.robot(f"R{place}").variable("x", VALUES) for place in range(3)]
        one, other = (
            sum(factor * each for factor, each in zip(factors, random, strict=True)) + offset
            for factors, offset in zip(self.factors, self.offsets, strict=True)
        )
        model.minimize(abs(one - self.steps[0] * x[0] - 2 * x[1]))
        model.minimize(robochoc.maximum(0, other - self.steps[1] * x[1] - x[2]) * 2)
        model.minimize(sum(price * each for price, each in zip(self.prices, x, strict=True)))
        model.add(x[0] != x[1], x[1] != x[2])
        return model

    def costs(self) -> dict[tuple[int, ...], float]:
        """Return the expected cost of each possible assignment, over all scenarios."""
        grids = np.meshgrid(*(np.array(values) for values, _ in self.laws), indexing="ij")
        chances = np.meshgrid(*(np.array(weights) / 100 for _, weights in self.laws), indexing="ij")
        weight = np.prod(chances, axis=0)
        one, other = (
            sum(factor * grid for factor, grid in zip(factors, grids, strict=True)) + offset
            for factors, offset in zip(self.factors, self.offsets, strict=True)
        )

        def cost(a: int, b: int, c: int) -> float:
            by_chance = abs(one - self.steps[0] * a - 2 * b) + 2 * np.maximum(0, other - self.steps[1] * b - c)
            return float((weight * by_chance).sum() + np.dot(self.prices, (a, b, c)))

        return {row: cost(*row) for row in itertools.product(VALUES, repeat=3) if row[0] != row[1] != row[2]}


def answers(number: int) -> dict[int, Answer]:
    """Return the answers to problem `number`, by the number of samples."""
    problem = Problem(number)
    costs, team = problem.costs(), problem.model().team
    best = min(costs.values())
    found = {}
    for samples in SAMPLES:
        outcome = solve(team, Options(protocol="dpop", runtime=Runtime.SIMULATOR, samples=samples, seed=number))
        cost = costs[tuple(outcome.assignment[name] for name in NAMES)]
        report = outcome.uncertainty.sampled if outcome.uncertainty else None
        if report is None or report.low is None or report.high is None:
            raise RuntimeError(f"problem {number} has no interval")
        low, high = float(report.low), float(report.high)
        found[samples] = Answer((cost - best) / best, low - 1e-9 <= cost <= high + 1e-9, (high - low) / cost)
    return found


def table(found: list[dict[int, Answer]]) -> Iterable[str]:
    """Yield the lines of the table."""
    yield "| samples | optimal | mean gap | largest gap | intervals with the expected cost | mean width |"
    yield "| ---: | ---: | ---: | ---: | ---: | ---: |"
    for samples in SAMPLES:
        row = [one[samples] for one in found]
        optimal = sum(one.gap < 1e-9 for one in row)
        inside = sum(one.is_inside for one in row)
        gaps = [100 * one.gap for one in row]
        width = 100 * mean(one.width for one in row)
        cells = f"{optimal} of {len(row)} | {mean(gaps):.3f} % | {max(gaps):.2f} % | {inside} of {len(row)}"
        yield f"| {samples:,} | {cells} | {width:.1f} % |"


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("first", type=int, nargs="?", default=0)
    parser.add_argument("last", type=int, nargs="?", default=PROBLEMS)
    given = parser.parse_args()
    policies.MOST_EXACT = 0  # an interval, also where the expected cost could be computed
    estimates.MOST_FRESH = estimates.LEAST_FRESH
    print("\n".join(table([answers(number) for number in range(given.first, given.last)])))


if __name__ == "__main__":
    main()
