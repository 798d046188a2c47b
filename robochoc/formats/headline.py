"""Describe an outcome in one line: the title of its page, and the first line on the terminal."""

from __future__ import annotations

from decimal import Decimal

from robochoc.model.cost_units import cost_shown
from robochoc.model.outcome import Outcome, Verdict


def describe_outcome(
    outcome: Outcome, total: int, *, flying: int | None = None, noun: str = "robot", weighted: bool | None = None
) -> str:
    """Describe the outcome in a few words: "10 of 16 fly (proven maximum)", "solution for all 16 robots".

    Args:
        outcome: The outcome of the run.
        total: The number of robots in the run. If the outcome has epochs, the robots in the last epoch are counted.
        flying: The number of `total` that have a place, if drones are counted and a robot decides about several.
        noun: The noun for the counted robots or drones, in the singular.
        weighted: True if robots differ in weight, so that a maximum is one of weight instead of number. None: unknown,
            and the words are "the best".
    """
    if flying is None:
        if outcome.epochs and outcome.epochs[-1].robots:
            total = len(outcome.epochs[-1].robots) + len(outcome.lost)
        flying = total - len(outcome.withdrawn)
    match outcome.verdict:
        case Verdict.UNKNOWN:
            so_far = f"; {flying} of {total} fly in the best answer so far" if outcome.withdrawn_alive else ""
            why = f": the best assignment violates {outcome.violations}" if outcome.violations else ""
            return f"no verdict{why or f', a limit was reached{so_far}'}"
        case Verdict.SOLUTION | Verdict.OPTIMAL if outcome.count is not None:
            return counted_solutions(outcome.count, outcome)
        case Verdict.NO_SOLUTION:
            once_solved = any(epoch.assignment for epoch in outcome.epochs)
            return f"no solution{_left(outcome)}{' in the end' if once_solved else ''}"
        case Verdict.SOLUTION | Verdict.OPTIMAL if outcome.withdrawn_alive:
            best = "proven" if outcome.verdict == Verdict.OPTIMAL else "not proven to be the"
            what = "best" if weighted is None else "maximum by weight" if weighted else "maximum"
            return f"{flying} of {total} fly ({best} {what}{_lost(outcome)})"
        case Verdict.SOLUTION | Verdict.OPTIMAL if outcome.lost:
            return f"{_solution(outcome)} for {flying} of {total} {noun}s ({len(outcome.lost)} lost)"
        case Verdict.SOLUTION | Verdict.OPTIMAL:
            return f"{_solution(outcome)} for {f'all {total} {noun}s' if total > 1 else f'the {noun}'}{_cost(outcome)}"


def counted_solutions(count: int, outcome: Outcome) -> str:
    """Return the number of solutions or optima as text. The number may be arbitrarily large."""
    if outcome.verdict == Verdict.SOLUTION:
        return f"{Decimal(count):,} solution{'s' * (count != 1)}"
    return f"{Decimal(count):,} optim{'um' if count == 1 else 'a'} of {_cost(outcome).removeprefix(', ')}"


def _solution(outcome: Outcome) -> str:
    if outcome.front:
        return f"Pareto front of {len(outcome.front):,} point{'s' * (len(outcome.front) != 1)}"
    return "optimal solution" if outcome.verdict == Verdict.OPTIMAL else "solution"


def _left(outcome: Outcome) -> str:
    return " for the robots that are left" if outcome.lost else ""


def _lost(outcome: Outcome) -> str:
    return f"; {len(outcome.lost)} lost" if outcome.lost else ""


def _cost(outcome: Outcome) -> str:
    if outcome.front:
        return ""
    if outcome.objectives:
        return "".join(f", {name} {cost_shown(cost)}" for name, cost in outcome.objectives.items())
    may_have_none = outcome.cost == 0 and isinstance(outcome.cost, int) and outcome.verdict != Verdict.OPTIMAL
    if outcome.cost is None or may_have_none:
        return ""
    return f", cost {cost_shown(outcome.cost)}"
