"""The steps of one robot, each computed once.

A robot's step depends on nothing but its own state and the message. A team has many more states than its robots, so
nearly all steps of a team are known, and exploring them needs neither copies nor messages, only numbers.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from copy import deepcopy
from functools import cached_property
from typing import NamedTuple

from robochoc.communication.host import BadMessageError, Host
from robochoc.exploration.state_key import state_key
from robochoc.model.outcome import Verdict
from robochoc.protocols.findings import Findings
from robochoc.protocols.message import Envelope
from robochoc.system.termination import Terminated
from robochoc.system.time_limit import TimeLimitError, computed_by

LONGEST_STEP_S = 10.0
"""The time after which a robot's step is a fault, in seconds."""
TOO_LONG = "does not end its step within"
NOT_REPEATABLE = (
    "behaves differently when a step is repeated: a step may depend on the robot's state and the message only;"
    " use no chance but Protocol.chance, no clock, and no data outside the object"
)
MOST_REPEATED = 500
"""The maximum number of steps of a robot that are computed twice."""


class LocalState(NamedTuple):
    """A state of a robot, as far as others see it.

    Attributes:
        verdict: The verdict that the robot concludes alone; None: the search continues.
        assignment: The values of its variables.
        findings: Its knowledge about the whole search.
        most_above_bound: See `Protocol.most_above_bound`.
    """

    verdict: Verdict | None
    assignment: dict[str, int]
    findings: Findings
    most_above_bound: float | None


class Received(NamedTuple):
    """A received message, and the number of messages from the same sender that were lost right before it."""

    sender: str
    content: bytes
    missing: int = 0


class Step(NamedTuple):
    """A robot's step: its next state, and the receiver and content of each message that it sends.

    `refusal`: why the robot cannot use the message, or what went wrong in the step; empty if nothing did.
    """

    state: int
    sent: tuple[tuple[str, bytes], ...] = ()
    refusal: str = ""


class LocalSteps:
    """The states of one robot by number, and its steps between them. `host` is not started yet."""

    def __init__(self, host: Host) -> None:
        self.name = host.name
        self._first = host
        self._numbers: dict[tuple[bytes, bool | None], int] = {}
        self.hosts: list[Host] = []
        self._steps: dict[tuple[int, tuple[Received, ...]], Step] = {}
        self._starts: dict[tuple[int, bool], Step] = {}
        self._changed: dict[int, Step] = {}
        self._repeated = 0
        self.states: list[LocalState] = []

    @cached_property
    def first(self) -> Step:
        """The state of a robot that has no knowledge and is not started yet."""
        return self._guarded(Step(-1), lambda: self._waiting(self._first))

    def changed(self, before: LocalSteps, state: int, change: Callable[[Host], None]) -> Step:
        """Return the state in which the robot, which was in a state of `before`, waits for its start after `change`.

        The arguments `before` and `change` are always the same.
        """
        known = self._changed.get(state)
        if known is None:

            def adopt() -> Step:
                host = deepcopy(before.hosts[state])
                change(host)
                return self._waiting(host)

            known = self._changed[state] = self._guarded(Step(-1), adopt)
        return known

    def start(self, state: int, *, lossless: bool) -> Step:
        """Return the step in which the robot starts, or resumes. `lossless`: see `Host.start`."""
        known = self._starts.get((state, lossless))
        if known is None:

            def start() -> Step:
                host = deepcopy(self.hosts[state])
                return self._stepped(host, host.start(lossless=lossless))

            known = self._starts[state, lossless] = self._guarded(Step(-1), start)
        return known

    def packet(self, state: int, packet: tuple[Received, ...]) -> Step:
        """Return the step from `state` on a packet."""
        known = self._steps.get((state, packet))
        if known is None:
            known = self._steps[state, packet] = self._computed(state, packet)
        return known

    def go_on(self, state: int) -> Step | None:
        """Return the step in which the robot continues without the messages that it waits for; None if it does not."""
        ends = Step(-1)

        def go_on() -> Step:
            host = deepcopy(self.hosts[state])
            sent = host.go_on()
            return ends if sent is None else self._stepped(host, sent)

        step = self._guarded(Step(state), go_on)
        return None if step is ends else step

    def _computed(self, state: int, packet: Sequence[Received]) -> Step:
        def handle() -> Step:
            host = deepcopy(self.hosts[state])
            host.clock = 0
            for sender, content, missing in packet:
                for _ in range(missing):
                    host.protocol.miss(sender)
                host.receive(Envelope(sender, self.name, content, 0))
            return self._stepped(host, host.settle())

        return self._guarded(Step(state), handle)

    def _guarded(self, before: Step, compute: Callable[[], Step]) -> Step:
        """Return the step that `compute` returns, or `before` with the reason why there is none."""
        step = self._attempted(before, compute)
        if step.refusal or self._repeated == MOST_REPEATED:
            return step
        self._repeated += 1
        if self._attempted(before, compute) == step:
            return step
        return before._replace(refusal=f"{self.name} {NOT_REPEATABLE}")

    def _attempted(self, before: Step, compute: Callable[[], Step]) -> Step:
        try:
            return computed_by(time.monotonic() + LONGEST_STEP_S, compute)
        except TimeLimitError:
            return before._replace(refusal=f"{self.name} {TOO_LONG} {LONGEST_STEP_S:g} seconds")
        except BadMessageError as refused:
            return before._replace(refusal=str(refused))
        except Terminated:
            raise
        except (Exception, SystemExit) as error:  # noqa: BLE001 - any error of a protocol is a fault that is reported
            return before._replace(refusal=f"{self.name} has failed: {type(error).__name__}: {error}")

    def _stepped(self, host: Host, sent: Sequence[Envelope]) -> Step:
        number = self._number(host)
        return Step(number, tuple([(envelope.receiver, envelope.content) for envelope in sent]))

    def _waiting(self, host: Host) -> Step:
        """Return the state of a robot that is not started: whether it starts or resumes is a part of the state."""
        return Step(self._number(host, resumes=host.resumes))

    def _number(self, host: Host, *, resumes: bool | None = None) -> int:
        """Return the number of the state of `host`. `resumes`: see `Host.resumes`; None after the start."""
        key = state_key(host.protocol), resumes
        number = self._numbers.get(key, len(self.hosts))
        if number == len(self.hosts):
            protocol = host.protocol
            if not isinstance(protocol.findings, Findings):
                raise TypeError(f"findings is {protocol.findings!r}; expected an object of the class Findings")
            self.states.append(
                LocalState(protocol.verdict, protocol.assignment, protocol.findings, protocol.most_above_bound)
            )
            self.hosts.append(host)
            self._numbers[key] = number
        return number
