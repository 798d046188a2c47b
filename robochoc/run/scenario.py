"""Solves a problem that changes over time, epoch by epoch (the paper's dynamic DisCSP, Section 3.1).

An epoch ends when its problem is solved, when the scenario's next event happens, or when robots are lost. The next
epoch starts with the changed problem. A `DynamicProtocol` keeps the knowledge that is still valid. Any other protocol
restarts, so both kinds can be compared.

The changes are known from the beginning, as a scenario, or arrive epoch by epoch from an `Environment`.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import count
from pathlib import Path
from typing import NamedTuple

from robochoc.communication.search_result import SearchResult
from robochoc.communication.session import Epoch, Session
from robochoc.formats import InvalidInputError, read_robot_again
from robochoc.model.change import (
    affected_robots,
    apply_changes,
    apply_possible_changes,
    describe_change,
    rejoin,
    team_after_events,
)
from robochoc.model.costs import NormalizationError, normalized_joining
from robochoc.model.orders import with_priorities
from robochoc.model.outcome import EpochOutcome, Verdict
from robochoc.model.problem import AddAgent, Change, Robot, ScenarioEvent, Team
from robochoc.model.symbols import symbol_table
from robochoc.model.team_edits import ChangeError, without_robots
from robochoc.solver.agent_problem import DEFAULT_PARAMETERS, RunParameters
from robochoc.solver.compile import TeamCompileTimeoutError
from robochoc.solver.compiled_team import CompiledTeam
from robochoc.solver.explanation import Invalidated, invalidated_by

Compile = Callable[[Team], CompiledTeam]

Prepare = Callable[[], tuple[CompiledTeam, SearchResult | None]]
"""The preparation before each epoch's search. It returns the compiled team for the search.

If it also returns a result, this is the result of the epoch, and there is no search.
"""

Environment = Callable[[Team, EpochOutcome, float | None], ScenarioEvent | None]
"""The robots' environment: a function that receives each epoch's answer and returns the next change of the problem.

Args:
    Team: The epoch's team.
    EpochOutcome: The outcome of the epoch, after its answer was checked against every constraint.
    float | None: The remaining seconds (None: no limit; 0: the returned event is ignored).

Returns:
    The next event, or None if there are no further events. The event happens after the events in the files; any
    change in it that is impossible by then is skipped.
"""


NOT_SEARCHED = SearchResult.of(Verdict.UNKNOWN, None, {}, (), 0)
"""The result of an epoch that has no time for a search."""


class EpochStart(NamedTuple):
    """The start of an epoch: the epoch's number and its cause in a few words."""

    epoch: Epoch
    number: int = 0
    opened_by: str = ""


class FinishedEpoch(NamedTuple):
    """An epoch whose search has ended.

    `team` is the epoch's team in the form of the files, `epoch` contains the same team with compiled domains, in the
    form used by the robots. If the time limit was reached before the search, `epoch` is the previous epoch.
    """

    team: Team
    epoch: Epoch
    opened_by: str
    result: SearchResult


