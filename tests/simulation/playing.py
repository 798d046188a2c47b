"""Plays a plan in virtual time, and examines the run: its answer, its journal, its repetition."""

from __future__ import annotations

import errno
import os
import signal
import threading
import traceback
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field, replace
from functools import partial
from types import FrameType

from robochoc.communication.processes.processes import BUSY_REPORTS_S
from robochoc.communication.search_result import RobotsLostError
from robochoc.formats.diagnostics import InvalidInputError
from robochoc.journal.journal import JournalError, JournalRecorder, read_journal
from robochoc.model.outcome import EpochOutcome, Metrics, Outcome
from robochoc.model.problem import ScenarioEvent, Team
from robochoc.model.team_edits import ChangeError
from robochoc.replay import replay
from robochoc.run import Runtime
from robochoc.run.compatibility.option_rules import refuse_options
from robochoc.run.orchestrator import prepare
from robochoc.run.recording import journal_header, objective_to_record
from robochoc.run.registry import protocol_named
from robochoc.solver.errors import UnsupportedError
from robochoc.verification.checker import RefutedError
from tests.simulation.clock import HangError, VirtualClock, virtual_time
from tests.simulation.invariants import Finding, is_limited, violated
from tests.simulation.plan import FaultKind, Plan
from tests.simulation.virtual_network import VirtualNetwork, solve_on_network, virtual_network
from tests.simulation.virtual_processes import virtual_processes
from tests.simulation.virtual_system import VirtualSystem
from tests.support.replays import identical

CPU_S = 120.0
"""CPU time after which a run counts as one that hangs without looking at the clock."""
_DEADLY: dict[Runtime, tuple[FaultKind, ...]] = {
    Runtime.SIMULATOR: (),
    Runtime.PROCESSES: (FaultKind.CRASH, FaultKind.STOP, FaultKind.GARBLE),
    Runtime.NETWORK: tuple(kind for kind in FaultKind if kind is not FaultKind.DISK),
}
"""Faults that may cause the loss of robots. In a network, whoever is slow may count as absent."""
NOT_A_RUN = (UnsupportedError, InvalidInputError, ChangeError)
"""Refusals: the parts of the plan cannot be combined."""


@dataclass
class Report:
    """The result of a plan.

    Attributes:
        findings: The properties that do not hold.
        refused: The reason why the run was refused; empty if it was not.
        runs: The number of runs played.
        messages: The number of protocol messages.
        robot_s: The virtual seconds, times the number of robots, of all runs.
        verdict: The verdict of the first run, or the class of the error.
    """

    findings: list[Finding] = field(default_factory=list)
    refused: str = ""
    runs: int = 0
    messages: int = 0
    robot_s: float = 0.0
    verdict: str = ""


class _Audience:
    """Receives published answers."""

    def __init__(self) -> None:
        self.published: list[tuple[str, str, float | None]] = []

    def improve(self, _team: Team, /, epoch: EpochOutcome, _withdrawn: Sequence[str]) -> None:
        """Note an answer. See `Audience`."""
        self.published.append((epoch.opened_by, str(epoch.verdict), float(epoch.cost or 0)))

    def has_news(self, _team: Team) -> bool:
        """See `Audience`."""
        return False


class Script:
    """An environment that returns the events of the plan's scenario, one after each answer of a whole team."""

    def __init__(self, plan: Plan) -> None:
        self._left = iter(plan.team.scenario)

    def __call__(self, _team: Team, epoch: EpochOutcome, _left_s: float | None) -> ScenarioEvent | None:
        """See `Environment`."""
        return None if epoch.lost else next(self._left, None)


class FullDisk:
    """A sink of a journal on a disk that is full after `size` bytes: a block may be written in part."""

    def __init__(self, size: int) -> None:
        self.content = b""
        self._size = size

    def write(self, block: bytes) -> None:
        """Write a block, as far as there is space. Raises `OSError`."""
        left = self._size - len(self.content)
        self.content += block[:left]
        if left < len(block):
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))


