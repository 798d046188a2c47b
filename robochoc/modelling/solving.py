"""`solve`, for problems from files and from Python: the options of a run, with hints for invalid options."""

from __future__ import annotations

import inspect
import threading
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import fields, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Never

from robochoc.journal.events import Observer, combined
from robochoc.model.outcome import Answer, Outcome
from robochoc.model.policies import Risk
from robochoc.model.problem import Team
from robochoc.modelling.option_names import errors_in_python, in_python
from robochoc.modelling.solution import Solution
from robochoc.modelling.start_values import start_values
from robochoc.run.compatibility.option_rules import refuse_options
from robochoc.run.defaults import AUTO
from robochoc.run.options import AnswerRule, CentralSolverName, Options, Runtime, ScheduleName
from robochoc.run.orchestrator import PreparedRun, prepare
from robochoc.run.scenario import Environment
from robochoc.solver.agent_problem import StartValues
from robochoc.solver.compile import CompileLimits
from robochoc.system.errors import OptionError, OptionTypeError
from robochoc.system.stopping import stopped_by
from robochoc.system.suggestions import did_you_mean

if TYPE_CHECKING:
    from robochoc.communication.kill_schedule import Kill
    from robochoc.communication.search_result import Progress
    from robochoc.communication.simulator.channel import ChannelModel
    from robochoc.protocols.protocol import Protocol
    from robochoc.solver.ace import AceProcess

NO_LIMITS = CompileLimits()
"""The default limits on the compilation of domains."""
_OF_OTHER_SOLVERS = {
    "time_limit": "timeout",
    "max_time_in_seconds": "timeout",
    "random_seed": "seed",
    "solver": "central_with",
    "solution_callback": "observer",
    "callback": "observer",
    "log_search_progress": "progress",
}
"""The arguments that correspond to options of CPMpy and OR-Tools."""
_OPTIONS = frozenset(one.name for one in fields(Options))


