"""The process of a search for a conflict: a sketch on standard input, the rules that are in each other's way on output.

python -m robochoc.app.conflicts.process SECONDS < sketch.json
"""

from __future__ import annotations

import signal
import sys
import time
from collections.abc import Sequence

import msgspec

from robochoc.app.conflicts.by_cpmpy import UntranslatedError, minimal_by_cpmpy
from robochoc.app.conflicts.found import Conflict, Finder
from robochoc.app.conflicts.rules import candidates, minimal, with_only
from robochoc.app.sketch.building import model_of
from robochoc.app.sketch.sketch import Sketch
from robochoc.model.outcome import Verdict
from robochoc.run.options import CENTRAL, Options
from robochoc.run.orchestrator import solve
from robochoc.system.orphans import signal_when_orphaned


class _OutOfTimeError(Exception):
    """The time was over."""


def main() -> None:
    """Search, and say what was found."""
    seconds = float(sys.argv[1])
    signal_when_orphaned(signal.SIGKILL)  # solvers need not hear anything else
    sketch = msgspec.json.decode(sys.stdin.buffer.read(), type=Sketch)
    sys.stdout.buffer.write(msgspec.json.encode(found_in(sketch, seconds)))


def found_in(sketch: Sketch, seconds: float, *, use_cpmpy: bool = True) -> Conflict:
    """Return the conflict in a sketch, by CPMpy where it is installed, else by our own central solver."""
    rules = [rule.id for rule in candidates(sketch)]
    if use_cpmpy:
        try:
            return Conflict(minimal_by_cpmpy(sketch, rules), Finder.CPMPY)
        except (ImportError, UntranslatedError):
            pass
    until = time.monotonic() + seconds

    def holds_together(some: Sequence[str]) -> bool:
        left = until - time.monotonic()
        if left <= 0:
            raise _OutOfTimeError
        team = model_of(with_only(sketch, some)).team
        verdict = solve(team, Options(protocol=CENTRAL, timeout=left, cache=False)).verdict
        if verdict is Verdict.UNKNOWN:
            raise _OutOfTimeError
        return verdict is not Verdict.NO_SOLUTION

    try:
        return Conflict(minimal(rules, holds_together), Finder.OWN)
    except _OutOfTimeError:
        return Conflict(None, Finder.OWN, late=True)


if __name__ == "__main__":
    main()
