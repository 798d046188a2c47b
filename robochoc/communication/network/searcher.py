"""One epoch for a robot in a run across machines: from the master's task to the final report.

The connection to the run is in `robot.py`, the loop of a search in `communication/robot_loop.py`.
"""

from __future__ import annotations

import secrets
from bisect import bisect_right
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import islice

import msgspec

from robochoc.communication.control import RobotMessage, RobotSnapshot
from robochoc.communication.host import BadMessageError, Host
from robochoc.communication.network.constraint_records import SharedConstraintError, SharedRecord, known_of, record_of
from robochoc.communication.network.control_messages import (
    LATEST,
    Charge,
    CheckResult,
    Copies,
    DetailedReport,
    Exchanged,
    ProtocolMessage,
    Recall,
    SearchTask,
    ToMaster,
    ToPeer,
)
from robochoc.communication.network.framing import LARGEST_FRAME, FrameRefusedError
from robochoc.communication.network.plausibility import MOST_CHARGES, fault_of_findings
from robochoc.communication.network.profile import ProfileError, domain_of
from robochoc.communication.network.quotas import Backlog
from robochoc.communication.resources import own_memory
from robochoc.communication.robot_loop import RobotLoop
from robochoc.model.absence import restated
from robochoc.model.outcome import Metrics
from robochoc.model.problem import INFINITE, Constraint, ConstraintModel, Robot
from robochoc.protocols.findings import NO_FINDINGS, Findings, Trail
from robochoc.protocols.message import Envelope
from robochoc.protocols.protocol import Protocol
from robochoc.protocols.requirements import unmet_requirement
from robochoc.solver.agent_problem import AgentProblem, RunParameters, TeamKnowledge
from robochoc.solver.compiled_domain import CompiledDomain
from robochoc.solver.compiled_team import CompiledRobot
from robochoc.solver.errors import UnsupportedError
from robochoc.solver.explanation import KeyedConstraint, constraints_above
from robochoc.system.lazy_dataclass import dataclass


def check_constraints(
    epoch: int,
    robot: Robot,
    values: Mapping[str, int],
    learnt: Mapping[str, Sequence[Constraint]],
) -> CheckResult:
    """Return the costs of the constraints known to `robot`, for the team's decision.

    The costs are computed from the problem itself, not from the protocol's compiled constraints.

    Args:
        epoch: The epoch of the search.
        robot: The robot.
        values: The decided values of all variables known to the robot. Withdrawn robots have no values, and constraints
            over their variables are restated for the other robots or dropped (`model/absence.py`).
        learnt: The constraints that the robot has received from others, by their holders.
    """
    parts = [part for child in robot.children for part in child.constraints]
    known_to_it = (_in_force(one, values) for one in (*robot.private, *robot.shared, *parts))
    held = [one for one in known_to_it if one is not None]
    prices = [constraint.price(values) for constraint in held]
    cost, broken = sum(prices), prices.count(INFINITE)
    hard = sum(one.is_hard or price == INFINITE for one, price in zip(held, prices, strict=True))
    shared = tuple(_charges(robot.name, [one for one in robot.shared if one.model != ConstraintModel.PKC], values))
    known = [*((child.name, child.copies) for child in robot.children), *learnt.items()]
    charges = (one for holder, theirs in known for one in _charges(holder, theirs, values))
    copies = tuple(islice(charges, max(0, MOST_CHARGES - len(shared))))  # others may have sent any number
    allowed = cost < INFINITE
    return CheckResult(epoch, allowed, cost if allowed else 0, len(held), shared, copies, hard=hard, broken=broken)


def _charges(holder: str, constraints: Iterable[Constraint], values: Mapping[str, int]) -> Iterator[Charge]:
    """Yield the costs, by scope, of those `constraints` of `holder` that are in force."""
    groups: dict[tuple[str, ...], list[Constraint]] = {}
    for one in constraints:
        in_force = _in_force(one, values)
        if in_force is not None:
            groups.setdefault(tuple(sorted(one.variables)), []).append(in_force)
    for variables, group in groups.items():
        yield Charge(holder, variables, len(group), sum(one.price(values) for one in group))


def _in_force(constraint: Constraint, values: Mapping[str, int]) -> Constraint | None:
    """Return `constraint`, restated without the robots that have no values, or None if it is dropped."""
    return restated(constraint, {name for name in constraint.variables if name not in values})