class Solvable(ABC):
    """A problem that a team of robots can solve: the base class of `Problem` and `Model`."""

    _solver: AceProcess | None = None
    """A running constraint solver for several searches. None: each search starts its own."""

    def solve(  # noqa: PLR0913 - options of a run, by their names
        self,
        protocol: str | type[Protocol] | None = None,
        runtime: str = Runtime.SIMULATOR,
        *,
        order: str | Sequence[str] | None = None,
        withdraw: str | bool | None = None,
        settings: Mapping[str, object] = {},
        start: Mapping[Any, object] | Outcome | None = None,
        cold: bool = False,
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
        central_with: str = CentralSolverName.AUTO,
        cache: bool = True,
        local: CompileLimits = NO_LIMITS,
        schedule: str = ScheduleName.CONCURRENT,
        delay: int = 0,
        channel: ChannelModel | None = None,
        message_loss: float = 0.0,
        on_loss: str | None = None,
        spares: int = 0,
        patience: float | None = None,
        kill: Sequence[Kill] = (),
        standby: int = 0,
        filters: Sequence[str] = (),
        bounds: bool = False,
        preprocess: str | None = None,
        answer: str = AnswerRule.BEST,
        repair: bool = True,
        risk: str = Risk.EXPECTED,
        samples: int | None = None,
        objectives: str | None = None,
        refine: float | None = None,
        cluster: str | None = None,
        journal: Path | str | None = None,
        html: Path | str | None = None,
        progress: Callable[[Progress], None] | None = None,
        stop: threading.Event | None = None,
        **unknown: Never,
    ) -> Solution:
        """Let the robots solve the problem together.

        The simulator runs all robots in the calling thread. With `runtime="processes"` each robot runs in its own
        process, as on the command line. With `runtime="network"`, each process imports the main program, which must
        therefore call this method below `if __name__ == "__main__":`.

        Args:
            protocol: The name of the protocol, in upper or lower case, or its class. None, or `auto`: a protocol that
                suits the problem is chosen.
            runtime: `simulator`, `processes`, `network` or `arrays`.
            order: The name of a priority order, such as `dom-deg`, or the names of all robots, the highest priority
                first. `given`: the team's order. None: if the protocol is chosen automatically, an order that suits the
                protocol; otherwise the team's order, or `max-degree` if the team has none.
            withdraw: The rule by which robots withdraw if the whole team has no solution: `minimum` (or True) or
                `maximal`. None, or False: no robot withdraws.
            settings: Settings of the protocol, by name.
            start: The assignment from which the robots begin: the values of some or all variables, or an earlier
                solution. If it is a solution, complete protocols search only for lower costs. None: no assignment.
            cold: True if, after a change of the problem, the robots do not begin from the last assignment.
            observer: Called with every event of the run.
            environment: A function that is called with each answer, and returns the next changes of the problem.
            seed: The seed of the simulator, of the order `random`, and of randomised protocols.
            timeout: A limit on wall-clock time, in seconds. None: no limit.
            deadline: A time limit in seconds, at which the best assignment known so far becomes the answer.
            improve: The number of seconds after the deadline in which robots search for better assignments. None: they
                stop at the deadline.
            messages: A limit on the number of messages. None: no limit.
            ncccs: A limit on non-concurrent constraint checks, for the simulator. None: no limit.
            cycles: A limit on cycles, with the schedule `cycles`. None: no limit.
            verify: True if central solvers check a `no-solution` or a minimum cost found by others.
            count: True to count: the protocol `central` counts all solutions, and `count-dpop` counts all optima.
            central_with: The solver of the protocol `central`: `auto`, `ace`, `ortools`, `toulbar2` or
                `cosoco`.
            cache: True if solutions of local problems are stored in the user's cache folder.
            local: Limits on the compilation of each robot's domain.
            schedule: How the simulator orders events: `concurrent`, `one-by-one`, `cycles` or `random`.
            delay: The maximum delay of a message in the simulator, in constraint checks.
            channel: A channel model, with which the simulator measures time as the seconds spent on computation and
                radio.
            message_loss: The probability that a message is lost for good, without a retransmission.
            on_loss: The reaction to the loss of a robot: `fail` or `withdraw`. None: the run fails, unless there are
                `spares`.
            spares: The number of lost robots that are replaced.
            patience: A robot whose process is suspended for this many seconds counts as lost. None: never.
            kill: The robots whose processes are killed, with the times; with `standby`, also `MASTER`.
            standby: With `runtime="network"`: the number of standby masters, which take over if the first master dies.
            filters: The names of the channel filters for messages on a network, in the order of application.
            bounds: True if events report the proven lower bound of the cost (with processes and in the simulator).
            preprocess: The preprocessing before the protocol: `ac` makes domains arc consistent. None: no
                preprocessing.
            answer: The answer of a search that proves nothing: `best`, the cheapest assignment found, or `final`, the
                robots' last values.
            repair: True if a local search repairs the assignment of an incomplete protocol that has ended with violated
                hard constraints, unless the answer is `final` or there are limits other than on time.
            risk: The minimised cost of a problem with random variables: `expected`, or `worst` of all scenarios.
            samples: The number of samples that replace an expectation over more joint outcomes of random variables.
                None: 1,000 samples for more than 4,096 outcomes.
            objectives: The treatment of several objectives: `weighted:NAME=WEIGHT,...`, `lexicographic:NAME,...` or
                `pareto`. None: `pareto`, if there are several.
            refine: The step of the finest grids of real variables, in their unit. None: their precision; infinite: the
                grids of the files are not refined.
            cluster: With arrays: the address of a Dask scheduler, or the path of its file. Its workers compute the run.
                None: this process does.
            journal: The file to which the journal of the run is written: all messages and decisions.
            html: The file to which the page with the scene of the drones' flight is written.
            progress: Called with the number of messages and the elapsed time, about ten times a second.
            stop: An event that another thread sets to end the search. The answer is then the best assignment known. The
                central solver ignores this event.
            **unknown: Any other option is an error.

        Returns:
            The solution: a verdict, the values, their cost, and the metrics of the run.

        Raises:
            UnsupportedError: if problem, protocol, runtime and options cannot be combined.
            RobotsLostError: if robots were lost, and the options do not allow the run to continue without them.
            RefutedError: if the checker finds the answer wrong.
            OptionError: if an option is unknown, or its value is not allowed.

        Example:
            >>> import robochoc
            >>> problem = robochoc.load("instances/queens3d-4")
            >>> outcome = problem.solve("abt", runtime="simulator", withdraw="minimum")
            >>> len(outcome.assignment)
            10
        """
        given = {name: value for name, value in locals().items() if name in _OPTIONS}
        _refuse(unknown)
        _refuse_types(stop, progress, observer)
        team = self._team_to_solve()
        given["start"] = self._start_values(start, team)
        with errors_in_python(ARGUMENTS), stopped_by(stop):
            options = _with_team_names(Options(**given | {"protocol": protocol or AUTO}), self._robots_called(team))
            refuse_options(options, environment=environment is not None)
            run = prepare(team, options, environment=environment is not None, ordered=self._is_ordered)
            outcome = _solve_recorded(run, journal, observer, progress, environment, self._solver)
        solution = self._solution(_texts_in_python(outcome), team)
        if html is not None:
            solution.scene().save(html)
        return solution

    async def solve_async(self, *arguments: Any, **options: Any) -> Solution:  # noqa: ANN401 - those of `solve`
        """Solve the problem in a thread while other asyncio tasks run. If this task is cancelled, the search ends.

        Args:
            *arguments: The arguments of `solve`.
            **options: The options of `solve`, except `stop`.

        Returns:
            The solution, as from `solve`. Raises the same exceptions.
        """
        import asyncio  # noqa: PLC0415 - start-up

        stop = threading.Event()
        running = asyncio.create_task(asyncio.to_thread(self.solve, *arguments, **options, stop=stop))
        try:
            return await asyncio.shield(running)
        except asyncio.CancelledError:
            stop.set()
            await asyncio.wait([running])
            raise

    def _repr_html_(self) -> str:
        from robochoc.modelling.team_html import team_html  # noqa: PLC0415 - notebooks only

        return team_html(self._team_to_solve())

    @abstractmethod
    def _team_to_solve(self) -> Team:
        """Return the team that solves this problem."""

    def _robots_called(self, team: Team) -> Mapping[str, str]:
        """Return the names of the robots in `team`, by the names that the user gave them."""
        return {name: name for name in team.order}

    def _start_values(self, start: object, team: Team) -> StartValues:
        """Return the argument `start` as start values of `team`. Raises `OptionError`."""
        return start_values(start, team, {}, {}, lambda name: name)

    @property
    def _is_ordered(self) -> bool:
        """True if the user determined the priority order."""
        return True

    def _solution(self, outcome: Outcome, team: Team) -> Solution:
        return Solution.of(outcome, team)


