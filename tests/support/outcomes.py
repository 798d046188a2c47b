"""Outcomes of runs in the simulator, for tests of pages and reports."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from robochoc.model.outcome import Outcome, Verdict


def outcome_of(
    assignment: Mapping[str, int],
    verdict: Verdict = Verdict.SOLUTION,
    team: str = "t",
    protocol: str = "abt",
    **parts: Any,  # noqa: ANN401 - fields of any type
) -> Outcome:
    """Return the outcome of a run that has found `assignment`; `parts` are further fields."""
    return Outcome(
        verdict, team=team, protocol=protocol, runtime="simulator", seed=0, assignment={**assignment}, **parts
    )
