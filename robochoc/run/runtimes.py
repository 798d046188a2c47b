"""The three runtimes: a session for a protocol and a team in the one that the options ask for.

Each is imported when it is asked for: a run needs one of them.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, TypedDict, assert_never

from robochoc.communication.kill_schedule import KillSchedule
from robochoc.communication.run_result import Progress
from robochoc.communication.session import Session
from robochoc.journal.events import Observer
from robochoc.protocols.protocol import Protocol
from robochoc.run.options import Options, Runtime, ScheduleName
from robochoc.solver.agent_problem import RunParameters
from robochoc.solver.compiled_team import CompiledTeam
from robochoc.solver.encoding import UnsupportedError

if TYPE_CHECKING:
    from robochoc.communication.simulator.schedule import Schedule


class _Rest(TypedDict):
    brief: RunParameters
    observer: Observer | None
    progress: Callable[[Progress], None] | None


def open_session(
    protocol: type[Protocol],
    team: CompiledTeam,
    brief: RunParameters,
    options: Options,
    observer: Observer | None,
    progress: Callable[[Progress], None] | None,
    kills: KillSchedule | None = None,
) -> Session:
    """Return a session of `protocol` in the runtime of `options`.

    Raises `UnsupportedError` when it is not installed.
    """
    rest: _Rest = {"brief": brief, "observer": observer, "progress": progress}
    match options.runtime:
        case Runtime.PROCESSES:
            from robochoc.communication.processes.processes import ProcessesRun  # noqa: PLC0415 - one runtime is enough

            survive = options.survives_losses
            run = ProcessesRun(team, protocol, survive=survive, patience_s=options.patience, **rest)
            if kills:
                run.schedule_kills(kills, run.kill)
            return run
        case Runtime.SIMULATOR:
            from robochoc.communication.simulator.simulator import Simulation  # noqa: PLC0415 - one runtime is enough

            return Simulation(team, protocol, schedule_of(options), **rest)
        case Runtime.NETWORK:
            return _network(protocol, team, options, kills, rest)
        case never:
            assert_never(never)


def _network(
    protocol: type[Protocol], team: CompiledTeam, options: Options, kills: KillSchedule | None, rest: _Rest
) -> Session:
    try:
        from robochoc.communication.network.local import LocalNetwork  # noqa: PLC0415 - and it is an extra
        from robochoc.communication.network.settings import PATIENCE_S, NetworkSettings  # noqa: PLC0415 - as above
    except ModuleNotFoundError as missing:
        raise UnsupportedError(
            f"--runtime network needs {missing.name}; say: pip install 'robochoc[network]'"
        ) from None
    survive, patience_s = options.survives_losses, options.patience or PATIENCE_S
    settings = NetworkSettings(filters=options.filters, survive=survive, patience_s=patience_s)
    network = LocalNetwork(team, protocol, settings=settings, **rest)
    if kills:
        network.master.schedule_kills(kills, network.kill)
    return network


def schedule_of(options: Options) -> Schedule:
    """Return the simulator's schedule that `options` ask for."""
    if options.channel:
        from robochoc.communication.simulator.timed import Timed  # noqa: PLC0415 - start-up: seldom asked for

        return Timed(options.seed, options.channel)
    from robochoc.communication.simulator.schedule import Concurrent, RandomChannels  # noqa: PLC0415 - start-up: the simulator's

    match options.schedule:
        case ScheduleName.CONCURRENT:
            return Concurrent(options.seed, options.delay)
        case ScheduleName.RANDOM:
            return RandomChannels(options.seed)
        case never:
            assert_never(never)
