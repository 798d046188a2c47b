"""Teams of robots that solve constraint problems together.

Names:
    load: Reads a team's files, and returns a `Problem`.
    Problem: A problem, which `solve()` solves on this machine.
    Outcome: What `solve()` returns.
    Verdict: The answer to a problem: solution, optimal, no solution, unknown.
    AgentsContainer: The master or robots on one of several machines.

Example:
    >>> import robochoc
    >>> robochoc.load("instances/queens3d-4").solve(runtime="simulator").verdict
    <Verdict.NO_SOLUTION: 'no-solution'>
"""

from __future__ import annotations

TYPE_CHECKING = False  # to import `typing` would delay the handling of signals (cli/main.py)
if TYPE_CHECKING:
    from robochoc.api import AgentsContainer, Problem, load
    from robochoc.model.outcome import Outcome, Verdict

__all__ = ["AgentsContainer", "Outcome", "Problem", "Verdict", "__version__", "load"]

__version__ = "0.1.0"


def __getattr__(name: str) -> object:
    """Import what is asked for: the command line starts faster without it."""
    if name in {"AgentsContainer", "Problem", "load"}:
        from robochoc import api  # noqa: PLC0415 - start-up

        return getattr(api, name)
    if name in {"Outcome", "Verdict"}:
        from robochoc.model import outcome  # noqa: PLC0415 - start-up

        return getattr(outcome, name)
    raise AttributeError(f"module 'robochoc' has no attribute {name!r}")
