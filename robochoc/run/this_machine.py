"""A team whose robots run on this machine. Every answer is checked against the robots' files."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING, Any

from robochoc.communication.search_result import RobotsLostError, SearchResult
from robochoc.communication.session import Epoch, Session
from robochoc.journal.events import Began, Observer, combined
from robochoc.journal.team_events import TeamWriter, start_fields
from robochoc.model.cost_units import Cost
from robochoc.model.costs import normalized_event, user_cost
from robochoc.model.orders import Order, compute_order, with_dom_deg_order
from robochoc.model.outcome import Approximation, EpochOutcome, Improvement, Metrics, Preprocessing, Verdict
from robochoc.model.problem import INFINITE, ProblemKind, Team
from robochoc.protocols.protocol import Protocol
from robochoc.protocols.requirements import unmet_requirement
from robochoc.run.context import RunContext
from robochoc.run.defaults import REPAIR
from robochoc.run.distributed import Deployment
from robochoc.run.evaluation import PhaseAnswer, Search, check_with_files, nearest_by_files
from robochoc.run.improvement import Audience, Improvements, improvements_of
from robochoc.run.known_costs import DecidedValues
from robochoc.run.options import AnswerRule, Runtime
from robochoc.run.phases import RunPhase, repair_phase
from robochoc.run.preprocessing import preprocessing_phase, removed_values, restricted, total_preprocessing
from robochoc.run.recording import objective_to_record
from robochoc.run.registry import protocol_or_stage
from robochoc.run.runtimes import SessionRequest, open_session
from robochoc.run.scenario import Environment, EpochStart, FinishedEpoch, ScenarioRun
from robochoc.run.stages import Restarts
from robochoc.run.starts import Start, start_in
from robochoc.solver.agent_problem import RunParameters, StartValues
from robochoc.solver.compile import NoLocalSolutionError, TeamCompileTimeoutError
from robochoc.solver.compiled_team import CompiledTeam
from robochoc.system.stopping import stop_requested
from robochoc.verification.objective import withdrawal_cost

if TYPE_CHECKING:
    from robochoc.communication.arrays.session import Layouts


class StartEvents:
    """Reports the start of each search and each epoch to `observer`, if there is one."""

    def __init__(self, observer: Observer | None) -> None:
        self._observer = observer
        self._writer = TeamWriter()

    def report(
        self,
        protocol: type[Protocol],
        start: EpochStart,
        session: Session | None = None,
        *,
        continues: bool = False,
    ) -> None:
        """Report the start of a search.

        Args:
            protocol: The protocol of the search.
            start: The start of the epoch.
            session: The session of the search; None if it is opened later.
            continues: True if earlier searches for the same problem count.
        """
        if self._observer is None:
            return
        epoch, number, opened_by = start
        detail: dict[str, Any] = {"epoch": number, "opened_by": opened_by} if number else {}
        if protocol.traits.costs:
            detail["minimises"] = True
        if continues:
            detail["continues"] = True
        self._observer(Began(t=0, protocol=protocol.__name__, **detail, **start_fields(epoch.parameters)))
        fresh = epoch.team.order if session and session.starts_fresh else epoch.restarted
        lossless = session is None or session.lossless
        self._observer(self._writer.given(epoch.team, epoch.parameters, epoch.invalidated, fresh=fresh, quiet=lossless))


class ThisMachine(Deployment):
    """A team on this machine, in the runtime specified by the options. See `Deployment`.

    `epochs` contains the finished epochs; the list grows during the run.
    """

    def __init__(
        self, team: Team, context: RunContext, environment: Environment | None, audience: Audience | None
    ) -> None:
        """Prepare the run of `team`. Raises `OrderError`."""
        options = context.options
        self.options = options
        self.epochs: list[EpochOutcome] = []
        self._team = team
        self._context = context
        self._environment = environment
        self._audience = audience
        self._improvements: Improvements | None = None
        self._dynamic = team.dynamic or environment is not None
        self._compiler = context.team_compiler()
        self._decided = None if environment is not None else _decided_values(team, context)
        """The robots' decisions that observers have seen."""
        self._observer = combined(context.observer, self._decided)
        self._start_events = StartEvents(self._observer)
        order = compute_order(team, options.order, options.seed) if isinstance(options.order, Order) else options.order
        self._scenario = ScenarioRun(
            team,
            order,
            self._compile,
            context.left_s,
            messages=options.messages,
            spares=options.spares,
            parameters=RunParameters(options.seed, options.settings, message_loss=options.dropped),
            next_parameters=self._next_parameters,
            prepare=None if options.preprocess is None else self._preprocessed,
            with_files=options.runtime == Runtime.NETWORK,
        )
        self._searched = CompiledTeam(team, only=())
        """The compiled team of the last `search`. Before the first search, none of its robots is compiled."""
        self._phase: RunPhase | None = None
        """The phase of the current epoch, with its start."""
        self._stage_team: CompiledTeam | None = None
        """The compiled team of all stages."""
        self._layouts: Layouts = {}
        self._continues = False
        """True if earlier searches for the same problem count."""
        self._preprocessings: list[Preprocessing] = []
        self._cut_short = ""
        """The reason why the last preprocessing did not finish."""

    @property
    def kind(self) -> ProblemKind:
        """See `Deployment.kind`."""
        return self._scenario.team.kind

    def in_user_units(self, total: float) -> Cost:
        """See `Deployment.in_user_units`."""
        return user_cost(self._scenario.team, total)

    @property
    def lost(self) -> tuple[str, ...]:
        """See `Deployment.lost`."""
        return tuple(self._scenario.lost_for_good)

    @property
    def searched(self) -> Approximation | None:
        """See `Deployment.searched`."""
        return self._context.searched(self._team)

    @property
    def is_empty(self) -> bool:
        """See `Deployment.is_empty`."""
        return not self._scenario.team.robots

    @property
    def compile_s(self) -> float:
        """See `Deployment.compile_s`."""
        return self._compiler.seconds

    def withdrawal_cost(self) -> float:
        """See `Deployment.withdrawal_cost`."""
        return withdrawal_cost(self._team)

    def started(self, phase: RunPhase) -> RunPhase:
        """See `Deployment.started`."""
        return self._beginning_with(phase, self.options.start)

    def without_lost(self, phase: RunPhase) -> RunPhase:
        """See `Deployment.without_lost`."""
        return self._beginning_with(phase, phase.parameters.start)

    def _beginning_with(self, phase: RunPhase, values: StartValues) -> RunPhase:
        """Return `phase`, which begins with `values` in the current team."""
        if not values:
            return phase
        return phase.beginning_with(start_in(self._scenario.team, values, phase.parameters.withdrawal_cost))

    def left_s(self) -> float | None:
        """See `Deployment.left_s`."""
        return self._context.left_s()

    def begun_from(self, phase: RunPhase, answer: PhaseAnswer) -> RunPhase:
        """See `Deployment.begun_from`."""
        team = self._scenario.team
        withdrawn = {
            one.name: None for robot in team.robots if robot.name in answer.withdrawn for one in robot.variables
        }
        values = answer.assignment | withdrawn
        return phase.beginning_with(start_in(team, values, phase.parameters.withdrawal_cost)) if values else phase

    def remove(self, lost: Mapping[str, str]) -> None:
        """See `Deployment.remove`. Answers published before are not valid for the remaining robots."""
        self._stage_team, self._continues, self._improvements = None, False, None
        self._scenario.remove(lost.keys())

    def solve(self, phase: RunPhase) -> PhaseAnswer:
        """See `Deployment.solve`. The problem may change in the first phase only."""
        if not phase.withdrawal:
            return self._solve_stage(phase) if self.options.stages else self._solve_epochs(phase)
        answer = replace(super().solve(phase), witness=None)  # `witness` explains the no-solution of the whole team
        return replace(answer, reason=answer.reason or self._absence_reason(answer, withdrawal=True))

    def can_repair(self, phase: RunPhase) -> bool:  # noqa: ARG002 - an implementation needs it
        """See `Deployment.can_repair`."""
        team, traits = self._scenario.team, protocol_or_stage(REPAIR).traits
        return not any(unmet_requirement(robot, traits, team.owner) for robot in team.robots)

    def search(self, phase: RunPhase) -> Search:
        """See `Deployment.search`."""
        team = self._scenario.ordered_team() if self._stage_team is None else self._stage_team.team
        if phase.takes_over and phase.traits.costs and not self._order_requested:
            team = with_dom_deg_order(team)  # faster
        if self._searched.team != team or len(self._searched.robots) < len(team.robots):
            self._searched = self._compiler.compile(team, every=True)
        epoch = Epoch(self._searched, parameters=phase.parameters)
        self._start_events.report(phase.protocol, EpochStart(epoch), continues=self._continues)
        self._continues = bool(self.options.stages)
        with self._session(phase, epoch.compiled) as session:
            session.brief = phase.kept is not None
            self._watch(phase, EpochStart(epoch), session)
            result = session.search(self.search_s(phase), self.options.messages)
            if phase.kept is not None:
                result = self._restarted(phase, session, result)
        return self._checkable(phase, result, self._scenario.team, epoch.compiled)

    def _restarted(self, phase: RunPhase, session: Session, result: SearchResult) -> SearchResult:
        """Restart a search that has ended with `result` until its time is over; return the result of all searches."""
        restarts = Restarts(self._searched, phase)
        restarts.add(result)
        while result.verdict == Verdict.SOLUTION and not (result.lost or stop_requested()) and self.search_s(phase):
            epoch = Epoch(self._searched, parameters=restarts.next_parameters)
            try:
                session.change(epoch)
            except TeamCompileTimeoutError:  # the searches so far count
                break
            self._start_events.report(phase.protocol, EpochStart(epoch), session, continues=True)
            result = session.search(self.search_s(phase), self.options.messages)
            restarts.add(result)
        self.searches = restarts.searches
        return restarts.result(result)

    def confirm(self, phase: RunPhase, answer: PhaseAnswer) -> tuple[str, ...]:
        """See `Deployment.confirm`."""
        if not self.options.verify:
            return ()
        from robochoc.verification.second_opinion import total_cost  # noqa: PLC0415 - start-up: rarely needed

        cost = phase.parameters.withdrawal_cost
        if answer.verdict == Verdict.NO_SOLUTION:
            return self._confirmed(withdrawal_cost=cost)
        total = total_cost(self._scenario.team, answer.assignment, cost)
        return self._confirmed(total=total, withdrawal_cost=cost)

    def limit_reached(self, why: str) -> PhaseAnswer:
        """Return the answer of a run that reached a limit before the search."""
        reason = "; ".join([why, *self._scenario.failed_returns])
        before = total_preprocessing(self._preprocessings)
        return self._with_epochs(PhaseAnswer(Verdict.UNKNOWN, reason=reason, preprocessing=before))

    def _solve_stage(self, phase: RunPhase) -> PhaseAnswer:
        """Return the answer of a stage (`run/stages.py`)."""
        self.searches = 1
        try:
            self._searched = self._stage_team or self._scenario.compiled()
        except NoLocalSolutionError as alone:
            return self._without_local_solution(alone)
        self._stage_team = self._searched
        answer = super().solve(phase)
        why = answer.reason or self._absence_reason(answer, withdrawal=False)
        return replace(answer, reason=why)

    # Epochs

    def _without_local_solution(self, alone: NoLocalSolutionError) -> PhaseAnswer:
        """Return the answer for a team with a robot that has no values."""
        answer = PhaseAnswer(Verdict.NO_SOLUTION, witness=alone.robot, reason=str(alone))
        return answer.confirmed_as(self._confirmed(alone.robot))

    def _solve_epochs(self, phase: RunPhase) -> PhaseAnswer:
        """Return the answer of the last epoch, with the metrics of all epochs."""
        scenario = self._scenario
        self._phase = phase
        answer, lost = PhaseAnswer(Verdict.UNKNOWN), dict[str, str]()
        try:
            compiled = scenario.compiled()
        except NoLocalSolutionError as alone:
            return self._without_local_solution(alone)
        if self.options.preprocess is not None:
            compiled = scenario.prepared()
            if scenario.found is not None and not self._dynamic:
                return self._settled(phase, scenario.found)
        with self._session(phase, compiled) as session:
            start_epoch = partial(self._start_epoch, phase, session)
            for epoch in scenario.epochs(session, start_epoch, phase.parameters):
                answer, lost = self._answer_of(phase, epoch), epoch.result.lost
                shown = answer.for_whole_problem(self.searched)
                self.epochs.append(shown.as_epoch(epoch.team.order, epoch.opened_by, tuple(lost)))
                if self._dynamic or lost:
                    self._restart()
                    self._ask_environment()
                    self._restart()
        if lost:
            raise RobotsLostError(lost)
        answer = self._with_epochs(answer)
        missed = self._missed_events(answer)
        why = self._cut_short or missed or self.why_unknown(phase, answer) or answer.reason
        why = why or self._absence_reason(answer, withdrawal=phase.withdrawal)
        if missed:  # the answer is for a problem that was going to change
            answer = replace(answer, verdict=Verdict.UNKNOWN, deadline=None)
        reasons = filter(None, [why, *scenario.failed_returns])
        return replace(
            answer, reason="; ".join(reasons) or None, preprocessing=total_preprocessing(self._preprocessings)
        )

    def _absence_reason(self, answer: PhaseAnswer, *, withdrawal: bool) -> str | None:
        """Return the constraints that the remaining robots cannot satisfy, as the reason for `no-solution`."""
        if answer.verdict != Verdict.NO_SOLUTION:
            return None
        from robochoc.verification.absence_reason import absence_reason  # noqa: PLC0415 - start-up: rarely needed

        return absence_reason(self._scenario.team, withdrawal=withdrawal) or None

    def _missed_events(self, answer: PhaseAnswer) -> str:
        """Return a note that a limit was reached before some events; empty if there are none, or no answer."""
        left = self._scenario.events_left
        if not left or answer.verdict == Verdict.UNKNOWN:
            return ""
        missed = f"{left} event{'s' * (left != 1)} had not happened"
        return f"{self._limit_reached(answer.metrics)}, and {missed}"

    def _start_epoch(self, phase: RunPhase, session: Session, start: EpochStart) -> None:
        """Report the start of an epoch, and watch its search."""
        self._start_events.report(phase.protocol, start, session)
        self._watch(self._phase or phase, start, session)

    def _next_parameters(self, team: Team) -> RunParameters:
        """Return the parameters of the next epoch, whose team is `team`. It begins from the last assignment.

        Dynamic protocols begin with their own knowledge instead.
        """
        assert self._phase is not None  # noqa: S101 - for mypy: set before the first epoch
        last: Mapping[str, int] = {}
        if not (self.options.cold or self._phase.traits.dynamic):
            last = next((epoch.assignment for epoch in reversed(self.epochs) if epoch.assignment), {})
        self._phase = self._phase.beginning_with(start_in(team, last))
        return self._phase.parameters

    def _restart(self) -> None:
        """Restart the clock if there is a deadline, since each epoch has its own deadline."""
        if self.options.deadline is not None:
            self._context.restart()
            self._compiler.deadline = self._context.deadline

    def _watch(self, phase: RunPhase, start: EpochStart, session: Session) -> None:
        """Publish answers during the search of the new epoch, if the options require it."""
        before, self._improvements = self._improvements, None
        options, audience = self.options, self._audience
        if options.deadline is None or options.improve is None:
            return
        team, compiled = self._scenario.team, start.epoch.compiled

        def publish(answer: PhaseAnswer, improvements: tuple[Improvement, ...]) -> None:
            if audience is not None:
                now = replace(answer, improvements=improvements).for_whole_problem(self.searched)
                audience.improve(team, now.as_epoch(team.order, start.opened_by or "the start"), answer.withdrawn)

        session.watch = self._improvements = improvements_of(
            phase,
            team,
            options,
            began=self._context.began,
            in_user_units=self.in_user_units,
            check=lambda snapshot: check_with_files(phase, snapshot, team, compiled),
            publish=publish,
            audience=audience,
            before=before,
        )

    def concluded(self, phase: RunPhase, search: Search, answer: PhaseAnswer) -> PhaseAnswer:  # noqa: ARG002 - see `Deployment`
        """See `Deployment.concluded`. Answers published before a robot was lost do not count."""
        improvements = self._improvements
        return improvements.concluded(answer, lost=bool(search.result.lost)) if improvements else answer

    def _preprocessed(self) -> tuple[CompiledTeam, SearchResult | None]:
        """Let the robots make their domains consistent; return the restricted team. See `scenario.Prepare`.

        The robots start from the domains in the files, so values that a removed constraint had excluded return.
        """
        self._cut_short = ""
        if self.is_empty:
            return self._scenario.compiled(), None
        phase = preprocessing_phase(self.options)
        result = self._search_without_losses(phase)[1].result
        whole = self._searched
        values = sum(len(robot.domain.values) for robot in whole.robots.values())
        self._preprocessings.append(
            Preprocessing(phase.name, result.metrics, removed_values(whole, result.findings), values)
        )
        if result.verdict == Verdict.SOLUTION:
            return self._compile(restricted(whole, result.findings)), None
        if result.verdict == Verdict.UNKNOWN:
            self._cut_short = self.why_unknown(phase, PhaseAnswer(result.verdict, metrics=result.metrics)) or ""
        return whole, SearchResult.of(result.verdict, result.witness, {}, (), 0)

    def _settled(self, phase: RunPhase, found: SearchResult) -> PhaseAnswer:
        """Return the answer of a run that the preprocessing has already decided."""
        before = total_preprocessing(self._preprocessings)
        answer = PhaseAnswer(found.verdict, witness=found.witness, reason=self._cut_short or None, preprocessing=before)
        return answer.confirmed_as(self.confirm(phase, answer)) if found.verdict == Verdict.NO_SOLUTION else answer

    def _answer_of(self, phase: RunPhase, epoch: FinishedEpoch) -> PhaseAnswer:
        """Return the answer of an epoch, checked against the files."""
        current = self._phase
        if current is not None and epoch.epoch.parameters is current.parameters:
            phase = current
        else:  # the team could not be compiled in time
            phase = phase.beginning_with(Start({}))
        search = self._checkable(phase, epoch.result, epoch.team, epoch.epoch.compiled)
        answer = self.evaluated(phase, search)
        if self.needs_repair(phase, answer):
            answer = self._repaired(epoch, answer)
        self._improvements = None
        return answer

    def _repaired(self, epoch: FinishedEpoch, answer: PhaseAnswer) -> PhaseAnswer:
        """Return the answer of a repair in `epoch`, or `answer` if a robot is lost during the repair."""
        repair = repair_phase(self.options, answer.nearest)
        number, compiled = len(self.epochs), epoch.epoch.compiled
        start = EpochStart(Epoch(compiled, parameters=repair.parameters), number, epoch.opened_by if number else "")
        self._start_events.report(repair.protocol, start)
        with self._session(repair, compiled) as session:
            self._watch(repair, start, session)
            result = session.search(self.left_s())
        search = self._checkable(repair, result, epoch.team, compiled)
        return answer if search.result.lost else answer.repaired(self.evaluated(repair, search), repair.name)

    def _checkable(self, phase: RunPhase, result: SearchResult, team: Team, compiled: CompiledTeam) -> Search:
        """Return a finished search whose assignment is checked against the files of `team`."""
        final = self.options.answer == AnswerRule.FINAL
        check = partial(check_with_files, phase, result, team, compiled, self._decided, final=final)
        return Search(result, check, partial(nearest_by_files, result, team, compiled))

    def _ask_environment(self) -> None:
        """Pass the last epoch's answer to the environment, if there is one. The environment may add an event."""
        if self._environment is None:
            return
        left_s = 0 if self._scenario.is_over else None if self.options.deadline is not None else self.left_s()
        event = self._environment(self._scenario.team, self.epochs[-1], left_s)
        if event:
            self._scenario.add_event(normalized_event(self._scenario.team, event))

    def _with_epochs(self, answer: PhaseAnswer) -> PhaseAnswer:
        """Return the last epoch's `answer`, with the metrics of all epochs."""
        spent = sum((epoch.metrics for epoch in self.epochs), Metrics())
        several = len(self.epochs) > 1 or self._dynamic
        return replace(answer, metrics=spent, epochs=tuple(self.epochs) if several else ())

    # Parts of an epoch

    @property
    def _order_requested(self) -> bool:
        return self.options.order is not None and "order" not in self.options.chosen

    def _compile(self, team: Team) -> CompiledTeam:
        """Compile `team` for its next epoch. In a static problem, a robot without a local solution ends the run."""
        return self._compiler.compile(team, every=self._dynamic or bool(self.epochs))

    def _session(self, phase: RunPhase, compiled: CompiledTeam) -> Session:
        """Open a session for the phase's protocol."""
        context, options = self._context, self.options
        if options.runtime == Runtime.ARRAYS and not phase.traits.arrays:  # a repair
            options = replace(options, runtime=Runtime.SIMULATOR, cluster=None)
        request = SessionRequest(
            phase.protocol,
            compiled,
            phase.parameters,
            options,
            self._observer,
            context.progress,
            context.kills,
            changes=self._dynamic,
            deadline=None if self._dynamic and self.options.deadline is not None else context.deadline,
            restarts=phase.kept is not None,
            layouts=self._layouts if self.options.stages else None,
        )
        return open_session(request)

    def _confirmed(
        self, alone: str | None = None, *, total: float = INFINITE, withdrawal_cost: float | None = None
    ) -> tuple[str, ...]:
        """Return the central solvers that confirm an answer, if required by the options. Arguments: see `confirmed`."""
        if not self.options.verify:
            return ()
        from robochoc.verification.second_opinion import confirmed  # noqa: PLC0415 - start-up: rarely needed

        cost = None if withdrawal_cost is None else int(withdrawal_cost)
        solvers, team = self._context.second_opinions(), self._scenario.team
        return confirmed(solvers, team, self.options.protocol, alone, total=total, withdrawal_cost=cost)


def _decided_values(team: Team, context: RunContext) -> DecidedValues | None:
    """Return an observer of the decisions of `team`, or None if nobody observes the run or nothing is minimised."""
    if context.observer is None or context.options.answer == AnswerRule.FINAL:
        return None
    objective = objective_to_record(team, context.options)
    return None if objective is None else DecidedValues(objective())