_Values = dict[str, int]


@dataclass(frozen=True)
class RobotContext:
    """The searcher's interface to the robot's connection to the run.

    Attributes:
        send_to_master: Sends a control message to the master.
        send: Sends a message to another robot.
        set_rank: Called with the robot's index in the priority order, and the number of robots.
        observed: True if the robot reports its events.
        private: True if robots do not disclose their values in this run.
    """

    send_to_master: Callable[[ToMaster], None]
    send: Callable[[str, ToPeer], None]
    set_rank: Callable[[int, int], None]
    observed: bool
    private: bool


class Searcher(RobotLoop):
    """The search of the robot `own` in the epoch of `task`.

    Args:
        own: The robot, linked to the other participants.
        task: The master's task, which contains the common knowledge of the team.
        protocol: The protocol to run.
        context: The robot's connection to the run.

    Raises:
        UnsupportedError: if the task is for another robot.
    """

    bundle_bytes = LARGEST_FRAME // 4

    def __init__(self, own: CompiledRobot, task: SearchTask, protocol: type[Protocol], context: RobotContext) -> None:
        super().__init__(task.epoch, observed=context.observed)
        self._own = own
        self._robot = own.robot
        self._task = task
        self._protocol = protocol
        self._context = context
        self._copies: dict[str, tuple[SharedRecord, ...]] = {}
        self._learnt: dict[str, list[Constraint]] = {}
        self._early_share = Backlog()
        self._decode = msgspec.msgpack.Decoder(protocol.messages).decode
        self._sent_to: Counter[str] = Counter()
        self._received_from: Counter[str] = Counter()
        self._clocks: dict[str, int] = {}
        self._snapshot_values = SnapshotValues()
        if task.interfaces.get(self._robot.name) != self._robot.interface:  # other robots would misread its values
            raise UnsupportedError(
                f"{self._robot.name} received invalid data: the interface variables differ from those in its file"
            )

    @property
    def name(self) -> str:
        """The robot's name."""
        return self._robot.name

    @property
    def assignment(self) -> dict[str, int]:
        """The decided values of the robot's variables; empty while no decision exists.

        If the master has ordered the robot to adopt a snapshot, these are the values in that snapshot.
        """
        adopted = self._snapshot_values.adopted
        return self._present if adopted is None else adopted

    @property
    def _present(self) -> dict[str, int]:
        return self._host.protocol.assignment if self._host else {}

    # Preparation

    def prepare(self) -> None:
        """Send constraints to the robots that must know them. The robot is ready when all children have sent theirs.

        Robots other than the lowest one in a scope know a constraint only with `Traits.shared_scopes`. Raises
        `UnsupportedError`.
        """
        owners = {name: agent for agent, names in self._task.interfaces.items() for name in names}
        self._refuse_unfit(owners)
        if self._protocol.traits.shared_scopes:
            known = [one for one in constraints_above(self._robot) if one.constraint.model != ConstraintModel.PKC]
            for parent in self._robot.parents:
                theirs = [one for one in known if parent.name in {owners.get(v) for v in one.constraint.variables}]
                copies = Copies(self.epoch, msgspec.msgpack.encode(list(map(record_of, theirs))))
                self._context.send(parent.name, copies)
        self._get_ready()

    def _refuse_unfit(self, owners: Mapping[str, str]) -> None:
        """Raise `UnsupportedError` if this robot's file needs more than the protocol supports."""
        if unmet := unmet_requirement(self._robot, self._protocol.traits, owners):
            raise UnsupportedError(f"{unmet}, which {self._task.protocol} does not support")

    def learn(self, sender: str, content: bytes) -> None:
        """Receive constraints from `sender` that contain variables of this robot. Raises `UnsupportedError`."""
        try:
            self._copies[sender] = msgspec.msgpack.decode(content, type=tuple[SharedRecord, ...])
        except (msgspec.MsgspecError, RecursionError, UnicodeDecodeError) as bad:
            raise UnsupportedError(f"{self._robot.name} received invalid data: {sender}'s constraints: {bad}") from None
        self._get_ready()

    def _get_ready(self) -> None:
        shared = self._protocol.traits.shared_scopes
        if self._host or (shared and any(child.name not in self._copies for child in self._robot.children)):
            return
        host = Host.create(self._protocol, self._part())
        host.protocol.secret = secrets.randbits
        self._context.set_rank(self._task.order.index(self._robot.name), len(self._task.order))
        self.confirm(host)

    def _part(self) -> AgentProblem:
        task = self._task
        try:
            known = {sender: [self._known(sender, one) for one in records] for sender, records in self._copies.items()}
            domains = {name: domain_of(name, ranges) for name, ranges in task.domains.items()}
        except (SharedConstraintError, ProfileError) as bad:
            raise UnsupportedError(f"{self._robot.name} received invalid data: {bad}") from None
        self._learnt = {sender: [one.constraint for one in theirs] for sender, theirs in known.items()}
        copies = _sorted([one for theirs in known.values() for one in theirs], task.order)
        parameters = RunParameters(
            task.seed, task.settings, task.aside, task.message_loss, task.start, task.upper_bound
        )
        everyone = TeamKnowledge(tuple(task.order), task.interfaces, domains, task.links)
        return AgentProblem(self._own, everyone, copies, task.secretive, parameters)

    def _known(self, sender: str, record: SharedRecord) -> KeyedConstraint:
        """Return a constraint from `sender`, which must be a child. The scope must contain variables of both robots."""
        known = known_of(record)
        variables = set(known.constraint.variables)
        mine, theirs = (set(self._task.interfaces.get(name, ())) for name in (self._robot.name, sender))
        children = {child.name for child in self._robot.children}
        if (
            sender not in children
            or not variables <= self._task.domains.keys()
            or not (variables & mine and variables & theirs)
        ):
            raise SharedConstraintError(f"{sender} has sent {known.constraint.name!r}, whose scope is not allowed")
        return known

    # Messages

    def check(self, content: bytes) -> None:
        """Raise `BadMessageError` if `content` is not a message of the protocol."""
        try:
            self._decode(content)
        except (msgspec.MsgspecError, RecursionError, UnicodeDecodeError) as error:
            raise BadMessageError(f"it is not a message of the protocol: {error}") from None

    def admit(self, envelope: Envelope) -> bool:
        """See `RobotLoop.admit`.

        Raises:
            BadMessageError: if the sender does not participate in this search, or has sent too much before its start.
        """
        if envelope.sender not in self._task.interfaces:
            raise BadMessageError(f"{envelope.sender} does not take part in this search")
        is_early = not (self._searching or self._paused)
        if is_early and not self._early_share.accept(envelope.sender, len(envelope.content)):
            raise BadMessageError(f"{envelope.sender} has sent too many messages before the start of the search")
        return super().admit(envelope)

    def receive(self, packet: Sequence[Envelope]) -> None:
        """See `RobotLoop.receive`. Messages are counted by sender, because the master compares the counts."""
        if self._host and self._searching:
            for envelope in packet:
                self._received_from[envelope.sender] += 1
                self._clocks[envelope.sender] = max(envelope.clock, self._clocks.get(envelope.sender, 0))
        super().receive(packet)

    def _transmit(self, envelopes: Sequence[Envelope]) -> None:
        for envelope in envelopes:
            # Another robot may have set this clock.
            message = ProtocolMessage(self.epoch, min(envelope.clock, LATEST), envelope.content)
            self._context.send(envelope.receiver, message)
            self._sent_to[envelope.receiver] += 1

    # Reports

    def _send_to_master(self, message: RobotMessage) -> None:
        self._context.send_to_master(message)

    def _report_end(self) -> None:
        if self._host is None:  # the constraints of a child have not arrived, and may never arrive
            self._context.send_to_master(DetailedReport(self.epoch, {}, Metrics(), NO_FINDINGS, assigned=False))
            return
        metrics = self._host.metrics()
        metrics = replace(metrics, ncccs=min(metrics.ncccs, LATEST), memory=own_memory())
        assigned = bool(self._present)  # a withdrawn robot has a value, but its variables have none
        values, findings = self._known_to_master(self._host)
        self._context.send_to_master(DetailedReport(self.epoch, values, metrics, findings, assigned, self._exchanged()))

    def _known_to_master(self, host: Host) -> tuple[dict[str, int], Findings]:
        """See `RobotLoop`. In private runs nothing is returned."""
        return ({}, NO_FINDINGS) if self._context.private else (host.protocol.assignment, self._findings(host.protocol))

    def _findings(self, protocol: Protocol) -> Findings:
        """Return the findings, or no findings if one that comes from other robots is invalid.

        The trail is left out, because in a long search it does not fit into a frame. A master that sends `Recall`
        requests the cycles that it needs.
        """
        findings = protocol.findings
        if findings.trail is not None and self._snapshot_values.is_used:
            findings = msgspec.structs.replace(findings, trail=Trail([], findings.trail.cycle))
        return NO_FINDINGS if fault_of_findings(findings, self._task.order) else findings

    def _exchanged(self) -> dict[str, Exchanged]:
        """Return the number of messages exchanged with each other robot."""
        others = self._sent_to.keys() | self._received_from.keys()
        return {
            other: Exchanged(self._sent_to[other], self._received_from[other], self._clocks.get(other, 0))
            for other in others
        }

    def recall(self, order: Recall) -> None:
        """Send the requested values to the master, and store them until they are checked. The search continues."""
        host = self._host
        if host is None:
            return
        private = self._context.private
        values = {} if private else values_for_recall(order, host.protocol, self._own.domain)
        self._snapshot_values.note(order.number, values)
        findings = NO_FINDINGS if private else self._findings(host.protocol)
        lost = 0 if host.dropper is None else host.dropper.count
        self._send_to_master(RobotSnapshot(self.epoch, order.number, values, lost, findings))

    def adopt(self, number: int, *, published: bool) -> None:
        """Keep the values in a snapshot; see `SnapshotValues.adopt`. Raises `FrameRefusedError`."""
        self._snapshot_values.adopt(number, published=published)

    def check_constraints(self, values: Mapping[str, int], snapshot: int = 0) -> CheckResult:
        """Check the robot's constraints against the team's decision or a `snapshot`, by `check_constraints`.

        Raises `FrameRefusedError` if the snapshot is unknown.
        """
        own = self._snapshot_values.at(snapshot) if snapshot else self._present
        found = check_constraints(self.epoch, self._robot, {**values, **own}, self._learnt)
        return msgspec.structs.replace(found, snapshot=snapshot)


