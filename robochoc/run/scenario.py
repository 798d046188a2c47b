"""Epoch by epoch: what a team goes through while its problem changes (the paper's dynamic DisCSP, Section 3.1).

An epoch ends when its problem is solved, when the scenario's next event comes, or when robots are lost. What changes
the problem opens the next one. A protocol that can (`DynamicProtocol`) goes on with what still stands; any other
begins anew, so that the two can be compared.

What is to come may be known from the beginning, as a scenario, or be told epoch by epoch, by a `Environment`.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import count
from pathlib import Path
from typing import Any, NamedTuple, Self

from robochoc.communication.run_result import RunResult
from robochoc.communication.session import Epoch, Session
from robochoc.formats import InvalidInputError, read_robot
from robochoc.journal.events import Began, Observer
from robochoc.journal.given import TeamWriter
from robochoc.model.change import (
    ChangeError,
    affected_robots,
    apply_changes,
    apply_possible_changes,
    describe_change,
    rejoin,
    team_after_events,
    without_robots,
)
from robochoc.model.orders import with_priorities
from robochoc.model.outcome import EpochOutcome as Answered
from robochoc.model.outcome import Verdict
from robochoc.model.problem import AddAgent, Change, Robot, ScenarioEvent, Team
from robochoc.protocols.protocol import Protocol
from robochoc.solver.agent_problem import NO_BRIEF, RunParameters
from robochoc.solver.compiled_team import CompiledTeam
from robochoc.solver.explanation import Invalidated, invalidated_by

Compile = Callable[[Team], CompiledTeam]

Environment = Callable[[Team, Answered, float | None], ScenarioEvent | None]
"""Where decisions go and changes come from, while the team waits: the robots' surroundings.

