"""`solve`, for problems from files and from Python: the options of a run by name, with hints where one is wrong."""

from __future__ import annotations

import inspect
from abc import ABC, abstractmethod
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import fields, replace
from typing import TYPE_CHECKING, Never

from robochoc.journal.events import Observer
from robochoc.model.outcome import Outcome
from robochoc.model.problem import Team
from robochoc.modelling.solution import Solution
from robochoc.run.defaults import AUTO
from robochoc.run.options import CentralSolverName, Options, Runtime, ScheduleName
from robochoc.run.orchestrator import solve
from robochoc.run.scenario import Environment
from robochoc.solver.compile import Limits
from robochoc.system.suggestions import did_you_mean

if TYPE_CHECKING:
    from robochoc.communication.kill_schedule import Kill
    from robochoc.communication.simulator.channel import ChannelModel

NO_LIMITS = Limits()
"""The default limits on the compilation of domains."""
_OPTIONS = frozenset(one.name for one in fields(Options))


class Solvable(ABC):
    """A problem that a team of robots can solve: the base of `Problem` and `Model`."""

    def solve(  # noqa: PLR0913 - options of a run, by their names
        self,
        protocol: str | None = None,
        runtime: str = Runtime.PROCESSES,
        *,
        order: str | Sequence[str] | None = None,
        withdraw: str | None = None,
        settings: Mapping[str, object] = {},
        observer: Observer | None = None,
        environment: Environment | None = None,
        seed: int = 0,
        timeout: float | None = None,
        deadline: float | None = None,
        improve: float | None = None,
        messages: int | None = None,
        ncccs: int | None = None,
        cycles: int | None = None,
        verify: bool = False,
        count: bool = False,
        central_with: str = CentralSolverName.ACE,
        cache: bool = True,
        local: Limits = NO_LIMITS,
        schedule: str = ScheduleName.CONCURRENT,
        delay: int = 0,
        channel: ChannelModel | None = None,
        message_loss: float = 0.0,
        on_loss: str | None = None,
        spares: int = 0,
        patience: float | None = None,
        kill: Sequence[Kill] = (),
        filters: Sequence[str] = (),
        bounds: bool = False,
        preprocess: str | None = None,
        **unknown: Never,
    ) -> Solution:
        """Let the robots solve the problem together.

        The runtime `network` starts processes that import the program: it calls this below
        `if __name__ == "__main__":`. Those of the runtime `processes` import nothing.

        Args:
            protocol: The name of the protocol, in any case. None, or `auto`: one that suits the problem.
            runtime: `processes`, `simulator`, `network` or `arrays`.
            order: The name of a priority order, such as `dom-deg`, or the names of all robots, the highest priority
                first. None: the one that suits a protocol that was chosen; otherwise that of the team, or `max-degree`
                where nobody has given it one. `given`: that of the team.
            withdraw: Which robots may withdraw if there is no solution for all: `minimum` or `maximal`. None: none may.
            settings: Settings of the protocol, by name.
            observer: It is called with every event of the run.
            environment: It gets each answer, and returns what changes next.
            seed: The seed of the simulator, of the order `random`, and of protocols that draw lots.
            timeout: A limit on wall-clock time, in seconds. None: no limit.
            deadline: The same, when the best assignment that is known counts as an answer.
            improve: For how many seconds after the deadline robots search on for what is better. None: not at all.
            messages: A limit on the number of messages. None: no limit.
            ncccs: A limit on non-concurrent constraint checks, in the simulator. None: no limit.
            cycles: A limit on cycles, with the schedule `cycles`. None: no limit.
            verify: Whether the central solver checks a `no-solution` or a minimum cost that robots have found.
            count: Whether the central solver counts all solutions, or `count-dpop` all optima.
            central_with: Who decides with the protocol `central`: `ace` or `ortools`.
            cache: Whether solutions of local problems are kept in the user's cache folder.
            local: Limits on the compilation of each robot's domain.
            schedule: How the simulator orders events: `concurrent`, `one-by-one`, `cycles` or `random`.
            delay: The longest delay of a message in the simulator, in constraint checks.
            channel: A channel model: the simulator counts seconds of computing and radio.
            message_loss: The probability that a message is lost, for good.
            on_loss: What the loss of a robot means: `fail` or `withdraw`. None: the run fails, unless there are
                `spares`.
            spares: How many robots that are lost come back.
            patience: A robot whose process is stopped for so many seconds is lost. None: it is waited for.
            kill: Robots whose processes are killed, and when.
            filters: The names of the channel filters that messages on a network go through, in this order.
            bounds: Whether events tell the observer what is proven to be the least cost (processes and simulator).
            preprocess: What robots do before the protocol: `ac`, they make their domains arc consistent. None: nothing.
            **unknown: There are no other options.

        Returns:
            The solution: a verdict, the values, their cost, and what the run took.

        Raises:
            UnsupportedError: if problem, protocol, runtime and options do not go together.
            RobotsLostError: if robots were lost, and the options do not say how to go on.
            RefutedError: if the checker refutes the answer.
            ValueError: if an option has a value that is not allowed.
            TypeError: if there is no such option.

        Example:
            >>> import robochoc
            >>> problem = robochoc.load("instances/queens3d-4")
            >>> outcome = problem.solve("abt", runtime="simulator", withdraw="minimum")
            >>> len(outcome.assignment)
            10
        """
        given = {name: value for name, value in locals().items() if name in _OPTIONS}
        _refuse(unknown)
        team = self._team_to_solve()
        options = _with_team_names(Options(**given | {"protocol": protocol or AUTO}), self._robots_called(team))
        outcome = solve(team, options, observer=observer, environment=environment, ordered=self._is_ordered)
        return self._solution(outcome, team)

    def _repr_html_(self) -> str:
        from robochoc.model.notebook.team import team_html  # noqa: PLC0415 - notebooks only

        return team_html(self._team_to_solve())

    @abstractmethod
    def _team_to_solve(self) -> Team:
        """Return the team, with its problem."""

    def _robots_called(self, team: Team) -> Mapping[str, str]:
        """Return the names of the robots in `team` by those that users have for them."""
        return {name: name for name in team.order}

    @property
    def _is_ordered(self) -> bool:
        """Whether somebody has given the robots their order."""
        return True

    def _solution(self, outcome: Outcome, team: Team) -> Solution:
        return Solution.of(outcome, team)


def _refuse(unknown: Iterable[str]) -> None:
    """Raise `TypeError` for options that there are not."""
    for name in unknown:
        known = [one for one in inspect.signature(Solvable.solve).parameters if one not in {"self", "unknown"}]
        hint = did_you_mean(name, known, f"there are {', '.join(known)}")
        raise TypeError(f"solve() has no option {name!r}; {hint}")


def _with_team_names(options: Options, called: Mapping[str, str]) -> Options:
    """Return `options` with the names that robots have in the team. Raises `ValueError` for an unknown robot.

    Args:
        options: The options, with the user's names of robots.
        called: The names of robots in the team, by the user's names.
    """
    order = options.order
    if isinstance(order, tuple):
        for name in order:
            if name not in called:
                raise ValueError(f"order: there is no robot {name!r}; {did_you_mean(name, called, 'name all robots')}")
        order = tuple(called[name] for name in order)
    kill = tuple(one._replace(robot=called.get(one.robot, one.robot)) for one in options.kill)
    return replace(options, order=order, kill=kill)
