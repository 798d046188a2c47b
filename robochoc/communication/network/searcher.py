"""One epoch of a robot across machines: from the master's task to the account of what came of it.

The loop around it is `robot.py`'s. What `robot_process.py` does between its queues and its host, this does between
letters and a host.
"""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import islice

import msgspec

from robochoc.communication.control import Conclusion, Counters, Events, Ready
from robochoc.communication.host import BadMessageError, Host
from robochoc.communication.network.control_messages import (
    LATEST,
    Account,
    Checked,
    Copies,
    Exchanged,
    Judged,
    Said,
    Task,
    ToMaster,
)
from robochoc.communication.network.plausibility import MOST_JUDGED, fault_of_findings
from robochoc.communication.network.profile import ProfileError, domain_of
from robochoc.communication.network.quotas import Kept
from robochoc.communication.network.shared import SharedConstraintError, SharedRecord, known_of, record_of
from robochoc.communication.resources import own_memory
from robochoc.journal.events import AnyEvent
from robochoc.model.message import Envelope
from robochoc.model.outcome import Metrics
from robochoc.model.problem import INFINITE, Constraint, ConstraintModel, ProblemKind
from robochoc.protocols.findings import NOTHING, Findings
from robochoc.protocols.protocol import Protocol
from robochoc.solver.agent_problem import AgentProblem, RunParameters
from robochoc.solver.compiled_team import CompiledRobot
from robochoc.solver.encoding import UnsupportedError
from robochoc.solver.explanation import KeyedConstraint, held_above

EVENTS_AT_ONCE = 500
PAIR = 2


@dataclass(frozen=True)
class Surroundings:
    """What a searcher has around it: how it speaks to the master and to others, and what is wanted of it.

    `place` is told the robot's place in the priority order, and how many robots there are.
    """

    say: Callable[[ToMaster], None]
    send: Callable[[str, Said | Copies], None]
    place: Callable[[int, int], None]
    observed: bool
    private: bool


