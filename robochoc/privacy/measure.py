"""Measures the privacy loss in a recorded run, assuming that only the receiver of a message can read it."""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import replace

import msgspec

from robochoc.communication.search_result import Progress
from robochoc.journal.events import Decided, Received, Sent
from robochoc.journal.journal import Journal
from robochoc.journal.team_events import run_parameters_of, with_start
from robochoc.model.outcome import Verdict
from robochoc.model.problem import ConstraintModel
from robochoc.privacy.coalitions import CoalitionReport, coalition_report
from robochoc.privacy.errors import PrivacyError
from robochoc.privacy.losses import Kind, Loss, PrivacyReport, loss_between
from robochoc.privacy.observer import Observer, RunFacts
from robochoc.privacy.possible import Secret
from robochoc.privacy.secrets import TeamSecrets, TooManySecretsError
from robochoc.protocols.message import Message, Value
from robochoc.protocols.order import PseudoTree
from robochoc.replay.rebuild import CannotReplayError, Rebuilder, RebuiltRobots, ReplayOptions
from robochoc.replay.replay import PROGRESS_EVERY
from robochoc.replay.steps import RecordedRun, runs_of
from robochoc.run.defaults import CENTRAL
from robochoc.run.registry import protocol_by_class
from robochoc.sniffer.recorded_messages import message_of, types_by_name
from robochoc.solver.agent_problem import RunParameters
from robochoc.solver.compile import Compiler

Edge = tuple[str, str]


def privacy_of(
    journal: Journal,
    options: ReplayOptions | None = None,
    number: int | None = None,
    *,
    progress: Callable[[Progress], None] | None = None,
) -> PrivacyReport:
    """Return the privacy loss in a run.

    Args:
        journal: The journal, including the robots' problems.
        options: Inputs besides the journal (`replay/rebuild.py`).
        number: The number of the run, from 1; None for the last run.
        progress: Called with the progress.

    Raises:
        PrivacyError: if the run does not exist, or required data are missing.
    """
    runs, number, robots = _rebuilt(journal, options, number)
    try:
        return _RunMeasurement(journal, runs, number, robots, progress).report()
    except CannotReplayError as why:
        raise PrivacyError(str(why), broken=why.broken) from why
    except TooManySecretsError as why:
        raise PrivacyError(str(why)) from why


def coalitions_of(
    journal: Journal,
    size: int,
    options: ReplayOptions | None = None,
    number: int | None = None,
    *,
    coins: int = 1,
) -> CoalitionReport:
    """Return the losses to each coalition of `size` robots in a run, which is repeated (`privacy/coalitions.py`).

    Args:
        journal: The journal, including the robots' problems.
        size: The number of robots in a coalition.
        options: Inputs besides the journal (`replay/rebuild.py`).
        number: The number of the run, from 1; None for the last run.
        coins: The number of seeds to try for the other robots' random numbers.

    Raises:
        PrivacyError: if the run does not exist, required data are missing, robots continue with results of an earlier
            run, or the team is too large.
    """
    runs, number, robots = _rebuilt(journal, options, number)
    if robots.continuing:
        raise PrivacyError(
            f"in run {number}, robots continue with results of an earlier run, which cannot be repeated with other"
            " tables: measure the first run (--run 1)"
        )
    run = runs[number - 1]
    parameters = with_start(RunParameters() if run.given is None else run_parameters_of(run.given), run.began)
    used = options or ReplayOptions()
    with Compiler(used.limits, solver=used.solver) as compiler:
        found = coalition_report(
            robots.compiled.team,
            robots.protocol,
            size,
            parameters=parameters,
            coins=coins,
            compile_robot=lambda robot: compiler.compile(robot).domain,
        )
    return replace(found, protocol=_protocol_name(journal, robots))


def _rebuilt(
    journal: Journal, options: ReplayOptions | None, number: int | None
) -> tuple[list[RecordedRun], int, RebuiltRobots]:
    """Return all runs, the number of the run to be measured, and its robots. Raises `PrivacyError`."""
    runs = list(runs_of(journal.events))
    if not runs:
        if journal.header.protocol == CENTRAL:
            raise PrivacyError("no robot sent a message: the central solver got the problems of all robots")
        raise PrivacyError("the journal ends before the beginning of a run")
    number = len(runs) if number is None else number
    if not 1 <= number <= len(runs):
        raise PrivacyError(f"the journal has no run {number}, only {len(runs)}")
    try:
        rebuilder = Rebuilder(journal.header, options or ReplayOptions())
        return runs, number, [rebuilder.robots_of(run) for run in runs[:number]][-1]
    except CannotReplayError as why:
        raise PrivacyError(str(why), broken=why.broken) from why


