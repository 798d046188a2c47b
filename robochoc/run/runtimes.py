"""Runtimes by name, as installed packages offer them under the entry point group `robochoc.runtimes`.

What is offered is a function that opens a session (`OpenSession`). It is imported when it is asked for: a run needs one
runtime.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, TypedDict, assert_never, cast

from robochoc.communication.run_result import Progress
from robochoc.communication.session import Session
from robochoc.journal.events import Observer
from robochoc.protocols.protocol import Protocol
from robochoc.run.options import Options, ScheduleName
from robochoc.solver.agent_problem import RunParameters
from robochoc.solver.compiled_team import CompiledTeam
from robochoc.solver.encoding import UnsupportedError
from robochoc.system.installed import missing, named

if TYPE_CHECKING:
    from robochoc.communication.simulator.schedule import Schedule

GROUP = "robochoc.runtimes"


class CommonArguments(TypedDict):
    """The arguments that the sessions of all runtimes take."""

    brief: RunParameters
    observer: Observer | None
    progress: Callable[[Progress], None] | None


@dataclass(frozen=True)
class SessionRequest:
    """What a session is opened for.

    Attributes:
        protocol: The protocol by which the robots search.
        team: The team with its compiled domains.
        parameters: What all robots are given beside the problem.
        options: How to run.
        observer: Gets all events.
        progress: Gets the number of messages so far, now and then.
    """

    protocol: type[Protocol]
    team: CompiledTeam
    parameters: RunParameters
    options: Options
    observer: Observer | None = None
    progress: Callable[[Progress], None] | None = None

    @property
    def common(self) -> CommonArguments:
        """The arguments that the sessions of all runtimes take."""
        return {"brief": self.parameters, "observer": self.observer, "progress": self.progress}


OpenSession = Callable[[SessionRequest], Session]


def open_session(request: SessionRequest) -> Session:
    """Return a session in the runtime that the options name. Raises `UnsupportedError` when it is not installed."""
    name = str(request.options.runtime)
    entries = named(GROUP, name)
    if not entries:
        raise UnsupportedError(missing(GROUP, "runtime", name))
    try:
        opener = cast("OpenSession", entries[0].load())
    except ModuleNotFoundError as absent:
        raise UnsupportedError(f"--runtime {name} needs {absent.name}; say: pip install 'robochoc[{name}]'") from None
    return opener(request)


def open_processes(request: SessionRequest) -> Session:
    """Open a session in which each robot is an OS process."""
    from robochoc.communication.processes.processes import ProcessesRun  # noqa: PLC0415 - one runtime is enough

    options = request.options
    return ProcessesRun(
        request.team,
        request.protocol,
        survive=options.survives_losses,
        patience_s=options.patience,
        **request.common,
    )


def open_simulator(request: SessionRequest) -> Session:
    """Open a session in which all robots live in one thread."""
    from robochoc.communication.simulator.simulator import Simulation  # noqa: PLC0415 - one runtime is enough

    return Simulation(request.team, request.protocol, _schedule_of(request.options), **request.common)


def _schedule_of(options: Options) -> Schedule:
    """Return the simulator's schedule that `options` ask for."""
    if options.channel:
        from robochoc.communication.simulator.timed import Timed  # noqa: PLC0415 - start-up: seldom asked for

        return Timed(options.seed, options.channel)
    from robochoc.communication.simulator.schedule import Concurrent, RandomChannels  # noqa: PLC0415 - the simulator's

    match options.schedule:
        case ScheduleName.CONCURRENT:
            return Concurrent(options.seed, options.delay)
        case ScheduleName.RANDOM:
            return RandomChannels(options.seed)
        case never:
            assert_never(never)
