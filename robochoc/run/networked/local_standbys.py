"""A team on this machine with standby masters: `--runtime network --standby N`.

Each robot and each master has its own process, connected by zenoh and mutual TLS. If the leading master is killed
(`--kill MASTER@SECONDS`), the next one takes over, as across machines (docs/guides/several-machines.md). This process
only starts the others, and receives the outcome. Certificates are created for this run, and exist only in memory.
"""

from __future__ import annotations

import logging
import os
import random
import socket
import time
from contextlib import suppress
from dataclasses import replace
from multiprocessing.connection import Connection, wait
from multiprocessing.process import BaseProcess
from pathlib import Path
from typing import Any, NamedTuple, cast

from robochoc.authority.admission import InMemoryAuthority
from robochoc.authority.identity import Identity, IdentityTexts
from robochoc.authority.registry import Role
from robochoc.communication.main_guard import require_main_guard
from robochoc.communication.network.control_messages import StandbyAnswer
from robochoc.communication.network.local import LOOPBACK, start_fork_server
from robochoc.communication.network.robot_process import (
    START_S,
    NetworkRobotStart,
    end_with_the_parent,
    network_robot_process,
)
from robochoc.communication.network.settings import LEASE_MS, PATIENCE_S, NetworkSettings
from robochoc.communication.search_result import Progress, RobotsLostError
from robochoc.journal.events import AnyEvent, Leads
from robochoc.model.orders import with_order
from robochoc.model.outcome import Outcome, Verdict
from robochoc.model.problem import Team
from robochoc.run.context import RunContext
from robochoc.run.defaults import MASTER, standby_names
from robochoc.run.networked.address import Address
from robochoc.run.networked.join import PATIENCE_S as LOOKING_S
from robochoc.run.networked.master_run import SHARED, MasterPlan, run_master
from robochoc.run.networked.standby import RunOverElsewhereError, StandbyPlan
from robochoc.run.options import Options
from robochoc.run.registry import protocol_named, protocol_or_stage
from robochoc.solver.compile import CompileTimeoutError, TeamCompileTimeoutError
from robochoc.solver.compiled_domain import TooManySolutionsError
from robochoc.solver.compiled_team import CompiledTeam
from robochoc.solver.errors import UnsupportedError
from robochoc.system.errors import RobochocError
from robochoc.system.plain_text import on_one_line
from robochoc.system.signals import signals_delayed
from robochoc.system.stopping import STOP, stop_handled, stop_requested
from robochoc.verification.checker import RefutedError, violations

_PORTS = range(20_000, 32_000)
"""The ports of masters. Systems use larger ones for outgoing connections, so these are still free at a takeover."""
_ATTEMPTS = 100
_TICK_S = 0.2
_GRACE_S = 5.0
"""The time for processes to end by themselves after the run, in seconds."""


class NoDecisionError(RobotsLostError):
    """Raised if no master has published a decision. `why`: the reason of each master."""

    def __init__(self, why: str) -> None:
        super().__init__({MASTER: why})
        self.args = (why,)


class _MasterStart(NamedTuple):
    """The arguments with which a master's process starts: see `MasterPlan` for `fields`."""

    place: Address
    leaders: tuple[Address, ...]
    identity: IdentityTexts
    known: StandbyAnswer
    fields: dict[str, Any]
    shows_progress: bool


class _Failed(NamedTuple):
    """The reason why a master has not published a decision."""

    why: str
    unsupported: bool


_Report = Leads | Progress | Outcome | _Failed | None
"""A report of a master's process; None: another master has ended the run."""


