"""Runtimes by name. Each runtime is a function that opens a session.

Each runtime is imported on first use: a run needs only one, and the network is an extra that the core does not require.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from importlib import import_module
from pkgutil import resolve_name
from types import MappingProxyType
from typing import TYPE_CHECKING, TypedDict, assert_never

from robochoc.communication.kill_schedule import KillSchedule
from robochoc.communication.search_result import Progress
from robochoc.communication.session import Session
from robochoc.journal.events import Observer
from robochoc.model.problem import ProblemKind
from robochoc.protocols.protocol import Protocol
from robochoc.protocols.settings import read_settings
from robochoc.protocols.shared.cycles import CycleCount
from robochoc.run.options import Options, Runtime, ScheduleName
from robochoc.solver.agent_problem import RunParameters
from robochoc.solver.compiled_team import CompiledTeam
from robochoc.solver.errors import UnsupportedError
from robochoc.system.lazy_dataclass import dataclass
from robochoc.system.posix import IS_POSIX, REQUIREMENT

if TYPE_CHECKING:
    from robochoc.communication.arrays.session import Layouts
    from robochoc.communication.simulator.losses import Losses
    from robochoc.communication.simulator.schedule import Schedule


ROBOT_CYCLES = 3_000
"""The product of robots and cycles from which arrays save more time than importing numpy takes."""


class CommonArguments(TypedDict):
    """The arguments common to the sessions of all runtimes."""

    parameters: RunParameters
    observer: Observer | None
    progress: Callable[[Progress], None] | None


@dataclass(frozen=True)
class SessionRequest:
    """The arguments with which a session is opened.

    Attributes:
        protocol: The protocol that the robots use.
        team: The team with its compiled domains.
        parameters: The parameters common to all robots.
        options: How to run.
        observer: Receives all events.
        progress: Receives the number of messages so far, from time to time.
        kills: The robots whose processes are to be killed.
        changes: True if the problem may change after the first search.
        deadline: The end of the run's time, on the monotonic clock. None: no limit.
        restarts: True if the search is restarted many times.
        layouts: The arrays of earlier sessions with the same team.
    """

    protocol: type[Protocol]
    team: CompiledTeam
    parameters: RunParameters
    options: Options
    observer: Observer | None = None
    progress: Callable[[Progress], None] | None = None
    kills: KillSchedule | None = None
    changes: bool = False
    deadline: float | None = None
    restarts: bool = False
    layouts: Layouts | None = None

    @property
    def common(self) -> CommonArguments:
        """The arguments common to the sessions of all runtimes."""
        return {"parameters": self.parameters, "observer": self.observer, "progress": self.progress}


OpenSession = Callable[[SessionRequest], Session]

OPENERS = MappingProxyType(
    {
        Runtime.PROCESSES: "robochoc.run.runtimes:open_processes",
        Runtime.SIMULATOR: "robochoc.run.runtimes:open_simulator",
        Runtime.NETWORK: "robochoc.run.networked.local_runtime:open_network",
        Runtime.ARRAYS: "robochoc.run.runtimes:open_arrays",
    }
)
"""The module and the name of each runtime's `OpenSession`."""


def open_session(request: SessionRequest) -> Session:
    """Open a session in the runtime that the options name. Raises `UnsupportedError` if it is not available."""
    name = request.options.runtime
    if name in {Runtime.PROCESSES, Runtime.NETWORK} and not IS_POSIX:
        raise UnsupportedError(f"--runtime {name} {REQUIREMENT}: use --runtime simulator")
    try:
        opener: OpenSession = resolve_name(OPENERS[name])
    except ModuleNotFoundError as absent:
        raise UnsupportedError(f"--runtime {name} requires {absent.name}: pip install 'robochoc[{name}]'") from None
    return opener(request)


def open_processes(request: SessionRequest) -> Session:
    """Open a session in which each robot is an OS process."""
    from robochoc.communication.processes.processes import ProcessesRun  # noqa: PLC0415 - one runtime is enough

    _import_tables(request)
    options = request.options
    session = ProcessesRun(
        request.team,
        request.protocol,
        survive=options.survives_losses,
        patience_s=options.patience,
        bounds=options.bounds,
        **request.common,
    )
    if request.kills:
        session.schedule_kills(request.kills, session.kill)
    return session