def _sorted(copies: Sequence[KeyedConstraint], order: Sequence[str]) -> tuple[KeyedConstraint, ...]:
    """Return `copies` in the order of their holders, like in all runtimes."""
    rank = {name: place for place, name in enumerate(order)}
    return tuple(sorted(copies, key=lambda known: rank.get(known.key.partition("<")[0], -1)))


class SnapshotValues:
    """The values that a robot has reported in snapshots: the latest values, and those that it must keep.

    Attributes:
        adopted: The values that are the robot's decision until a further order, or None.
    """

    def __init__(self) -> None:
        self.adopted: _Values | None = None
        self._last: tuple[int, _Values] = (0, {})
        self._kept: tuple[int, _Values] = (0, {})

    @property
    def is_used(self) -> bool:
        """True if a snapshot was requested from the robot."""
        return self._last[0] > 0

    def note(self, number: int, values: _Values) -> None:
        """Store `values` until the next snapshot."""
        self._last = (number, values)

    def at(self, number: int) -> _Values:
        """Return the values in a snapshot. Raises `FrameRefusedError` if they are not stored."""
        for known, values in (self._last, self._kept):
            if known == number:
                return values
        raise FrameRefusedError(f"it is about snapshot {number}, which is not known")

    def adopt(self, number: int, *, published: bool) -> None:
        """Keep the values in a snapshot (0: no snapshot), and decide on them if they are `published`.

        Raises `FrameRefusedError` if the values are not known.
        """
        values = self.at(number) if number else None
        if values is not None:
            self._kept = (number, values)
        if published:
            self.adopted = values


def values_for_recall(order: Recall, protocol: Protocol, domain: CompiledDomain) -> _Values:
    """Return the values of the robot's variables requested by `order`; empty if it has none, or withdraws."""
    if order.value is not None:
        return domain.behind(order.value)
    trail = protocol.findings.trail
    if order.cycle is None or trail is None:
        return protocol.assignment
    place = _place_in(trail, order.cycle)
    return {} if place is None else domain.solution(place)


def _place_in(trail: Trail, cycle: int) -> int | None:
    """Return the index of the robot's value in `cycle`, or None if it had no value yet."""
    after = bisect_right(trail.entries, cycle, key=lambda entry: entry[0])
    return trail.entries[after - 1][1] if after else None
