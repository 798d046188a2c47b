"""A session: a team that searches, and continues when its problem changes. Every runtime implements `Session`."""

from __future__ import annotations

import time
from abc import ABC, abstractmethod
from types import TracebackType
from typing import NamedTuple, Self

from robochoc.communication.search_result import SearchResult
from robochoc.communication.search_watch import SearchWatch
from robochoc.model.problem import Team
from robochoc.protocols.protocol import Protocol
from robochoc.solver.agent_problem import DEFAULT_PARAMETERS, AgentProblem, RunParameters, agent_problems
from robochoc.solver.compiled_team import CompiledTeam, ensure_compiled
from robochoc.solver.explanation import Invalidated
from robochoc.system.compiling import mypyc_attr


class Epoch(NamedTuple):
    """A problem that the team solves between two changes.

    Attributes:
        compiled: The team, with compiled domains.
        invalidated: The results from the previous epoch that no longer hold.
        restarted: Robots that start without knowledge, even if robots with the same names existed before.
        parameters: The robots' parameters, apart from the problem.
    """

    compiled: CompiledTeam
    invalidated: Invalidated = Invalidated(frozenset(), frozenset())
    restarted: frozenset[str] = frozenset()
    parameters: RunParameters = DEFAULT_PARAMETERS

    @property
    def team(self) -> Team:
        """The team, in its robots' priority order."""
        return self.compiled.team

    def parts(self, protocol: type[Protocol]) -> dict[str, AgentProblem]:
        """Return each robot's part of the problem for `protocol`."""
        traits = protocol.traits
        return agent_problems(self.compiled, self.parameters, shared_scopes=traits.shared_scopes, tree=traits.tree)


@mypyc_attr(allow_interpreted_subclasses=True)
class Session(ABC):
    """One team with one protocol in one runtime. A session is a context manager.

    `compiled` is the team that the robots use: first the given `team` (compiled without a solver unless it is already
    compiled), and after each `change` the team of that epoch. `starts_fresh`: robots keep no knowledge of the previous
    epoch, even if their protocol could. `watch` receives snapshots during a search (None: no snapshots). `brief`: the
    caller needs only the best cycle of a search, so a runtime that knows this cycle reports no others.
    """

    starts_fresh: bool = False
    brief: bool = False
    watch: SearchWatch | None = None

    def __init__(self, team: Team | CompiledTeam) -> None:
        self.compiled = ensure_compiled(team)

    def usable_team(self, team: Team) -> Team:
        """Return the part of `team`, a changed version of the current team, with which the robots can continue."""
        return team

    @property
    @abstractmethod
    def lossless(self) -> bool:
        """True if no message was lost in the previous search: it became quiescent, or there was no previous search."""

    @abstractmethod
    def search(self, timeout: float | None = None, messages: int | None = None) -> SearchResult:
        """Search until there is a verdict, for at most `timeout` seconds or about `messages` messages.

        If a limit is reached first, the verdict is `unknown`. The metrics cover this search only. Robots start only
        when all robots are ready, as in the paper, where the master orders the start. Raises `RobotsLostError` if the
        runtime can lose robots.
        """

    @abstractmethod
    def change(self, epoch: Epoch) -> None:
        """Send every robot its part of the changed problem, for the next `search`. Raises the errors of `search`."""

    @abstractmethod
    def close(self) -> None:
        """Release all resources of the session."""

    def run(self, timeout: float | None = None) -> SearchResult:
        """Search once, then close the session."""
        with self:
            return self.search(timeout)

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()


def is_past(deadline: float | None) -> bool:
    """Return whether `deadline` (on the monotonic clock; None: no deadline) has passed."""
    return deadline is not None and time.monotonic() >= deadline