It is given each epoch's team and how that epoch ended, once the answer was held against every constraint, and how many
seconds there are left (None: no limit; 0: nothing that comes is heeded any more). It says what happens next, or None:
nothing. An event of its own comes after those of the files; changes in it that cannot be are passed over.
"""


class Played(NamedTuple):
    """An epoch that is over: its team, as the files have it, how it ended, what had opened it.

    `compiled` is that team as the robots have worked on it.
    """

    team: Team
    result: RunResult
    opened_by: str
    compiled: CompiledTeam


class Opening(NamedTuple):
    """A run that begins, or an epoch: its number, what has opened it, and what the robots are to solve."""

    epoch: Epoch
    number: int = 0
    by: str = ""

    @classmethod
    def of(cls, team: CompiledTeam, brief: RunParameters) -> Self:
        """Return a run of `team` as it is."""
        return cls(Epoch(team, brief=brief))


class Announcer:
    """Tells `observer`, if there is one, of what begins, and what the robots are given for it."""

    def __init__(self, observer: Observer | None) -> None:
        self._observer = observer
        self._writer = TeamWriter()

    def __call__(self, protocol: type[Protocol], opening: Opening, session: Session | None = None) -> None:
        """A run of `protocol` begins; or an epoch in `session`, which has been open before (None: it comes after)."""
        if self._observer is None:
            return
        epoch, number, by = opening
        detail: dict[str, Any] = {"epoch": number, "opened_by": by} if number else {}
        if protocol.traits.costs:
            detail["minimises"] = True
        self._observer(Began(t=0, protocol=protocol.__name__, **detail))
        fresh = epoch.team.order if session and session.anew else epoch.restarted
        lossless = session is None or session.lossless
        self._observer(self._writer.given(epoch.team, epoch.brief, epoch.void, fresh=fresh, quiet=lossless))


class ScenarioRun:
    """A team on its way through its scenario, and through losses.

    `order` is the priority order asked for (None: the files'). `compile_` compiles a team.
    `left_s` says how many seconds there are left, `messages` how many may be sent in all (None: no limit). Of the
    robots that are lost, `spares` come back: their files are read again, what has happened meanwhile happens to
    them too, and they join at the end of the order. `brief` is what robots are told beside the problem.
    `withdrawn` names those that are out, `regrets` says why somebody could not come back.
    """

    def __init__(
        self,
        team: Team,
        order: Sequence[str] | None,
        compile_: Compile,
        left_s: Callable[[], float | None],
        *,
        messages: int | None = None,
        spares: int = 0,
        brief: RunParameters = NO_BRIEF,
    ) -> None:
        self.team = self._full = team_after_events(team, events=0)
        self.withdrawn: list[str] = []
        self.regrets: list[str] = []
        self._files = team
        self._happened = 0
        self._order = order
        self._compile = compile_
        self._left_s = left_s
        self._messages = messages
        self._spares = spares
        self._brief = brief
        self._lossy = False
        self._loose = False

    def arranged(self) -> Team:
        """The team as the robots see it: in the order of the run. Raises `OrderError`."""
        return self.team if self._order is None else with_priorities(self.team, self._order)

    def compiled(self) -> CompiledTeam:
        """Return the team as the robots see it, compiled. Raises `OrderError`, and what compiling raises."""
        return self._compile(self.arranged())

    def go(self, session: Session, announce: Callable[[Opening], None]) -> Iterator[Played]:
        """One epoch after the other; the last is the one whose verdict counts. A time limit may end it earlier.

        `session` was opened with the `compiled` team. Before each epoch, `announce` is told of it.
        """
        opened = "the start"
        epoch = Epoch(session.compiled, brief=self._brief)
        for number in count():
            announce(Opening(epoch, number, opened))
            result = self._search(session)
            yield Played(self.team, result, opened, epoch.compiled)
            if result.lost:
                fresh = self._back_after(result.lost)
                opened = _loss(result.lost, fresh)
            elif self._next is None or (result.verdict is Verdict.UNKNOWN and self.is_over):
                return
            else:
                opened = self._described(self._next)
                fresh = self._added_by(self._next)
            self._take_stock(fresh)
            if result.lost and not self.team.robots and self._next is None:
                return
            epoch = self._go_over(session, fresh)

    def _search(self, session: Session) -> RunResult:
        if not self.team.robots:  # all have left, and others may come: nobody is against it
            return RunResult.of(Verdict.SOLUTION, None, {}, (), 0)
        if self.is_over:
            return RunResult.of(Verdict.UNKNOWN, None, {}, (), 0)
        limits = [self._messages, self._next.after if self._next else None]
        enough = min((limit for limit in limits if limit is not None), default=None)
        result = session.search(self._left_s(), enough)
        if self._messages is not None:
            self._messages -= sum(result.metrics.messages.values())
        return result

    @property
    def _next(self) -> ScenarioEvent | None:
        """The event that comes next."""
        return self._files.scenario[self._happened] if self._happened < len(self._files.scenario) else None

    @property
    def is_over(self) -> bool:
        """Whether the time is over, or all messages have been sent."""
        return self._left_s() == 0 or (self._messages is not None and self._messages <= 0)

    def expect(self, event: ScenarioEvent) -> None:
        """`event` will happen, too, after all that is known to come. What of it cannot be is left out then."""
        self._files = replace(self._files, scenario=(*self._files.scenario, event))
        self._loose = True

    def leave(self, lost: Collection[str]) -> None:
        """The robots `lost` are out for good."""
        self.withdrawn += lost
        self._take_stock(())

    def _described(self, event: ScenarioEvent) -> str:
        """What of `event` can still happen, in a few words."""
        out = set(self.withdrawn)
        changes = apply_possible_changes(self._full, event.changes)[1] if self._loose else event.changes
        words = [describe_change(change) for change in changes if out.isdisjoint(affected_robots(self._full, change))]
        return ", ".join(words) or "nothing"

    def _added_by(self, event: ScenarioEvent) -> Collection[str]:
        """Let `event` happen; returns who comes. After losses, what cannot be any more is left out."""
        self._happened += 1
        changes: Sequence[Change] = event.changes
        if self._lossy:
            self._full = team_after_events(self._files, self._happened)
        elif self._loose:
            self._full, changes = apply_possible_changes(self._full, changes)
        else:
            self._full = apply_changes(self._full, changes)
        return [change.robot.name for change in changes if isinstance(change, AddAgent)]

    def _back_after(self, lost: Mapping[str, str]) -> Collection[str]:
        """Those of `lost` that come back; the others are out."""
        self._lossy = True
        back: list[str] = []
        for name in lost:
            if self._spares:
                self._spares -= 1
                try:
                    self._read_again(name)
                    back.append(name)
                except (InvalidInputError, ChangeError, OSError) as why:
                    self.regrets.append(f"{name} could not come back: {why}")
        self.withdrawn += [name for name in lost if name not in back]
        if back:
            self._full = team_after_events(self._files, self._happened)
            self._order = self._order or self.team.order
        return back

    def _take_stock(self, fresh: Collection[str]) -> None:
        """Who is there now, and in which order: whoever is in `fresh` comes last."""
        self.withdrawn = [name for name in self.withdrawn if name in self._full and name not in fresh]
        self.team = without_robots(self._full, self.withdrawn)
        if self._order is not None:
            stay = [name for name in self._order if name in self.team and name not in fresh]
            self._order = (*stay, *(name for name in self.team.order if name not in stay))

    def _go_over(self, session: Session, fresh: Collection[str]) -> Epoch:
        """Have `session` work on the team as it is now."""
        now = session.workable(self.arranged())
        keys, agents = invalidated_by(session.compiled.team, now)
        stale = Invalidated(keys, agents | set(fresh))
        epoch = Epoch(self._compile(now), stale, frozenset(fresh), self._brief)
        session.change(epoch)
        return epoch

    def _read_again(self, name: str) -> None:
        """Take what the file of `name` says now for what it said from the beginning."""
        robot = read_robot(Path(self.team[name].file))
        if name in self._files:
            self._files = rejoin(self._files, robot)
        else:
            self._files = replace(self._files, scenario=tuple(_with_newcomer(e, robot) for e in self._files.scenario))


def _loss(lost: Iterable[str], back: Collection[str]) -> str:
    out = [name for name in lost if name not in back]
    words = [f"the loss of {', '.join(out)}"] if out else []
    if back:
        words.append(f"{', '.join(back)} {'was' if len(back) == 1 else 'were'} lost, and came back")
    return "; ".join(words)


def _with_newcomer(event: ScenarioEvent, robot: Robot) -> ScenarioEvent:
    """`event`, in which whoever comes under the name of `robot` is that robot."""
    changes = (AddAgent(robot) if isinstance(c, AddAgent) and c.robot.name == robot.name else c for c in event.changes)
    return replace(event, changes=tuple(changes))