def _protocol_name(journal: Journal, robots: RebuiltRobots) -> str:
    found = protocol_by_class(robots.protocol.__name__, [journal.header.protocol])
    return found[0] if found else robots.protocol.__name__


class _RunMeasurement:
    """Measures one run: its observers process all messages, and `report` computes the losses."""

    def __init__(
        self,
        journal: Journal,
        runs: Sequence[RecordedRun],
        number: int,
        robots: RebuiltRobots,
        progress: Callable[[Progress], None] | None,
    ) -> None:
        self._progress = progress
        self._encode = msgspec.msgpack.Encoder(enc_hook=str).encode
        self._last_message: tuple[str, bytes, Message] | None = None
        self._journal = journal
        self._runs = len(runs)
        self._number = number
        self._run = runs[number - 1]
        self._robots = robots
        self._name = _protocol_name(journal, robots)
        self._types = types_by_name(robots.protocol)
        self._team = robots.compiled.team
        given = self._run.given
        self._parameters = RunParameters() if given is None else run_parameters_of(given)
        self._secrets = TeamSecrets(robots.compiled, self._parameters)
        facts = RunFacts(
            secrets=self._secrets,
            order=self._team.order,
            branches=self._branches(),
            fixed_holders=not robots.protocol.traits.shared_scopes,
            one_sided=robots.protocol.traits.asymmetric
            and any(one.model == ConstraintModel.PKC for one in self._team.constraints()),
            minimises=any(host.protocol.problem.has_costs for host in robots.hosts.values()),
        )
        self._without_knowledge: dict[tuple[str, Kind, bool], Loss | None] = {}
        self._observers = {
            name: Observer(facts, name, host.protocol.problem.values) for name, host in robots.hosts.items()
        }

    def report(self) -> PrivacyReport:
        """Process every message, and return the losses."""
        self._process_messages()
        for observer in self._observers.values():
            observer.knowledge.settle()
        decided, undecided = self._decisions()
        losses = [loss for one in self._observers.values() for loss in self._losses(one, decided)]
        return PrivacyReport(
            team=self._team.name,
            protocol=self._name,
            run=self._number,
            runs=self._runs,
            robots=tuple(self._team.order),
            losses=tuple(losses),
            without_rule=tuple(sorted({kind for one in self._observers.values() for kind in one.without_rule})),
            undecided=undecided,
        )

    def _branches(self) -> Mapping[str, Sequence[str]]:
        """For each robot, return the robots whose values are in its partial assignments."""
        order = self._team.order
        if not self._robots.protocol.traits.tree:
            return dict.fromkeys(order, order)
        links = {robot.name: [parent.name for parent in robot.parents] for robot in self._team.robots}
        tree = PseudoTree.induced(order, links)
        return {name: (*reversed(tree.ancestors(name)), name) for name in order}

    def _process_messages(self) -> None:
        """Deliver all received messages in order; then invalidate the values in messages that were not received."""
        in_transit: dict[Edge, deque[tuple[Sent, Message]]] = {}
        began, number = time.monotonic(), 0
        for event in self._run.events:
            match event:
                case Sent():
                    number += 1
                    if self._progress and number % PROGRESS_EVERY == 0:
                        self._progress(Progress(number, time.monotonic() - began))
                    if self._observers.keys().isdisjoint((event.sender, event.receiver)):
                        continue
                    message = self._message(event)
                    in_transit.setdefault((event.sender, event.receiver), deque()).append((event, message))
                    if event.sender in self._observers:
                        with _rule_errors(event):
                            self._observers[event.sender].sends(event.receiver, message)
                case Received():
                    waiting = in_transit.get((event.sender, event.receiver))
                    if waiting and event.receiver in self._observers:
                        sent, message = waiting.popleft()
                        with _rule_errors(sent):
                            self._observers[event.receiver].receives(sent.sender, message)
                case _:
                    pass
        for sent, message in [one for waiting in in_transit.values() for one in waiting]:
            if sent.receiver in self._observers:
                self._observers[sent.receiver].loses(sent.sender, message)

    def _message(self, sent: Sent) -> Message:
        """Return the message, which is decoded once if several robots receive it one after the other."""
        packed = self._encode(sent.content)
        if self._last_message and self._last_message[:2] == (sent.type, packed):
            return self._last_message[2]
        kind = self._types.get(sent.type)
        message = None if kind is None else message_of(kind, sent.content)
        if message is None:
            raise PrivacyError(f"{sent.type} from {sent.sender} is not a message of this protocol", broken=True)
        self._last_message = sent.type, packed, message
        return message

    # Results

    def _losses(self, observer: Observer, decided: Mapping[str, Value]) -> Iterator[Loss]:
        """Yield the losses of all subjects to an observer."""
        known = not observer.without_rule
        for subject in self._team.order:
            if subject == observer.name:
                continue
            if subject in decided:
                values = observer.possible_values(subject)
                if known and decided[subject] not in values:
                    raise self._wrong(observer, subject, "decision")
                numbers = [(len(self._secrets.declared[subject]), len(values))]
                yield from _there(loss_between(observer.name, subject, Kind.DECISION, numbers, known=known))
            for kind in (Kind.DOMAIN, Kind.CONSTRAINTS):
                yield from _there(self._loss(observer, subject, kind, known=known))

    def _loss(self, observer: Observer, subject: str, kind: Kind, *, known: bool) -> Loss | None:
        """Return the loss of one kind. It is the same for all observers without knowledge of the subject's secrets."""
        of_subject = self._secrets.charges[subject].values() if kind == Kind.DOMAIN else self._secrets.entries[subject]
        if not observer.knowledge.known.keys().isdisjoint(of_subject):
            return self._computed_loss(observer, subject, kind, known=known)
        if (subject, kind, known) not in self._without_knowledge:
            computed = self._computed_loss(observer, subject, kind, known=known)
            self._without_knowledge[subject, kind, known] = computed
        found = self._without_knowledge[subject, kind, known]
        return None if found is None else replace(found, observer=observer.name)

    def _computed_loss(self, observer: Observer, subject: str, kind: Kind, *, known: bool) -> Loss | None:
        charged = kind == Kind.DOMAIN
        unknown = self._secrets.unknown_charges if charged else self._secrets.unknown_entries
        numbers = [self._numbers(observer, subject, secret) for secret in unknown(subject, observer.name)]
        return loss_between(observer.name, subject, kind, numbers, known=known)

    def _numbers(self, observer: Observer, subject: str, secret: Secret) -> tuple[int, int]:
        """Return the number of all states of a secret, and of those still possible. The true state must be possible."""
        possible = observer.knowledge[secret]
        if not possible.contains(self._secrets.truths[secret]):
            raise self._wrong(observer, subject, "problem")
        return self._secrets.most + 2, possible.number

    @staticmethod
    def _wrong(observer: Observer, subject: str, what: str) -> PrivacyError:
        return PrivacyError(
            f"the messages to {observer.name} exclude the true {what} of {subject}:"
            " the journal was altered, or the rule of a message is wrong",
            broken=True,
        )

    def _decisions(self) -> tuple[dict[str, Value], str]:
        """Return the values of the robots in the answer and an empty text, or no values and the reason."""
        outcome = self._journal.outcome
        if self._number < self._runs:
            return {}, "only the last run of a journal has the team's decision"
        if not self._robots.protocol.traits.complete:
            return {}, "the protocol is incomplete, and its robots need not send their last values"
        if outcome is None or outcome.verdict not in {Verdict.SOLUTION, Verdict.OPTIMAL}:
            return {}, "the run found no solution"
        last: dict[str, Mapping[str, int]] = {}
        for event in self._run.events:
            if isinstance(event, Decided):
                last[event.robot] = event.assignment
        final = {name: value for assignment in last.values() for name, value in assignment.items()}
        if final != outcome.assignment:
            return {}, "the answer is not the robots' last values, so messages do not reveal it"
        decided: dict[str, Value] = {}
        for robot in self._team.robots:
            value = tuple(outcome.assignment.get(name) for name in robot.interface)
            if value in self._secrets.declared[robot.name]:
                decided[robot.name] = value
        return decided, ""


def _there(loss: Loss | None) -> Iterator[Loss]:
    if loss is not None:
        yield loss


@contextmanager
def _rule_errors(sent: Sent) -> Iterator[None]:
    """Reject the journal if a message has invalid content."""
    try:
        yield
    except (LookupError, ValueError) as error:
        raise PrivacyError(
            f"{sent.type} from {sent.sender} to {sent.receiver} has invalid content: {error}", broken=True
        ) from error