def solve_with_standbys(team: Team, context: RunContext, header: Outcome) -> Outcome:
    """Return the outcome of `header`'s run, found by the robots of `team` and the masters on this machine.

    Raises:
        NoDecisionError: if no master has published a decision.
        RefutedError: if the decision violates a constraint.
        UnsupportedError: if the options cannot be combined with the team, or a master cannot listen.
    """
    options = context.options
    if context.observer is not None:
        raise UnsupportedError("--standby cannot be used with a journal or an observer: remove one of them")
    names = standby_names(options.standby)
    if taken := sorted({MASTER, *names} & set(team.order)):
        raise UnsupportedError(f"{team.name} has a robot called {taken[0]}, as a master of --standby: rename the robot")
    require_main_guard()
    try:
        compiled = context.team_compiler().compile(with_order(team, options.order, options.seed), every=True)
    except (TooManySolutionsError, CompileTimeoutError, TeamCompileTimeoutError) as limit:
        return replace(header, reason=str(limit))
    site = _Site(compiled, names, options)
    try:
        outcome = site.run(context)
        site.wait()
    finally:
        site.close()
    context.kills.warn_of_pending()
    known = ("order", "chosen", "symbols", "symbolic", "real_places")
    outcome = replace(outcome, **{name: getattr(header, name) for name in known})
    if outcome.verdict in {Verdict.SOLUTION, Verdict.OPTIMAL}:
        wrong = next(violations(compiled.team, outcome.assignment, {*outcome.withdrawn, *outcome.lost}), None)
        if wrong:
            raise RefutedError(f"the answer for {team.name} is wrong: {wrong}")
    return outcome


class _Site:
    """The processes of the masters and robots."""

    def __init__(self, compiled: CompiledTeam, names: tuple[str, ...], options: Options) -> None:
        self._compiled = compiled
        self._options = options
        self._authority = InMemoryAuthority(compiled.team.order)
        self._names = (MASTER, *names)
        self._places = _free_places(len(self._names))
        self._context = start_fork_server(protocol_named(options.protocol))
        self._processes: dict[str, BaseProcess] = {}
        self._reports: dict[str, Connection] = {}
        self._unstopped = ""
        """The leading master, if it has not received a stop request; empty: none."""

    def run(self, context: RunContext) -> Outcome:
        """Start all processes, and return the decision of a master. Raises `NoDecisionError`, `UnsupportedError`."""
        self._start_all(shows_progress=context.progress is not None)
        show = context.progress or (lambda _progress: None)
        failed: dict[str, _Failed] = {}
        while self._reports:
            for name, report in self._next_reports():
                match report:
                    case Leads(master, term, why):
                        self._unstopped = name
                        context.kills.start(time.monotonic())
                        _log(f"{master} leads in term {term}: {why}")
                    case Progress():
                        show(report)
                    case Outcome():
                        context.kills.end(time.monotonic())
                        return report
                    case _Failed():
                        failed[name] = report
                    case None:
                        pass
            for name in context.kills.due(time.monotonic()):
                _log(f"{name} is killed")
                self._processes[name].kill()
            self._stop_on_request()
        causes = {name: one.why for name, one in failed.items()} | self._failed_processes()
        why = "; ".join(f"{name}: {cause}" for name, cause in causes.items())
        refusal = UnsupportedError if any(one.unsupported for one in failed.values()) else NoDecisionError
        raise refusal(f"all masters have ended: {why}")

    def _start_all(self, *, shows_progress: bool) -> None:
        for rank, name in enumerate(self._names):
            self._start_master(rank, name, shows_progress=shows_progress)
        first, *others = map(str, self._places)
        for own in self._compiled.robots.values():
            name = own.robot.name
            texts = self._authority.identity(name).texts
            start = NetworkRobotStart(own, texts, first, protocol_or_stage, LOOKING_S, LEASE_MS, tuple(others))
            self._start(name, network_robot_process, start)

    def _stop_on_request(self) -> None:
        """If a stop was requested, let the leading master end the search with the best answer."""
        if not self._unstopped or not stop_requested():
            return
        pid, self._unstopped = self._processes[self._unstopped].pid, ""
        if STOP and pid is not None:
            with suppress(ProcessLookupError):
                os.kill(pid, STOP)

    def _failed_processes(self) -> dict[str, str]:
        """Return how the processes of masters that failed have ended. They have closed their pipes."""
        causes = {}
        for name in self._names:
            process = self._processes[name]
            process.join(_GRACE_S)
            code = process.exitcode
            if code:
                causes[name] = (
                    f"its process was ended by signal {-code}" if code < 0 else f"it ended with status {code}"
                )
        return causes

    def _start_master(self, rank: int, name: str, *, shows_progress: bool) -> None:
        authority, hosts = self._authority, (LOOPBACK,)
        identity = authority.standby_identity(name, hosts) if rank else authority.master_identity(hosts)
        roles = {str(Role.ROBOT): self._compiled.team.order, str(Role.MASTER): self._names, str(Role.OBSERVER): ()}
        receiver, sender = self._context.Pipe(duplex=False)
        start = _MasterStart(
            self._places[rank],
            self._places[:rank],
            identity.texts,
            StandbyAnswer(roles, ()),
            plan_fields(self._compiled.team, self._options),
            shows_progress,
        )
        self._start(name, _master_process, start, sender)
        sender.close()
        self._reports[name] = receiver

    def _start(self, name: str, target: object, *given: object) -> None:
        process = self._context.Process(target=target, name=name, args=given, daemon=True)  # type: ignore[arg-type]
        with signals_delayed():  # see `LocalNetwork`
            process.start()
            self._processes[name] = process

    def _next_reports(self) -> list[tuple[str, _Report]]:
        """Wait a short time, and return the reports of masters. Masters that have ended are removed."""
        found: list[tuple[str, _Report]] = []
        ready = wait(list(self._reports.values()), _TICK_S)
        for name, connection in list(self._reports.items()):
            if connection in ready:
                try:
                    found.append((name, cast("_Report", connection.recv())))
                except (EOFError, OSError):
                    del self._reports[name]
                    connection.close()
        return found

    def wait(self) -> None:
        """Wait a short time until all processes have ended after a decision."""
        until = time.monotonic() + _GRACE_S
        for process in self._processes.values():
            process.join(max(0.0, until - time.monotonic()))

    def close(self) -> None:
        """Kill all processes that have not ended."""
        with signals_delayed():
            for process in self._processes.values():
                process.kill()
                process.join()
                process.close()
            for connection in self._reports.values():
                connection.close()


