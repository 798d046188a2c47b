"""Results of the application's runs, read from JSON with a few fields."""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Any

from robochoc.app.runs.result import RunResult, decoded


def run_result(verdict: str, assignment: Mapping[str, int | str] | None = None, **more: object) -> RunResult:
    """Return the result with these fields; see docs/reference/result.md."""
    header = {"team": "team", "protocol": "abt", "runtime": "simulator", "seed": 0}
    fields: dict[str, Any] = header | {"verdict": verdict, "assignment": assignment or {}} | more
    found = decoded(json.dumps(fields).encode() + b"\n")
    assert found is not None, fields
    return found


def run_epoch(verdict: str, assignment: Mapping[str, int | str] | None = None, **more: object) -> dict[str, object]:
    """Return an epoch with these fields."""
    return {"verdict": verdict, "robots": [], "assignment": assignment or {}, "cost": 0} | more
