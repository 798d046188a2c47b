"""The process of a search for a conflict: it reads a sketch from standard input, and writes the conflict as JSON.

python -m robochoc.app.conflicts.process SECONDS < sketch.json
python -m robochoc.app.conflicts.process SECONDS FOLDER EVENTS      for an imported team, after a number of events
"""

from __future__ import annotations

import signal
import sys
import time
from pathlib import Path

import msgspec

from robochoc.app.conflicts.by_cpmpy import UntranslatedError, minimal_by_cpmpy
from robochoc.app.conflicts.files import found_in_files
from robochoc.app.conflicts.found import Conflict, Finder
from robochoc.app.conflicts.rules import candidates, minimal, with_only
from robochoc.app.conflicts.time_left import OutOfTimeError, is_satisfiable
from robochoc.app.log import log_error
from robochoc.app.sketch.building import model_of
from robochoc.app.sketch.sketch import Sketch
from robochoc.system.orphans import signal_when_orphaned


def main() -> None:
    """Search, and write the result."""
    seconds = float(sys.argv[1])
    signal_when_orphaned(signal.SIGKILL)  # solvers may ignore other signals
    if len(sys.argv) > 2:  # noqa: PLR2004 - files
        found = found_in_files(Path(sys.argv[2]), int(sys.argv[3]), seconds)
    else:
        found = found_in(msgspec.json.decode(sys.stdin.buffer.read(), type=Sketch), seconds)
    sys.stdout.buffer.write(msgspec.json.encode(found))


def found_in(sketch: Sketch, seconds: float, *, use_cpmpy: bool = True) -> Conflict:
    """Return the conflict in a sketch, by CPMpy if it is installed, else by robochoc's central solver."""
    rules = [rule.id for rule in candidates(sketch)]
    if use_cpmpy:
        try:
            return Conflict(minimal_by_cpmpy(sketch, rules), Finder.CPMPY)
        except (ImportError, UntranslatedError):
            pass
        except Exception as fault:  # noqa: BLE001 - logged; for example, numbers that are too large for the solver
            log_error(fault, "a conflict by CPMpy")
    until = time.monotonic() + seconds
    try:
        return Conflict(
            minimal(rules, lambda some: is_satisfiable(model_of(with_only(sketch, some)).team, until)), Finder.OWN
        )
    except OutOfTimeError:
        return Conflict(None, Finder.OWN, late=True)


if __name__ == "__main__":
    main()