def plan_fields(team: Team, options: Options) -> dict[str, Any]:
    """Return the fields of `MasterPlan` that all masters have in common."""
    conditions = NetworkSettings(
        filters=options.filters,
        patience_s=options.patience or PATIENCE_S,
        survive=options.survives_losses,
    )
    return {
        **{name: getattr(options, name) for name in SHARED},
        "protocol": options.protocol,
        "settings": dict(options.settings),
        "conditions": conditions,
        "name": team.name,
        "names": team.order,
        "gather_s": START_S,
    }


def _master_process(start: _MasterStart, reports: Connection) -> None:
    """Run one master in this process, and report its elections and its result."""
    end_with_the_parent()

    def observe(event: AnyEvent) -> None:
        if isinstance(event, Leads):
            reports.send(event)

    progress = reports.send if start.shows_progress else None
    standby = StandbyPlan(start.leaders, Identity.from_texts(start.identity), start.known)
    plan = MasterPlan(Path(), start.place, standby=standby, **start.fields)
    with suppress(BrokenPipeError):  # the run is over
        try:
            with stop_handled():
                reports.send(run_master(plan, observer=observe, progress=progress).outcome)
        except RunOverElsewhereError:
            reports.send(None)
        except RobochocError as error:
            reports.send(_Failed(str(error), isinstance(error, UnsupportedError)))


def _free_places(number: int) -> tuple[Address, ...]:
    """Return free addresses of this machine. Raises `UnsupportedError` if there are none."""
    found: list[Address] = []
    chance = random.SystemRandom()
    for _ in range(_ATTEMPTS):
        place = Address(LOOPBACK, chance.choice(_PORTS))
        with suppress(OSError), socket.create_server(place):
            found += [] if place in found else [place]
        if len(found) == number:
            return tuple(found)
    raise UnsupportedError(f"no free ports from {_PORTS.start} to {_PORTS.stop}: end other programs that listen there")


def _log(text: str) -> None:
    logging.getLogger("robochoc").warning("%s", on_one_line(text))