def _import_tables(request: SessionRequest) -> None:
    """Import the module for tables if robots need it, so that robots' processes need not import it."""
    costs = request.team.team.kind == ProblemKind.DISWCSP or request.parameters.withdrawal_cost is not None
    if costs and request.protocol.traits.tables:
        import_module("robochoc.solver.cost_table")


def open_simulator(request: SessionRequest) -> Session:
    """Open a session in which all robots run in one thread.

    Long runs of local search whose messages nobody observes are computed as arrays, with the same results and counts.
    """
    if not _is_for_arrays(request):
        return _simulation(request)
    from robochoc.communication.arrays.session import SimulatedArrays  # noqa: PLC0415 - start-up: numpy

    try:
        session = SimulatedArrays(
            request.team, request.protocol, deadline=request.deadline, layouts=request.layouts, **request.common
        )
    except UnsupportedError:
        return _simulation(request)
    session.simulate = partial(_simulation, request)
    return session


def _is_for_arrays(request: SessionRequest) -> bool:
    """Return whether arrays are faster for a run in the simulator, and have the same results."""
    options, parameters, protocol = request.options, request.parameters, request.protocol
    settings = read_settings(protocol, parameters.settings) if protocol.traits.arrays else None
    return (
        isinstance(settings, CycleCount)
        and (request.restarts or settings.cycles * len(request.team.team.robots) >= ROBOT_CYCLES)
        and request.observer is None
        and not request.changes
        and options.schedule == ScheduleName.CONCURRENT
        and not (options.delay or options.channel or options.loss)
        and (options.messages, options.ncccs, options.cycles, parameters.withdrawal_cost) == (None, None, None, None)
    )


def _simulation(request: SessionRequest) -> Session:
    """Open a session that simulates every message."""
    from robochoc.communication.simulator.simulator import (  # noqa: PLC0415 - as above
        EffortLimits,
        Simulation,
    )

    options = request.options
    limits = EffortLimits(options.ncccs, options.cycles)
    return Simulation(
        request.team,
        request.protocol,
        _schedule_of(options),
        limits=limits,
        deadline=request.deadline,
        bounds=options.bounds,
        losses=_losses_of(options),
        **request.common,
    )


def _losses_of(options: Options) -> Losses | None:
    """Return the object that determines lost messages, from the option or the channel model; None without losses."""
    from robochoc.communication.simulator.losses import Losses  # noqa: PLC0415 - one runtime is enough

    if options.message_loss or not options.loss or options.channel is None:
        return Losses(options.loss, options.seed) if options.loss else None
    from robochoc.communication.simulator.channel_losses import ChannelLosses  # noqa: PLC0415 - start-up: rarely needed

    return ChannelLosses(options.channel, options.seed)


def open_arrays(request: SessionRequest) -> Session:
    """Open a session in which all robots are rows in arrays."""
    from robochoc.communication.arrays.session import ArraysRun  # noqa: PLC0415 - one runtime is enough

    cluster = request.options.cluster
    if cluster is not None and request.observer is not None:
        raise UnsupportedError("an observer cannot be used with --cluster: remove one of them")
    return ArraysRun(
        request.team,
        request.protocol,
        deadline=request.deadline,
        cluster=cluster,
        layouts=request.layouts,
        **request.common,
    )


def _schedule_of(options: Options) -> Schedule:
    """Return the simulator's schedule selected by `options`."""
    if options.channel:
        from robochoc.communication.simulator.timed import Timed  # noqa: PLC0415 - start-up: rarely needed

        return Timed(options.seed, options.channel)
    from robochoc.communication.simulator.schedule import (  # noqa: PLC0415 - the simulator's
        Concurrent,
        Cycles,
        RandomChannels,
    )

    match options.schedule:
        case ScheduleName.CONCURRENT:
            return Concurrent(options.seed, options.delay)
        case ScheduleName.CYCLES:
            return Cycles(options.seed)
        case ScheduleName.ONE_BY_ONE:
            return Concurrent(options.seed, options.delay, one_by_one=True)
        case ScheduleName.RANDOM:
            return RandomChannels(options.seed)
        case never:
            assert_never(never)