@dataclass
class _Played:
    outcome: Outcome | None
    error: str
    journal: bytes
    published: list[tuple[str, str, float | None]]
    spent_s: float

    @property
    def trace(self) -> tuple[object, ...]:
        """Everything that must be equal if the run is repeated."""
        return self.outcome, self.error, self.journal, self.published, self.spent_s


def _play(plan: Plan, *, disk: FullDisk | None = None) -> _Played:
    """Play the plan once. Raises the errors of `solve`, except for lost robots."""
    jumps = tuple((fault.at_s, fault.for_s) for fault in plan.faults if fault.kind is FaultKind.CLOCK)
    clock, audience = VirtualClock(plan.tick_s, jumps), _Audience()
    options = plan.options
    with _world(plan, clock) as network:
        outcome, error = None, ""
        team, chosen, run = plan.team, options, _solver_of(plan, network)
        if network is None:
            refuse_options(options, environment=plan.environment)
            script = Script(plan) if plan.environment else None
            team = replace(plan.team, scenario=()) if plan.environment else plan.team
            prepared = prepare(team, options, environment=plan.environment)
            team, chosen, run = prepared.team, prepared.choice.options, partial(prepared.solve, environment=script)
        sinks = [disk.write] if disk else []
        recorder = JournalRecorder(journal_header(team, chosen), objective_to_record(team, chosen), sinks=sinks)
        try:
            outcome = run(observer=recorder, audience=audience)
        except RobotsLostError as lost:
            error = str(lost)
        except RefutedError as refuted:
            if not plan.has(FaultKind.LIE):
                raise
            error = str(refuted)
        recorder.outcome = outcome
        journal = recorder.content() if disk is None else disk.content
        recorder.close()
    if outcome is not None:  # the memory is that of this process
        outcome = replace(outcome, metrics=replace(outcome.metrics, memory=0))
    return _Played(outcome, error, journal, audience.published, clock.now)


def _solver_of(plan: Plan, network: VirtualNetwork | None) -> Callable[..., Outcome]:
    """Return a function that solves the plan on the network."""

    def run(observer: JournalRecorder, audience: _Audience) -> Outcome:
        assert network is not None
        return solve_on_network(plan, network, observer, audience)

    return run


@contextmanager
def _world(plan: Plan, clock: VirtualClock) -> Iterator[VirtualNetwork | None]:
    """Let the program use the virtual time, and virtual processes or a network if the plan has any."""
    with virtual_time(clock, plan.seed):
        system = VirtualSystem(clock, plan.seed)
        match plan.options.runtime:
            case Runtime.PROCESSES:
                with virtual_processes(plan, system):
                    yield None
            case Runtime.NETWORK:
                network = VirtualNetwork(system, plan)
                with virtual_network(plan, network):
                    yield network
            case _:
                yield None


def examine(plan: Plan) -> Report:
    """Play the plan, and repeat it in part, and return what does not hold."""
    report = Report()
    try:
        with _cpu_time():
            _examine(plan, report)
    except NOT_A_RUN as refusal:
        report.refused = str(refusal)
    except HangError as hang:
        report.findings.append(Finding("hang", str(hang)))
    except KeyboardInterrupt:
        raise
    except BaseException as error:  # noqa: BLE001 - all else is what is looked for
        report.findings.append(Finding(_kind(error), "".join(traceback.format_exception(error))[-3000:]))
    return report


def _examine(plan: Plan, report: Report) -> None:
    first = _play(plan)
    report.runs, report.robot_s = 1, first.spent_s * len(plan.team.robots)
    metrics = first.outcome.metrics if first.outcome else Metrics()
    report.messages = sum(metrics.messages.values())
    report.verdict = str(first.outcome.verdict) if first.outcome else "robots lost"
    if first.outcome is None:
        if not (plan.has(*_DEADLY[plan.options.runtime]) or plan.options.kill or _is_too_slow(plan)):
            report.findings.append(Finding("lost", first.error))
    else:
        report.findings += violated(plan, first.outcome)
    report.findings += _of_journal(plan, first)
    report.findings += _of_repetition(plan, first, report)


