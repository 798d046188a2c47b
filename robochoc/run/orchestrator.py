"""A run: a team goes in, an outcome comes out. Everything that solves goes through here."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING

from robochoc.communication.processes.robot_link import RobotsLostError
from robochoc.communication.run_result import Progress
from robochoc.communication.session import Session
from robochoc.formats import check_team, held_to_rules
from robochoc.journal.events import Observer
from robochoc.model.change import describe_change, team_after_events
from robochoc.model.orders import Order, OrderError, compute_order, with_dom_deg_order
from robochoc.model.outcome import EpochOutcome, Metrics, Outcome, Verdict
from robochoc.model.problem import INFINITE, Team
from robochoc.protocols.protocol import Protocol
from robochoc.protocols.traits import Traits
from robochoc.run.compatibility import instead, refuse_central, refuse_field, refuse_unfit
from robochoc.run.defaults import FIRST_FIT, MINIMISES
from robochoc.run.evaluation import check, evaluate, evaluate_withdrawal
from robochoc.run.incumbent import absent
from robochoc.run.options import CENTRAL, OnLoss, Options, Runtime, ScheduleName, Withdrawal
from robochoc.run.registry import protocol_by_name, protocol_named
from robochoc.run.runtimes import open_session
from robochoc.run.scenario import Announcer, Environment, Opening, Played, ScenarioRun
from robochoc.solver.agent_problem import RunParameters
from robochoc.solver.cache import SolutionCache
from robochoc.solver.compile import CompileTimeoutError
from robochoc.solver.compiled_team import CompiledTeam
from robochoc.solver.domain import TooManySolutionsError
from robochoc.solver.encoding import TooLargeError, UnsupportedError
from robochoc.solver.team_compiler import NoLocalSolutionError, OutOfTimeError, TeamCompiler
from robochoc.verification.checker import RefutedError
from robochoc.verification.objective import withdrawal_cost

if TYPE_CHECKING:
    from robochoc.solver.ace import AceProcess
    from robochoc.solver.central import CentralSolver

__all__ = ["CENTRAL", "OnLoss", "Options", "RefutedError", "Runtime", "ScheduleName", "Withdrawal", "solve"]


def solve(
    team: Team,
    options: Options = Options(),
    *,
    observer: Observer | None = None,
    progress: Callable[[Progress], None] | None = None,
    solver: AceProcess | None = None,
    field: Environment | None = None,
) -> Outcome:
    """Let `team` solve its problem, epoch by epoch if it changes, and hold each answer against every constraint.

    Who solves many teams may lend a `solver` that stays warm between them. A `field` is told of each epoch's answer,
    and says what happens next: the problem changes over time. When a limit is reached, the verdict is `unknown`. Raises
    `InvalidInputError` (team, field's event), `UnknownProtocolError`, `UnsupportedError`, `RobotsLostError`
    (processes), `CompileError`, `SolverLostError` (the constraint solver), `SolverMissingError`, and `RefutedError`
    when a second opinion does not agree.
    """
    check_team(team)
    field = field and held_to_rules(field)
    try:
        if field:
            refuse_field(team, options)
        run = _Run(team, options, observer, progress, solver, field)
        return run.centrally() if options.protocol == CENTRAL else run.distributed()
    except OrderError as refused:
        raise UnsupportedError(str(refused)) from None


class _Run:
    """One team, one set of options, one time limit for all that has to be done."""

    def __init__(
        self,
        team: Team,
        options: Options,
        observer: Observer | None,
        progress: Callable[[Progress], None] | None,
        solver: AceProcess | None,
        field: Environment | None,
    ) -> None:
        self._team = team
        self._field = field
        self._dynamic = team.dynamic or field is not None
        self._solver = solver
        self._options = options
        self._observer = observer
        self._announce = Announcer(observer)
        self._progress = progress
        self._began = time.monotonic()
        self._deadline = None if options.timeout is None else self._began + options.timeout
        self._cache = SolutionCache() if options.cache else None
        self._compiler = TeamCompiler(options.local, self._cache, self._deadline, solver, self._show)
        self._epochs: list[EpochOutcome] = []
        self._outcome = Outcome(
            team=team.name,
            protocol=options.protocol,
            runtime=options.runtime,
            seed=options.seed,
            verdict=Verdict.UNKNOWN,
            order="listed" if isinstance(options.order, tuple) else options.order,
            channel=options.channel.name if options.channel else None,
        )

    def distributed(self) -> Outcome:
        """The robots compile their domains, then the protocol runs; robots step aside if they are to."""
        options = self._options
        protocol = protocol_named(options.protocol)
        refuse_unfit(self._team, options, protocol)
        names = (
            compute_order(self._team, options.order, options.seed)
            if isinstance(options.order, Order)
            else options.order
        )
        journey = ScenarioRun(
            self._team,
            names,
            self._compiled,
            self._left_s,
            messages=options.messages,
            spares=options.spares,
            brief=self._brief,
        )
        try:
            return self._travel(journey, protocol)
        except TooLargeError as refused:
            raise UnsupportedError(f"{refused}{instead(self._team, options, complete=True, costs=True)}") from None
        except (TooManySolutionsError, CompileTimeoutError, OutOfTimeError) as limit:
            outcome = replace(self._summary(), verdict=Verdict.UNKNOWN, assignment={}, verified=False)
            return replace(_without(outcome, journey), reason="; ".join([str(limit), *journey.regrets]))

    def _travel(self, journey: ScenarioRun, protocol: type[Protocol]) -> Outcome:
        """All epochs; then those step aside who find no place, if they are to."""
        if self._options.withdraw is Withdrawal.FEWEST and protocol.traits.costs:
            return self._placed(self._outcome, journey, protocol)
        try:
            lost = self._play(journey, protocol)
            if lost:
                raise RobotsLostError(lost)
            outcome = _without(self._summary(), journey)
        except NoLocalSolutionError as alone:
            sure = self._confirmed(journey.team, alone.robot)
            epoch = EpochOutcome(
                Verdict.NO_SOLUTION, journey.team.order, verified=sure, witness=alone.robot, confirmed=sure
            )
            outcome = replace(self._told(epoch), reason=str(alone))
        if outcome.verdict is Verdict.UNKNOWN and outcome.reason is None:
            outcome = replace(outcome, reason=self._limit(outcome.witness, sum(outcome.metrics.messages.values())))
        if journey.regrets:
            outcome = replace(outcome, reason="; ".join([*filter(None, [outcome.reason]), *journey.regrets]))
        if outcome.verdict is Verdict.NO_SOLUTION and self._options.withdraw is not None:
            fewest = self._options.withdraw is Withdrawal.FEWEST
            second = MINIMISES if fewest else FIRST_FIT
            outcome = self._placed(replace(outcome, placed_by=second), journey, protocol_by_name(second))
        return outcome

    def _limit(self, witness: str | None, sent: int) -> str:
        """Why there is no verdict, after so many messages."""
        if witness is not None:
            return f"{witness} gave up, as its protocol has it"
        if self._left_s() == 0:
            return f"the time was over (--timeout {self._options.timeout:g})"
        if self._options.messages is None or sent < self._options.messages:
            return f"{self._options.protocol} has come to its end, and all that it came by breaks a hard constraint"
        return f"so many messages have been sent (--messages {self._options.messages})"

    def _play(self, journey: ScenarioRun, protocol: type[Protocol]) -> Mapping[str, str]:
        """Play all epochs; returns the robots that are lost, if nobody is left."""
        lost: Mapping[str, str] = {}
        with self._session(protocol, journey.compiled(), self._brief) as session:
            for played in journey.go(session, lambda opening: self._announce(protocol, opening, session)):
                self._epochs.append(self._epoch(played, protocol.traits))
                self._tell_field(journey)
                lost = played.result.lost
        return lost

    def _tell_field(self, journey: ScenarioRun) -> None:
        """The field, if there is one, is told of the last epoch; what it says will happen."""
        left_s = 0 if journey.is_over else self._left_s()
        event = self._field(journey.team, self._epochs[-1], left_s) if self._field else None
        if event:
            journey.expect(event)

    def _placed(self, outcome: Outcome, journey: ScenarioRun, protocol: type[Protocol]) -> Outcome:
        """Who finds a place among those that are left, as `protocol` has it; the others step aside.

        One that was not asked for (`placed_by`) gets no settings, and to be fast an order of its own if it has costs.
        """
        brief = RunParameters(self._options.seed) if outcome.placed_by else self._brief
        if protocol.traits.costs:
            brief = brief._replace(aside=withdrawal_cost(self._team))
        while True:
            team = journey.arranged()
            if outcome.placed_by == MINIMISES and self._options.order is None:
                team = with_dom_deg_order(team)
            compiled = self._compiler.compile(team, every=True)
            self._announce(protocol, Opening.of(compiled, brief))
            with self._session(protocol, compiled, brief) as session:
                result = session.search(self._left_s(), self._options.messages)
            if not result.lost:
                break
            journey.leave(result.lost.keys())
            if not journey.team.robots:
                raise RobotsLostError(result.lost)
        spent = replace(outcome.metrics + result.metrics, compile_s=self._compiler.seconds)
        outcome = replace(_without(outcome, journey), metrics=spent)
        outcome = evaluate_withdrawal(outcome, journey.team, result, compiled, brief.aside)
        if outcome.verdict is Verdict.UNKNOWN:
            return replace(outcome, reason=self._limit(None, sum(spent.messages.values())))
        if outcome.verdict is not Verdict.OPTIMAL or brief.aside is None:
            return outcome
        from robochoc.run.second_opinion import total_cost  # noqa: PLC0415 - start-up: seldom asked for

        total = total_cost(journey.team, outcome.assignment, brief.aside)
        return replace(outcome, confirmed=self._confirmed(journey.team, total=total, aside=int(brief.aside)))

    # Epochs

    def _epoch(self, played: Played, traits: Traits) -> EpochOutcome:
        """What an epoch has come to, held against every constraint, or against the judge if that is asked for."""
        team, result, opened, compiled = played
        epoch = EpochOutcome(
            verdict=result.verdict,
            robots=team.order,
            opened_by=opened,
            metrics=result.metrics,
            witness=result.witness,
            lost=tuple(result.lost),
        )
        if result.verdict is Verdict.NO_SOLUTION:
            sure = self._confirmed(team)
            return replace(epoch, verified=sure, confirmed=sure)
        epoch = evaluate(epoch, team, result, traits, compiled)
        if epoch.verdict is not Verdict.OPTIMAL or epoch.cost is None:
            return epoch
        return replace(epoch, confirmed=self._confirmed(team, total=epoch.cost))

    def _told(self, epoch: EpochOutcome) -> Outcome:
        """The outcome of a run that ended with `epoch`."""
        return replace(
            self._outcome,
            verdict=epoch.verdict,
            assignment=epoch.assignment,
            cost=epoch.cost,
            witness=epoch.witness,
            verified=epoch.verified,
            confirmed=epoch.confirmed,
            bound=epoch.bound,
            tree=epoch.tree,
            metrics=replace(epoch.metrics, compile_s=self._compiler.seconds),
        )

    def _summary(self) -> Outcome:
        """The last epoch's verdict, with what all of them cost."""
        if not self._epochs:
            return replace(self._outcome, metrics=Metrics(compile_s=self._compiler.seconds))
        total = sum((epoch.metrics for epoch in self._epochs), Metrics())
        several = len(self._epochs) > 1 or self._dynamic
        outcome = self._told(replace(self._epochs[-1], metrics=total))
        return replace(outcome, epochs=tuple(self._epochs) if several else ())

    def centrally(self) -> Outcome:
        """One model of all files, decided by ACE; if the problem changes over time, one for each epoch."""
        from robochoc.solver.ace import AceProcess  # noqa: PLC0415 - start-up: robots need it seldom

        refuse_central(self._team, self._options)
        self._outcome = replace(self._outcome, runtime=CENTRAL)
        count = None
        with AceProcess(always=self._options.local.always_ace) as warm:
            self._solver = self._solver or warm
            for events in range(len(self._team.scenario) + 1):
                changes = self._team.scenario[events - 1].changes if events else ()
                opened = ", ".join(map(describe_change, changes)) or "nothing" if events else "the start"
                count = self._judged(team_after_events(self._team, events), opened)
        outcome = replace(self._summary(), count=count)
        aside = absent(self._team, outcome.assignment) if self._options.withdraw and outcome.verified else ()
        return replace(outcome, withdrawn=aside)

    def _judged(self, team: Team, opened: str) -> int | None:
        """One epoch, decided by ACE; the number of solutions if that was asked for."""
        from robochoc.run.second_opinion import decided  # noqa: PLC0415 - start-up: seldom asked for

        began = time.monotonic()
        count = None
        if self._options.count:
            judgement = self._judge().judge(team, count=True)
            epoch, count = EpochOutcome(judgement.verdict, team.order), judgement.count
        else:
            epoch = decided(self._judge(), team, self._options, int(withdrawal_cost(team)))
        if epoch.verified:
            aside = absent(team, epoch.assignment) if self._options.withdraw else ()
            check(team, epoch.assignment, aside, maximal=epoch.verdict is not Verdict.UNKNOWN)
        spent = Metrics(wall_s=time.monotonic() - began)
        self._epochs.append(replace(epoch, opened_by=opened, metrics=spent))
        return count

    def _confirmed(
        self, team: Team, alone: str | None = None, *, total: float = INFINITE, aside: int | None = None
    ) -> bool:
        """Whether the central judge comes to the same, if it is asked for. Raises `RefutedError` (see `confirmed`)."""
        if not self._options.verify:
            return False
        from robochoc.run.second_opinion import confirmed  # noqa: PLC0415 - start-up: seldom asked for

        return confirmed(self._judge(), team, self._options.protocol, alone, total=total, aside=aside)

    def _judge(self) -> CentralSolver:
        from robochoc.solver.central import CentralSolver  # noqa: PLC0415 - start-up: seldom asked for

        show = partial(self._show, "ACE decides the whole team")
        return CentralSolver(self._cache, self._deadline, show, self._solver, always_ace=self._options.local.always_ace)

    # What an epoch needs

    def _compiled(self, team: Team) -> CompiledTeam:
        """Compile `team` for its next epoch; one robot without a local solution decides the matter, if it is static."""
        return self._compiler.compile(team, every=self._dynamic or bool(self._epochs))

    @property
    def _brief(self) -> RunParameters:
        return RunParameters(self._options.seed, self._options.settings)

    def _session(self, protocol: type[Protocol], team: CompiledTeam, brief: RunParameters) -> Session:
        """`protocol` in the runtime asked for."""
        return open_session(protocol, team, brief, self._options, self._observer, self._progress)

    def _left_s(self) -> float | None:
        return None if self._deadline is None else max(0.0, self._deadline - time.monotonic())

    def _show(self, stage: str) -> None:
        if self._progress:
            self._progress(Progress(0, time.monotonic() - self._began, stage))


def _without(outcome: Outcome, journey: ScenarioRun) -> Outcome:
    """`outcome`, without the robots that were lost on the way."""
    lost = tuple(journey.withdrawn)
    return replace(outcome, withdrawn=lost, lost=lost)