class ScenarioRun:
    """Runs a team through its scenario and losses, epoch by epoch.

    Attributes:
        team: The current team, in the order of its files.
        lost_for_good: The robots that were lost and have not returned.
        failed_returns: The reasons why lost robots could not return, one sentence each.
        found: The result of the new epoch, if its preparation has decided the epoch.
    """

    def __init__(  # noqa: PLR0913 - all belong to one run
        self,
        team: Team,
        order: Sequence[str] | None,
        compile_: Compile,
        left_s: Callable[[], float | None],
        *,
        messages: int | None = None,
        spares: int = 0,
        parameters: RunParameters = DEFAULT_PARAMETERS,
        next_parameters: Callable[[Team], RunParameters] | None = None,
        prepare: Prepare | None = None,
        with_files: bool = False,
    ) -> None:
        """Start with `team` in its state before the first event.

        Args:
            team: The team with its scenario.
            order: The priority order of the run (None: the order of the files).
            compile_: Compiles the domains of a team.
            left_s: Returns the remaining seconds (None: no limit).
            messages: The limit on messages in all epochs together (None: no limit).
            spares: The number of lost robots that return. Their files are read again, past events are applied to them,
                and they join at the end of the order.
            parameters: The parameters of the robots.
            next_parameters: Returns the parameters of a later epoch for its team (None: `parameters`).
            prepare: The preparation before each search (None: no preparation).
            with_files: True if the constraints held by lost robots are lost with them.
        """
        self.team = self._full = team_after_events(team, events=0)
        self.lost_for_good: list[str] = []
        self.failed_returns: list[str] = []
        self._files = team
        self._happened = 0
        self._order = order
        self._compile = compile_
        self._left_s = left_s
        self._messages = messages
        self._spares = spares
        self._parameters = parameters
        self._next_parameters = next_parameters or (lambda _: parameters)
        self._prepare = prepare
        self._with_files = with_files
        self._held_in = order if with_files else None
        self.found: SearchResult | None = None
        self._joining: set[str] = set()
        self._after_losses = False
        self._has_added_events = False

    def ordered_team(self) -> Team:
        """Return the team in the order of the run, which the robots use. Raises `OrderError`."""
        return self.team if self._order is None else with_priorities(self.team, self._order)

    def compiled(self) -> CompiledTeam:
        """Return the team in the order of the run, compiled. Raises `OrderError` and the errors of the compiler."""
        return self._compile(self.ordered_team())

    def prepared(self) -> CompiledTeam:
        """Return the compiled team for the search of the new epoch. Raises the errors of `compiled`."""
        if self._prepare is None:
            return self.compiled()
        compiled, self.found = self._prepare()
        return compiled

    def epochs(
        self, session: Session, on_start: Callable[[EpochStart], None], parameters: RunParameters | None = None
    ) -> Iterator[FinishedEpoch]:
        """Yield the epochs one by one. The verdict of the last epoch counts. A limit may end the run earlier.

        Args:
            session: A session opened with the team returned by `prepared`.
            on_start: Called before each epoch.
            parameters: The parameters of the robots in the first epoch, with which the session was opened (None: those
                of all epochs).
        """
        opened = "the start"
        epoch = Epoch(session.compiled, parameters=self._parameters if parameters is None else parameters)
        for number in count():
            if self.found is None:
                on_start(EpochStart(epoch, number, opened))
            result = self._search(session)
            yield FinishedEpoch(self.team, epoch, opened, result)
            if result.lost:
                joining = self._lose(result.lost)
                opened = _describe_loss(result.lost, joining)
            elif self._next is None or (result.verdict == Verdict.UNKNOWN and self.is_over):
                return
            else:
                opened = self._describe(self._next)
                joining = self._apply(self._next)
            self._update_team(joining)
            if result.lost and not self.team.robots and self._next is None:
                return
            try:
                epoch = self._change(session, joining)
            except TeamCompileTimeoutError:
                yield FinishedEpoch(self.team, epoch._replace(parameters=self._parameters), opened, NOT_SEARCHED)
                return

    def _search(self, session: Session) -> SearchResult:
        if not self.team.robots:  # all robots have left, and others may join: no constraint is violated
            return SearchResult.of(Verdict.SOLUTION, None, {}, (), 0)
        if self.found is not None:
            return self.found
        if self.is_over:
            return NOT_SEARCHED
        limits = [self._messages, self._next.after if self._next else None]
        enough = min((limit for limit in limits if limit is not None), default=None)
        result = session.search(self._left_s(), enough)
        if self._messages is not None:
            self._messages -= sum(result.metrics.messages.values())
        return result

    @property
    def _next(self) -> ScenarioEvent | None:
        """The next event, or None if no further event is known."""
        return self._files.scenario[self._happened] if self._happened < len(self._files.scenario) else None

    @property
    def events_left(self) -> int:
        """The number of events that have not yet happened."""
        return len(self._files.scenario) - self._happened

    @property
    def is_over(self) -> bool:
        """Return whether the time limit or the message limit is reached."""
        return self._left_s() == 0 or (self._messages is not None and self._messages <= 0)

    def add_event(self, event: ScenarioEvent) -> None:
        """Append `event` to the scenario. Changes in the event that are impossible when it happens are skipped."""
        self._files = replace(self._files, scenario=(*self._files.scenario, event))
        self._has_added_events = True

    def remove(self, lost: Collection[str]) -> None:
        """Remove the robots `lost` for good."""
        self.lost_for_good += lost
        self._update_team(())

    def _describe(self, event: ScenarioEvent) -> str:
        """Describe the changes in `event` that are still possible, in a few words."""
        out = set(self.lost_for_good)
        changes = apply_possible_changes(self._full, event.changes)[1] if self._has_added_events else event.changes
        words = [
            describe_change(change, self._full)
            for change in changes
            if out.isdisjoint(affected_robots(self._full, change))
        ]
        return ", ".join(words) or "nothing"

    def _apply(self, event: ScenarioEvent) -> Collection[str]:
        """Apply `event`, and return the joining robots. After losses, impossible changes are skipped."""
        self._happened += 1
        changes: Sequence[Change] = event.changes
        if self._after_losses:
            self._full = team_after_events(self._files, self._happened)
        elif self._has_added_events:
            self._full, changes = apply_possible_changes(self._full, changes)
        else:
            self._full = apply_changes(self._full, changes)
        return [change.robot.name for change in changes if isinstance(change, AddAgent)]

    def _lose(self, lost: Mapping[str, str]) -> Collection[str]:
        """Return the robots in `lost` that return. The other robots are permanently lost."""
        self._after_losses = True
        back: list[str] = []
        for name in lost:
            if self._spares:
                self._spares -= 1
                try:
                    self._reread(name)
                    back.append(name)
                except (InvalidInputError, ChangeError, NormalizationError, OSError) as why:
                    self.failed_returns.append(f"{name} could not come back: {why}")
        self.lost_for_good += [name for name in lost if name not in back]
        if back:
            self._full = team_after_events(self._files, self._happened)
            self._order = self._order or self.team.order
        return back

    def _update_team(self, joining: Collection[str]) -> None:
        """Update the team and its order. The robots that are `joining` come last."""
        self.lost_for_good = [name for name in self.lost_for_good if name in self._full and name not in joining]
        self.team = self._remaining()
        if self._order is not None:
            new = {*joining}
            stay = dict.fromkeys(name for name in self._order if name in self.team and name not in new)
            self._order = (*stay, *(name for name in self.team.order if name not in stay))

    def _remaining(self) -> Team:
        """Return the team without the robots that are permanently lost.

        If the constraints held by these robots are lost with them, the initial order of the run determines which these
        are.
        """
        order = self._held_in
        if order is None or not self.lost_for_good:
            return without_robots(self._full, self.lost_for_good, with_files=self._with_files)
        left = without_robots(with_priorities(self._full, order), self.lost_for_good, with_files=True)
        return with_priorities(left, [name for name in self._full.order if name in left])

    def _change(self, session: Session, joining: Collection[str]) -> Epoch:
        """Change the team of `session` to the current one, and return the new epoch.

        If the epoch needs no search, the session is left unchanged until an epoch needs one.
        """
        compiled = self._compile(session.usable_team(self.ordered_team())) if self._prepare is None else self.prepared()
        self._joining.update(joining)
        parameters = self._next_parameters(self.team)
        if self.found is not None:
            return Epoch(compiled, parameters=parameters)
        fresh = frozenset(name for name in self._joining if name in compiled.team)
        self._joining.clear()
        keys, agents = invalidated_by(session.compiled.team, compiled.team)
        epoch = Epoch(compiled, Invalidated(keys, agents | fresh), fresh, parameters)
        session.change(epoch)
        return epoch

    def _reread(self, name: str) -> None:
        """Replace the robot `name` by the present content of its file, as if the file had never been different."""
        robot = self._read_again(name)
        if name in self._files:
            self._files = rejoin(self._files, robot)
        else:
            self._files = replace(self._files, scenario=tuple(_with_joining(e, robot) for e in self._files.scenario))

    def _read_again(self, name: str) -> Robot:
        """Return the robot in the file of the robot `name`, with normalised costs.

        Raises:
            InvalidInputError: if the file is invalid.
            OSError: if the file cannot be read.
            UnboundedCostError: as in `normalized_joining`.
        """
        symbols = symbol_table(self.team.robots)
        read = read_robot_again(Path(self.team[name].file), symbols, self._files.user_units)
        return normalized_joining(self._files, read)


def _describe_loss(lost: Iterable[str], back: Collection[str]) -> str:
    """Describe the lost robots, and those that came `back`, in a few words."""
    out = [name for name in lost if name not in back]
    words = [f"the loss of {', '.join(out)}"] if out else []
    if back:
        words.append(f"{', '.join(back)} {'was' if len(back) == 1 else 'were'} lost, and came back")
    return "; ".join(words)


def _with_joining(event: ScenarioEvent, robot: Robot) -> ScenarioEvent:
    """Return `event` with `robot` in place of the joining robot with the same name."""
    changes = (AddAgent(robot) if isinstance(c, AddAgent) and c.robot.name == robot.name else c for c in event.changes)
    return replace(event, changes=tuple(changes))