def _is_too_slow(plan: Plan) -> bool:
    """Return whether a robot may compute for so long after a verdict that it is lost: it may have a few steps left."""
    return any(fault.kind is FaultKind.SLOW and fault.for_s > BUSY_REPORTS_S / 4 for fault in plan.faults)


def _of_journal(plan: Plan, played: _Played) -> Iterator[Finding]:
    """Yield whether the journal cannot be read, or is replayed differently."""
    journal = read_journal(played.journal)
    if played.outcome is None or plan.options.loss:  # journals do not record which messages were lost
        return
    if plan.options.runtime == Runtime.NETWORK:  # the master's journal does not contain the team
        return
    with virtual_time(VirtualClock(0.0), plan.seed):
        result = replay(journal)
    exact = plan.options.runtime == Runtime.SIMULATOR  # robots in processes may end in the middle of a step
    if result.steps and (result.differs or (exact and not identical(result))):
        yield Finding("replay", f"{result.difference} {result.contradictions} {result.stopped} {result.unfinished}")
    if exact and not result.steps and not result.decided_before:
        messages = sum(played.outcome.metrics.messages.values())
        if messages:
            yield Finding("replay", f"no step was replayed, although {messages} messages were sent")


def _of_repetition(plan: Plan, first: _Played, report: Report) -> Iterator[Finding]:
    """Yield whether the run differs when it is repeated: as it was, or with a full disk."""
    for fault in plan.faults:
        if fault.kind is FaultKind.DISK:
            disk = FullDisk(fault.size)
            other = _play(plan, disk=disk)
            report.runs += 1
            report.robot_s += other.spent_s * len(plan.team.robots)
            if not first.journal.startswith(disk.content):
                yield Finding("disk", "the part of the journal on the full disk is not its beginning")
            if not _same_answer(plan, first, other) and not is_limited(plan.options):  # the clock is read less often
                yield Finding("disk", f"{other.outcome} {other.error}, and not {first.outcome} {first.error}")
            with suppress(JournalError):
                read_journal(disk.content)
            return
    if plan.seed % 3 == 0:
        other = _play(plan)
        report.runs += 1
        report.robot_s += other.spent_s * len(plan.team.robots)
        if other.trace != first.trace:
            place = next(n for n, pair in enumerate(zip(other.trace, first.trace, strict=True)) if pair[0] != pair[1])
            what = ("outcome", "error", "journal", "published answers", "time")[place]
            yield Finding(
                "repetition", f"the {what} differs: {other.trace[place]!r:.1500} {first.trace[place]!r:.1500}"
            )


def _same_answer(plan: Plan, one: _Played, other: _Played) -> bool:
    """Return whether two runs have the same answer. In processes, the order of messages depends on the time."""
    if one.outcome is None or other.outcome is None:
        return one.error == other.error
    if plan.options.runtime == Runtime.SIMULATOR:
        return one.outcome.same_answer(other.outcome)
    complete = protocol_named(one.outcome.protocol).traits.complete
    return not complete or (one.outcome.verdict, one.outcome.cost) == (other.outcome.verdict, other.outcome.cost)


def _kind(error: BaseException) -> str:
    """Return the class of an error, and the function of the program in which it was raised."""
    frames = traceback.extract_tb(error.__traceback__)
    place = next((frame for frame in reversed(frames) if "/robochoc/" in frame.filename), frames[-1])
    return f"{type(error).__name__} in {place.filename.rpartition('/')[2]}:{place.name}"


@contextmanager
def _cpu_time() -> Iterator[None]:
    """Raise `HangError` after `CPU_S` seconds of CPU time, in the main thread."""

    def over(_signum: int, _frame: FrameType | None) -> None:
        raise HangError(f"more than {CPU_S:g} s of CPU time")

    if threading.current_thread() is not threading.main_thread():
        yield
        return
    before = signal.signal(signal.SIGPROF, over)
    signal.setitimer(signal.ITIMER_PROF, CPU_S)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0)
        signal.signal(signal.SIGPROF, before)
