"""Programs of a master to be explored with `explored_team.py`, and the check of their results."""

from __future__ import annotations

from collections.abc import Callable, Mapping

from robochoc.communication.processes import processes
from robochoc.communication.search_result import SearchResult
from robochoc.communication.session import Epoch
from robochoc.model.outcome import Verdict
from robochoc.model.problem import Team
from robochoc.protocols.protocol import Protocol
from robochoc.solver.compiled_team import ensure_compiled
from tests.support.explored_robots import RobotView

Program = Callable[[], SearchResult]


def one_search(team: Team, protocol: type[Protocol], *, timeout_s: float | None = None, shown: bool = False) -> Program:
    """Return the program of a master with one search. `shown`: it counts messages from time to time, by a wave."""
    compiled = ensure_compiled(team)

    def program() -> SearchResult:
        progress = (lambda _: None) if shown else None
        return processes.ProcessesRun(compiled, protocol, progress=progress).run(timeout_s)

    return program


def two_searches(team: Team, protocol: type[Protocol], *, timeout_s: float | None = None) -> Program:
    """Return the program of a master whose robots search, and search again after a change that changes nothing."""
    compiled = ensure_compiled(team)

    def program() -> SearchResult:
        with processes.ProcessesRun(compiled, protocol) as session:
            session.search(timeout_s)
            session.change(Epoch(compiled))
            return session.search()

    return program


def concluded(result: object, robots: Mapping[str, RobotView]) -> str:
    """Return why a search has not ended as it should: with the robots' values, and the verdict of its witness."""
    if not isinstance(result, SearchResult):
        return f"the search has failed: {result}"
    if result.assignments != {name: robot.assignment for name, robot in robots.items()}:
        return f"{result.assignments} are not the values of the robots"
    verdict = Verdict.SOLUTION if result.witness is None else robots[result.witness].verdict
    return "" if result.verdict == verdict else f"the verdict {result.verdict} is not that of {result.witness}"
