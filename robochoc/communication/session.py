"""A session: a team that searches, and continues when its problem changes. Every runtime offers one."""

from __future__ import annotations

import time
from abc import ABC, abstractmethod
from types import TracebackType
from typing import NamedTuple, Self

from robochoc.communication.run_result import RunResult
from robochoc.communication.search_watch import SearchWatch
from robochoc.model.problem import Team
from robochoc.protocols.protocol import Protocol
from robochoc.solver.agent_problem import DEFAULT_PARAMETERS, AgentProblem, RunParameters, agent_problems
from robochoc.solver.compiled_team import CompiledTeam, ensure_compiled
from robochoc.solver.explanation import Invalidated
from robochoc.system.compiling import mypyc_attr


class Epoch(NamedTuple):
    """One problem that the team solves, between two changes.

    Attributes:
        compiled: The team, with compiled domains.
        invalidated: What of the epoch before no longer holds.
        restarted: Robots that begin anew, though there may have been others of their names before.
        parameters: What robots are given besides the problem.
    """

    compiled: CompiledTeam
    invalidated: Invalidated = Invalidated(frozenset(), frozenset())
    restarted: frozenset[str] = frozenset()
    parameters: RunParameters = DEFAULT_PARAMETERS

    @property
    def team(self) -> Team:
        """The team, in the order that its robots work in."""
        return self.compiled.team

    def parts(self, protocol: type[Protocol]) -> dict[str, AgentProblem]:
        """Return each robot's part of the problem for `protocol`."""
        traits = protocol.traits
        return agent_problems(self.compiled, self.parameters, shared_scopes=traits.shared_scopes, tree=traits.tree)


@mypyc_attr(allow_interpreted_subclasses=True)
class Session(ABC):
    """One team and one protocol in one runtime. A context manager.

    `compiled` is what its robots work on: the `team` that it was opened with (compiled without a solver, where that was
    not done before), and after each `change` that epoch's. `anew`: robots know nothing of the epoch before, whatever
    their protocol could have kept. `watch` gets snapshots of a search while it goes on (None: nobody watches).
    """

    anew: bool = False
    watch: SearchWatch | None = None

    def __init__(self, team: Team | CompiledTeam) -> None:
        self.compiled = ensure_compiled(team)

    def workable(self, team: Team) -> Team:
        """Return `team`, a later form of the one that the robots work on, as they can continue with it."""
        return team

    @property
    @abstractmethod
    def lossless(self) -> bool:
        """Return whether no message of the previous search was lost: it became quiescent, or there was none."""

    @abstractmethod
    def search(self, timeout: float | None = None, messages: int | None = None) -> RunResult:
        """Search until there is a verdict, for at most `timeout` seconds or (about) `messages` messages.

        When a limit comes first the verdict is `unknown`. The metrics are those of this search. Robots begin only
        when all are there, as the paper's master orders the start. Raises `RobotsLostError` where robots can be lost.
        """

    @abstractmethod
    def change(self, epoch: Epoch) -> None:
        """Give every robot its part of the changed problem; the next `search` works on that. Raises as `search`."""

    @abstractmethod
    def close(self) -> None:
        """Release all resources of the session."""

    def run(self, timeout: float | None = None) -> RunResult:
        """Search once, then close the session."""
        with self:
            return self.search(timeout)

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()


def over(deadline: float | None) -> bool:
    """Return whether `deadline` (on the monotonic clock; None: there is none) has come."""
    return deadline is not None and time.monotonic() >= deadline
