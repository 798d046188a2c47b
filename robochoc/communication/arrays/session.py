"""The session of the array runtime, in one thread. It supports the protocols in `array_runs.py`."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping

import numpy as np

from robochoc.communication.arrays.array_runs import array_run_for
from robochoc.communication.arrays.array_types import Integers
from robochoc.communication.arrays.blocks import Limits, RunBlock, run_on_cluster
from robochoc.communication.arrays.cycle_run import CycleChange, CycleRun, cycles_of
from robochoc.communication.arrays.description import describe_team
from robochoc.communication.arrays.layout import ArrayLayout
from robochoc.communication.search_result import Progress, SearchResult
from robochoc.communication.search_watch import snapshot_of
from robochoc.communication.session import Epoch, Session
from robochoc.journal.events import Concluded, Decided, Observer
from robochoc.model.outcome import Metrics, Verdict
from robochoc.model.problem import INFINITE, Team, Value
from robochoc.protocols.findings import NO_FINDINGS, Findings, Trail
from robochoc.protocols.protocol import Protocol
from robochoc.protocols.settings import read_settings
from robochoc.protocols.shared.cycles import CycleProtocol
from robochoc.solver.agent_problem import DEFAULT_PARAMETERS, AgentProblem, RunParameters, StartValues
from robochoc.solver.compile import TeamCompileTimeoutError
from robochoc.solver.compiled_team import CompiledTeam
from robochoc.solver.errors import UnsupportedError
from robochoc.system.garbage import collection_paused
from robochoc.system.stopping import stop_requested
from robochoc.system.time_limit import TimeLimitError, computed_by

Layouts = dict[tuple[int, bool, bool], tuple[CompiledTeam, ArrayLayout]]
"""The arrays of teams, by the identity of the team and the traits of the protocol on which the arrays depend."""
MOST_CHANGES = 2_000_000
"""The largest number of changed values that are recorded in a search that nobody observes."""


class ArraysRun(Session):
    """Runs one team as arrays. The team's problem cannot change, only the seed and the start values.

    Args:
        team: The team, whether compiled or not.
        protocol: The protocol of the robots.
        observer: Receives the robots' decisions, with the cycle as their time, and no messages.
        progress: Receives the message count after each cycle, before the decisions in the cycle.
        parameters: The robots' parameters besides the problem.
        deadline: The end of the run's time, on the monotonic clock. None: no limit.
        cluster: See `Options.cluster`.
        layouts: The arrays of teams in earlier sessions, for which the arrays need not be built again. New arrays are
            added.

    Raises:
        UnsupportedError: if the protocol cannot run as arrays, or costs or tables are too large.
        TeamCompileTimeoutError: if the deadline passes before the arrays are complete.
    """

    def __init__(
        self,
        team: Team | CompiledTeam,
        protocol: type[Protocol],
        *,
        observer: Observer | None = None,
        progress: Callable[[Progress], None] | None = None,
        parameters: RunParameters = DEFAULT_PARAMETERS,
        deadline: float | None = None,
        cluster: str | None = None,
        layouts: Layouts | None = None,
    ) -> None:
        super().__init__(team)
        self._cluster = cluster
        self._seed = parameters.seed
        self._observer = observer
        self._progress = progress
        form = array_run_for(protocol, cluster=cluster is not None)
        assert issubclass(protocol, CycleProtocol)  # noqa: S101 - for mypy: all that have a form are
        given = read_settings(protocol, parameters.settings)
        settings = given if isinstance(given, type(protocol.settings)) else protocol.settings
        layouts = {} if layouts is None else layouts
        key = id(self.compiled), protocol.traits.shared_scopes, protocol.traits.tree
        if key not in layouts:
            layouts[key] = self.compiled, self._laid_out(protocol, parameters, deadline)
        self._layout = layouts[key][1]
        self._form, self._settings = form, settings
        self._names = self._layout.description.names
        self._places: dict[str, dict[Value, int]] = {}
        self._run = self._new_run(parameters)

    def _laid_out(self, protocol: type[Protocol], parameters: RunParameters, deadline: float | None) -> ArrayLayout:
        try:
            with collection_paused():
                parts = Epoch(self.compiled, parameters=parameters).parts(protocol)
                return computed_by(deadline, _laid_out, parts)
        except TimeLimitError:
            raise TeamCompileTimeoutError("the time was over before the robots knew their problems") from None

    def _new_run(self, parameters: RunParameters) -> CycleRun:
        """Return a run that has not started."""
        self._recorded = 0
        run = self._form(self._layout, self._settings, parameters.seed, changes=True)
        if parameters.start:
            run.starts = np.array([self._start_of(name, parameters.start) for name in self._names], np.int64)
        else:
            run.starts = None
        return run

    @property
    def lossless(self) -> bool:
        """See `Session.lossless`."""
        return True

    def search(self, timeout: float | None = None, messages: int | None = None) -> SearchResult:
        """See `Session.search`. Limits are checked after each cycle."""
        if self._cluster is not None:
            return self._search_on(self._cluster, Limits(timeout, messages))
        began = time.monotonic()
        run = self._run
        verdict = Verdict.UNKNOWN
        if self.brief and self._observer is None:
            run.changes = None
        for _ in cycles_of(run):
            elapsed_s = time.monotonic() - began
            self._report(elapsed_s)
            self._watched()
            self._limit_changes()
            if not run.is_over and (
                self._is_to_stop
                or (timeout is not None and elapsed_s > timeout)
                or (messages is not None and self._sent >= messages)
            ):
                break
        else:
            verdict = run.verdict or Verdict.SOLUTION
        witness = None if run.witness is None else self._names[run.witness]
        if self._observer and witness is not None:
            self._observer(Concluded(t=run.cycle, robot=witness, verdict=str(verdict)))
        metrics = run.metrics(time.monotonic() - began)
        return self._result(verdict, witness, metrics)

    def _result(self, verdict: Verdict, witness: str | None, metrics: Metrics) -> SearchResult:
        costs = self.costs
        best = self._own_values(self._run.best) if costs and min(costs) < INFINITE else {}
        return SearchResult(
            verdict,
            witness,
            self._assignments(),
            metrics,
            findings=self._findings(),
            cycle_costs=costs,
            best_cycle=best,
        )

    def _limit_changes(self) -> None:
        """Stop recording the changes of a long search, unless they are observed. The best cycle is known anyway."""
        run = self._run
        if run.changes and self._observer is None:
            self._recorded += len(run.changes[-1].rows)
            if self._recorded > MOST_CHANGES:
                run.changes = None

    def _search_on(self, cluster: str, limits: Limits) -> SearchResult:
        """Search on a cluster. The observer receives nothing."""
        run, rows = self._run, self._layout.places
        report = run_on_cluster(
            cluster, self._layout.description, RunBlock(type(run), run.settings, self._seed, limits, changes=True)
        )
        run.values[rows[report.robots]] = report.values
        run.changes = [CycleChange(rows[robots], values) for robots, values in report.changes or ()]
        run.cycle, run.costs, run.verdict, run.witness = report.cycle, report.costs, report.verdict, report.witness
        verdict = run.verdict or (Verdict.SOLUTION if report.is_over else Verdict.UNKNOWN)
        witness = None if run.witness is None else self._names[run.witness]
        return SearchResult(
            verdict, witness, self._assignments(), report.metrics, findings=self._findings(), cycle_costs=self.costs
        )

    def _watched(self) -> None:
        """Pass a snapshot to the watch if it is due."""
        if self.watch is not None and self.watch.wants_snapshot(time.monotonic()):
            self.watch.receive(snapshot_of(self._assignments(), self._findings()))

    @property
    def _is_to_stop(self) -> bool:
        return stop_requested() or (self.watch is not None and self.watch.satisfied)

    def change(self, epoch: Epoch) -> None:
        """See `Session.change`. Only the seed and the start values may change. Raises `UnsupportedError`."""
        if epoch.compiled is not self.compiled or self._cluster is not None:
            raise UnsupportedError("--runtime arrays is for problems that do not change: use --runtime simulator")
        self._run = self._new_run(epoch.parameters)

    def _start_of(self, name: str, start: StartValues) -> int:
        """Return the index of a robot's start value; -1: there is none."""
        if not self._places:
            self._places = {
                one: {value: place for place, value in enumerate(self.compiled[one].values)} for one in self._names
            }
        value = [start.get(variable) for variable in self.compiled.robots[name].robot.interface]
        return self._places[name].get(tuple([part for part in value if part is not None]), -1)

    def close(self) -> None:
        """Do nothing: arrays have no resources to release."""

    @property
    def costs(self) -> list[float]:
        """The cost of the team's values in every cycle so far; `inf` if a hard constraint is violated."""
        return list(self._run.costs)

    @property
    def _sent(self) -> int:
        return sum(self._run.tally.messages.values())

    def _report(self, elapsed_s: float) -> None:
        """Report the progress, and the robots' decisions in the cycle."""
        run = self._run
        if self._progress:
            self._progress(Progress(self._sent, elapsed_s))
        if not self._observer or not run.changes or len(run.changes) <= run.cycle:
            return
        for row, value in zip(*map(np.ndarray.tolist, run.changes[run.cycle]), strict=True):
            name = self._names[self._layout.robots[row]]
            clock = 0 if run.clocks is None else int(run.clocks[row])
            assignment = self.compiled[name].solution(value)
            self._observer(Decided(t=run.cycle, robot=name, assignment=assignment, clock=clock))

    def _assignments(self) -> dict[str, dict[str, int]]:
        return self._own_values(self._run.values)

    def _own_values(self, values: Integers) -> dict[str, dict[str, int]]:
        """Return the values of each robot's variables; `values` contains the index for each row."""
        found: dict[str, dict[str, int]] = {name: {} for name in self._names}
        for robot, value in zip(self._layout.robots.tolist(), values.tolist(), strict=True):
            found[self._names[robot]] = self.compiled[self._names[robot]].solution(value)
        return found

    def _findings(self) -> dict[str, Findings]:
        """Return each robot's values in every cycle; nothing if they were not recorded."""
        run = self._run
        if run.changes is None:
            return dict.fromkeys(self._names, NO_FINDINGS)
        entries: list[list[tuple[int, int]]] = [[] for _ in range(self._layout.many)]
        for cycle, (rows, values) in enumerate(run.changes or ()):
            for row, value in zip(rows.tolist(), values.tolist(), strict=True):
                entries[row].append((cycle, value))
        found = dict.fromkeys(self._names, Findings(trail=Trail([], -1)))
        for row, robot in enumerate(self._layout.robots.tolist()):
            last = run.cycle if self._layout.degrees[row] else run.settings.cycles
            found[self._names[robot]] = Findings(trail=Trail(entries[row], last))
        return found


class SimulatedArrays(ArraysRun):
    """Runs one team as arrays, with the results and the counts of the simulator.

    The counts differ only if Max-Sum proves that there is no solution, since the simulator stops within a cycle. Such a
    run is simulated again, message by message, by the session that `simulate` opens.
    """

    simulate: Callable[[], Session]

    def search(self, timeout: float | None = None, messages: int | None = None) -> SearchResult:
        """See `Session.search`."""
        began = time.monotonic()
        result = super().search(timeout, messages)
        if result.verdict != Verdict.NO_SOLUTION:
            return result
        session = self.simulate()
        session.watch = self.watch
        return session.search(timeout and max(0.0, timeout - (time.monotonic() - began)), messages)


def _laid_out(parts: Mapping[str, AgentProblem]) -> ArrayLayout:
    """Return the arrays of the team. Raises `UnsupportedError` if its costs or tables are too large."""
    try:
        return ArrayLayout(describe_team(parts))
    except UnsupportedError as large:
        raise UnsupportedError(f"{large}: use --runtime simulator") from None
