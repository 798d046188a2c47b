"""Makes a plan with a finding smaller, as long as it has the same finding, and writes it down."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

from robochoc.model.team_edits import ChangeError
from robochoc.system.errors import RobochocError
from tests.simulation.drawing import drawn_plan
from tests.simulation.invariants import Finding
from tests.simulation.plan import Plan, Reduction, described, possible_reductions, reduced

MOST_TRIES = 600
"""Runs for one minimisation."""

Find = Callable[[Plan], list[Finding]]


def minimised(plan: Plan, kind: str, find: Find, most: int = MOST_TRIES) -> Plan:
    """Return a smaller plan with a finding of this `kind`: nothing can be left out alone, or `most` runs were used."""
    tries, shrunk = 0, True
    while shrunk:
        shrunk = False
        for reduction in possible_reductions(plan):
            if tries >= most:
                return plan
            smaller = _without(plan, reduction)
            if smaller is None:
                continue
            tries += 1
            if any(found.kind == kind for found in find(smaller)):
                plan, shrunk = smaller, True
    return plan


def _without(plan: Plan, reduction: Reduction) -> Plan | None:
    """Return the smaller plan, or None if it is impossible: something else that was left out contained it."""
    try:
        smaller = reduced(plan, reduction)
    except (ChangeError, RobochocError, LookupError):
        return None
    return smaller if smaller.team.robots else None


def repeated(plan: Plan, reductions: list[tuple[str, str, int]]) -> Plan:
    """Return `plan` without the parts that an earlier minimisation has left out."""
    for what, which, number in reductions:
        plan = reduced(plan, Reduction(what, which, number))
    return plan


def read(path: Path) -> Plan:
    """Return the plan in a file.

    Raises:
        OSError: if the file cannot be read.
        ValueError: if it does not contain a finding, or if its seed decides another run now.
    """
    try:
        content = json.loads(path.read_bytes())
        plan = repeated(drawn_plan(content["seed"]), content["reductions"])
        planned = content["plan"]
    except (ValueError, TypeError, LookupError, RobochocError) as error:
        raise ValueError(f"{path} is not a finding of this version of make simulate: {error}") from error
    if json.loads(json.dumps(described(plan))) != planned:
        raise ValueError(f"{path}: seed {plan.seed} decides another run now; try SEED={plan.seed} COUNT=1")
    return plan


def written(folder: Path, plan: Plan, finding: Finding) -> Path:
    """Write the plan, the finding and the command that repeats it to a file; return its path."""
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / f"{plan.seed}-{''.join(c if c.isalnum() else '-' for c in finding.kind)}.json"
    content = {
        "seed": plan.seed,
        "finding": finding.kind,
        "detail": finding.detail,
        "repeat": f".venv/bin/python -m tests.simulation --repeat {path}",
        "plan": described(plan),
        "reductions": plan.reductions,
    }
    path.write_text(json.dumps(content, indent=1))
    return path