def _texts_in_python(outcome: Outcome) -> Outcome:
    """Return `outcome` with arguments instead of options in its texts."""

    def reason(answer: Answer) -> str | None:
        return answer.reason and in_python(answer.reason, ARGUMENTS)

    epochs = tuple(replace(one, reason=reason(one)) for one in outcome.epochs)
    chosen = {name: in_python(why, ARGUMENTS) for name, why in outcome.chosen.items()}
    return replace(outcome, reason=reason(outcome), epochs=epochs, chosen=chosen)


def _solve_recorded(
    run: PreparedRun,
    journal: Path | str | None,
    observer: Observer | None,
    progress: Callable[[Progress], None] | None,
    environment: Environment | None,
    solver: AceProcess | None,
) -> Outcome:
    """Run the search, with a journal if there is a path for it. Raises `OSError` if the journal cannot be written."""
    if journal is None:
        return run.solve(observer=observer, progress=progress, solver=solver, environment=environment)
    from robochoc.journal.recorder import recorded  # noqa: PLC0415 - start-up: seldom used
    from robochoc.run.recording import journal_header, objective_to_record  # noqa: PLC0415 - start-up: seldom used

    options = run.choice.options
    objective = None if environment else objective_to_record(run.team, options)  # otherwise the problem changes
    with recorded(Path(journal), journal_header(run.team, options), objective) as recorder:
        observers = combined(observer, recorder)
        outcome = run.solve(observer=observers, progress=progress, solver=solver, environment=environment)
        recorder.outcome = outcome
    for failure in recorder.failures:
        raise failure
    return outcome


def _refuse(unknown: Iterable[str]) -> None:
    """Raise `OptionTypeError` for unknown options."""
    for name in unknown:
        listed = f"its options: {', '.join(sorted(ARGUMENTS))}"
        ours = _OF_OTHER_SOLVERS.get(name)
        hint = f"did you mean {ours!r}?" if ours else did_you_mean(name, ARGUMENTS, listed)
        raise OptionTypeError(f"solve() has no option {name!r}; {hint}")


def _refuse_types(stop: object, progress: object, observer: object) -> None:
    """Raise `OptionTypeError` for callbacks that are not callable."""
    if stop is not None and not callable(getattr(stop, "is_set", None)):
        raise OptionTypeError(f"stop={stop!r} is not allowed; expected a threading.Event, which another thread sets")
    for name, given in (("progress", progress), ("observer", observer)):
        if given is not None and not callable(given):
            raise OptionTypeError(f"{name}={given!r} is not allowed; expected a function")


def _with_team_names(options: Options, called: Mapping[str, str]) -> Options:
    """Return `options` with the robots' names in the team. Raises `OptionError` for an unknown robot.

    Args:
        options: The options, with the user's names of robots.
        called: The names of robots in the team, by the user's names.
    """
    order = options.order
    if isinstance(order, tuple):
        for name in order:
            if name not in called:
                raise OptionError(f"order: there is no robot {name!r}; {did_you_mean(name, called, 'name all robots')}")
        order = tuple(called[name] for name in order)
    kill = tuple(one._replace(robot=called.get(one.robot, one.robot)) for one in options.kill)
    return replace(options, order=order, kill=kill)


ARGUMENTS = frozenset(inspect.signature(Solvable.solve).parameters) - {"self", "unknown"}
"""The names of the arguments of `solve`."""