class Searcher:
    """The robot `own`, as it is `among` those of `task`, in its epoch. Raises `UnsupportedError` when it is another."""

    def __init__(
        self,
        own: CompiledRobot,
        task: Task,
        protocol: type[Protocol],
        around: Surroundings,
    ) -> None:
        self.epoch = task.epoch
        self._own = own
        self._robot = own.robot
        self._task = task
        self._protocol = protocol
        self._around = around
        self._host: Host | None = None
        self._copies: dict[str, tuple[SharedRecord, ...]] = {}
        self._learnt: dict[str, list[Constraint]] = {}
        self._early: list[Envelope] = []
        self._kept = Kept()
        self._events: list[AnyEvent] = []
        self._decode = msgspec.msgpack.Decoder(protocol.messages).decode
        self._began = 0.0
        self._sent = self._received = 0
        self._sent_to: Counter[str] = Counter()
        self._received_from: Counter[str] = Counter()
        self._clocks: dict[str, int] = {}
        self._told: tuple[int, int] | None = None
        self._searching = self._concluded = self._paused = False
        if task.interfaces.get(self._robot.name) != self._robot.interface:  # others would misread its values
            raise UnsupportedError(f"{self._robot.name} was told what cannot be: that it shows other variables")

    @property
    def name(self) -> str:
        """The robot's name."""
        return self._robot.name

    @property
    def assignment(self) -> dict[str, int]:
        """The own variables' values as decided; empty while there are none."""
        return self._host.protocol.assignment if self._host else {}

    @property
    def restless(self) -> bool:
        """Whether the master does not know the counters yet."""
        return self._searching and self._told != (self._sent, self._received)

    # Getting ready

    def prepare(self) -> None:
        """Tell others which constraints they have to know; get ready once all children have told.

        Only protocols whose order changes have more than the lowest robot know a constraint (`Traits.shared_scopes`).
        Raises `UnsupportedError`.
        """
        owners = {name: agent for agent, names in self._task.interfaces.items() for name in names}
        self._refuse_unfit(owners)
        if self._protocol.traits.shared_scopes:
            known = [one for one in held_above(self._robot) if one.constraint.model is not ConstraintModel.PKC]
            for parent in self._robot.parents:
                theirs = [one for one in known if parent.name in {owners.get(v) for v in one.constraint.variables}]
                self._around.send(parent.name, Copies(self.epoch, msgspec.msgpack.encode(list(map(record_of, theirs)))))
        self._get_ready()

    def _refuse_unfit(self, owners: Mapping[str, str]) -> None:
        """Raise `UnsupportedError` where the own file asks for more than the protocol can do."""
        robot, traits = self._robot, self._protocol.traits
        refused = f", which {self._task.protocol} does not support"
        if robot.kind is ProblemKind.DISWCSP and not traits.costs:
            raise UnsupportedError(f"{robot.name} is part of a DisWCSP{refused}")
        parts = [part for child in robot.children for part in child.constraints]
        for constraint in (*robot.shared, *parts):
            if constraint.model is ConstraintModel.PKC and not traits.partially_known:
                raise UnsupportedError(
                    f"{robot.name} shares a partially known constraint (PKC, {constraint.name}){refused}"
                )
            if not traits.n_ary and len({owners.get(variable) for variable in constraint.variables}) > PAIR:
                raise UnsupportedError(f"{robot.name} holds a constraint over more than two robots{refused}")

    def learn(self, sender: str, content: bytes) -> None:
        """`sender` holds the constraints in `content`, and this robot is in their scopes. Raises `UnsupportedError`."""
        try:
            self._copies[sender] = msgspec.msgpack.decode(content, type=tuple[SharedRecord, ...])
        except (msgspec.MsgspecError, RecursionError, UnicodeDecodeError) as bad:
            raise UnsupportedError(
                f"{self._robot.name} was told what cannot be: {sender}'s constraints: {bad}"
            ) from None
        self._get_ready()

    def _get_ready(self) -> None:
        shared_scopes = self._protocol.traits.shared_scopes
        if self._host or (shared_scopes and any(child.name not in self._copies for child in self._robot.children)):
            return
        self._host = Host.of(self._protocol, self._part())
        if self._around.observed:
            self._host.observe(self._events.append, self._now)
        self._around.place(self._task.order.index(self._robot.name), len(self._task.order))
        self._around.say(Ready(self.epoch))

    def _part(self) -> AgentProblem:
        task = self._task
        try:
            known = {sender: [self._known(sender, record) for record in told] for sender, told in self._copies.items()}
            domains = {name: domain_of(name, ranges) for name, ranges in task.domains.items()}
        except (SharedConstraintError, ProfileError) as bad:
            raise UnsupportedError(f"{self._robot.name} was told what cannot be: {bad}") from None
        self._learnt = {sender: [one.constraint for one in told] for sender, told in known.items()}
        copies = [one for told in known.values() for one in told]
        brief = RunParameters(task.seed, task.settings, task.aside)
        copied = _sorted(copies, task.order)
        return AgentProblem(self._own, task.order, task.interfaces, copied, domains, task.links, task.secretive, brief)

    def _known(self, sender: str, record: SharedRecord) -> KeyedConstraint:
        """The constraint that `sender` holds: only a child can, over variables that are there, mine among them."""
        known = known_of(record)
        variables = set(known.constraint.variables)
        mine, theirs = (set(self._task.interfaces.get(name, ())) for name in (self._robot.name, sender))
        children = {child.name for child in self._robot.children}
        if (
            sender not in children
            or not variables <= self._task.domains.keys()
            or not (variables & mine and variables & theirs)
        ):
            raise SharedConstraintError(f"{sender} holds {known.constraint.name!r} over what it cannot")
        return known

    # Searching

    def search(self) -> None:
        """All are ready: begin."""
        if self._host is None:
            return
        self._began = time.monotonic()
        self._searching = True
        self._told = (-1, -1)
        self._send(self._host, self._host.start())
        early, self._early = self._early, []
        self._kept.clear()
        self.take_in(early)

    def check(self, content: bytes) -> None:
        """Raises `BadMessageError` when `content` is no message of the protocol, before anything is made of it."""
        try:
            self._decode(content)
        except (msgspec.MsgspecError, RecursionError, UnicodeDecodeError) as error:
            raise BadMessageError(f"it is no message of the protocol: {error}") from None

    def hear(self, envelope: Envelope) -> bool:
        """Whether `envelope` belongs into the packet that is being made up; if not, it waits, or comes too late.

        Raises `BadMessageError` for one of somebody who takes no part in this search, or who says too much before it
        begins.
        """
        if envelope.sender not in self._task.interfaces:
            raise BadMessageError(f"{envelope.sender} takes no part in this search")
        if not self._searching and not self._paused:
            if not self._kept.takes(envelope.sender, len(envelope.content)):
                raise BadMessageError(f"{envelope.sender} says too much before the search has begun")
            self._early.append(envelope)
        return self._searching

    def take_in(self, packet: Sequence[Envelope]) -> None:
        """Give the protocol all messages that wait, unless the search is over. Raises `BadMessageError`."""
        if packet and self._host and self._searching:
            self._received += len(packet)
            for envelope in packet:
                self._received_from[envelope.sender] += 1
                self._clocks[envelope.sender] = max(envelope.clock, self._clocks.get(envelope.sender, 0))
            self._send(self._host, self._host.handle(packet))
            if len(self._events) > EVENTS_AT_ONCE:
                self.report_events()

    def _send(self, host: Host, envelopes: Sequence[Envelope]) -> None:
        for _, receiver, content, clock in envelopes:
            self._around.send(receiver, Said(self.epoch, min(clock, LATEST), content))  # another may have set it so
            self._sent_to[receiver] += 1
        self._sent += len(envelopes)
        self._conclude(host)

    def _conclude(self, host: Host) -> None:
        verdict = host.protocol.verdict
        if verdict is not None and not self._concluded:
            self._concluded = True
            self._around.say(Conclusion(self.epoch, verdict))

    # Reporting

    def tell_counters(self, wave: int) -> None:
        """Tell the master what was sent and taken in: in answer to `wave`, or (0) as there is nothing to do."""
        self._told = (self._sent, self._received)
        self._around.say(Counters(self.epoch, wave, *self._told))

    def report_events(self) -> None:
        """Tell the master what an observer is to be told."""
        events, self._events[:] = list(self._events), []
        for start in range(0, len(events), EVENTS_AT_ONCE):
            self._around.say(Events(events[start : start + EVENTS_AT_ONCE]))

    def pause(self) -> None:
        """Be silent, and report: what still arrives is lost."""
        self._searching, self._paused = False, True
        self.report_events()
        if self._host is None:  # others have not told what they hold, and maybe never will
            self._around.say(Account(self.epoch, False, {}, Metrics(), NOTHING))
            return
        protocol, private = self._host.protocol, self._around.private
        spent = self._host.metrics()
        metrics = replace(spent, ncccs=min(spent.ncccs, LATEST), memory=own_memory())
        assigned = bool(protocol.assignment)  # who steps aside has a value, and none of its variables has
        assignment, findings = ({}, NOTHING) if private else (protocol.assignment, self._findings(protocol))
        self._around.say(Account(self.epoch, assigned, assignment, metrics, findings, self._exchanged()))

    def _findings(self, protocol: Protocol) -> Findings:
        """Return what is known of the whole, partly from others; nothing, if one of them has told what cannot be."""
        return NOTHING if fault_of_findings(protocol.findings, self._task.order) else protocol.findings

    def _exchanged(self) -> dict[str, Exchanged]:
        """The messages with each other robot, by its name."""
        others = self._sent_to.keys() | self._received_from.keys()
        return {
            other: Exchanged(self._sent_to[other], self._received_from[other], self._clocks.get(other, 0))
            for other in others
        }

    def judged(self, told: Mapping[str, int]) -> Checked:
        """Hold all own constraints against what everybody has decided; of robots that stepped aside nothing is asked.

        Also the copies that this robot has of others' constraints. By the problem itself, not by the compiled
        constraints that the protocol works with.
        """
        values = {**told, **self.assignment}
        robot = self._robot
        parts = [part for child in robot.children for part in child.constraints]
        own = robot.private if self.assignment else ()
        held_above = [one for one in (*own, *robot.shared, *parts) if values.keys() >= set(one.variables)]
        cost = sum(constraint.price(values) for constraint in held_above)
        shared = tuple(
            _judged(robot.name, [one for one in robot.shared if one.model is not ConstraintModel.PKC], values)
        )
        known = [*((child.name, child.copies) for child in robot.children), *self._learnt.items()]
        judged = (one for holder, theirs in known for one in _judged(holder, theirs, values))
        copies = tuple(islice(judged, max(0, MOST_JUDGED - len(shared))))  # others may have told any number
        allowed = cost < INFINITE
        return Checked(self.epoch, allowed, cost if allowed else 0, len(held_above), shared, copies)

    def _now(self) -> float:
        return time.monotonic() - self._began


def _judged(holder: str, constraints: Iterable[Constraint], values: Mapping[str, int]) -> Iterator[Judged]:
    """Yield, by scope, what those `constraints` of `holder` charge whose variables all have `values`."""
    groups: dict[tuple[str, ...], list[Constraint]] = {}
    for one in constraints:
        if values.keys() >= set(one.variables):
            groups.setdefault(tuple(sorted(one.variables)), []).append(one)
    for variables, group in groups.items():
        yield Judged(holder, variables, len(group), sum(one.price(values) for one in group))


def _sorted(copies: Sequence[KeyedConstraint], order: Sequence[str]) -> tuple[KeyedConstraint, ...]:
    """In the order of those who hold them, as all runtimes have it, whoever was heard first."""
    rank = {name: place for place, name in enumerate(order)}
    return tuple(sorted(copies, key=lambda known: rank.get(known.key.partition("<")[0], -1)))
