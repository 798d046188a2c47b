"""Replay: the protocol objects of a recorded run, driven through its packets once more.

A protocol is a pure state machine, so with the same packets it has to say the same again: if it does not, it is
another one than it was, or the journal is. What is compared is all that robots tell of themselves but the time: what
they took in, decided, heard of and concluded, what they said, with its size, their NCCC clocks and constraint checks.
"""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass

import msgspec

from robochoc.communication.host import Host
from robochoc.communication.run_result import Progress
from robochoc.journal.entries import STAMPED_LATE
from robochoc.journal.events import AnyEvent, Event, Received, Sent, Settled
from robochoc.journal.journal import Header, Journal
from robochoc.model.message import Envelope, Message
from robochoc.replay.channels import MessageDecoder, RecordedChannels
from robochoc.replay.claims import Contradiction, ReplayedRun, contradictions, played
from robochoc.replay.rebuild import Rebuilder, RebuiltRobots, ReplayOptions
from robochoc.replay.steps import RecordedRun, RecordedStep, RobotEvent, runs_of, steps_of

SIMULATED = "simulator"
"""The runtime whose schedules may delay messages: then a clock takes up more than the sender's."""
MORE_THAN_RECORDED = 10_000
"""So many messages more than were recorded may be said in a step."""
PROGRESS_EVERY = 256
"""Steps between two reports of progress."""


class Difference(msgspec.Struct, frozen=True, kw_only=True):
    """The first thing that was otherwise.

    `robot` did it in its step number `step`, over the whole journal, in run or epoch number `run`, both counted from
    0, after it had taken in `packet` (empty: it began). One of `recorded` and `replayed` is None where there was
    nothing more; `raised` says what the protocol ended with, if it did not come that far.
    """

    run: int
    protocol: str
    robot: str
    step: int
    packet: tuple[Sent, ...]
    recorded: AnyEvent | None
    replayed: AnyEvent | None
    raised: str = ""


class StoppedRobot(msgspec.Struct, frozen=True, kw_only=True):
    """A robot that could be followed as far as its step number `step` only, in run number `run`, and why."""

    run: int
    robot: str
    step: int
    why: str


@dataclass(frozen=True)
class ReplayResult:
    """What a replay has come to.

    `steps` and `messages` (sent) are those that were played and found the same; `unfinished` steps are there in part
    only, and were compared up to there. `damage` is why the journal ends early (None: it does not); with `truncated`
    only its end is missing, else it was altered there. `ended`: it says how the run has ended. `contradictions` are
    what header and outcome claim and the steps do not bear out.
    """

    runs: int
    robots: int
    steps: int
    messages: int
    unfinished: int
    difference: Difference | None
    stopped: tuple[StoppedRobot, ...]
    damage: str | None
    ended: bool
    contradictions: tuple[Contradiction, ...] = ()
    truncated: bool = False

    @property
    def identical(self) -> bool:
        """Whether something was played, and all of it was the same."""
        return self.steps > 0 and not self.differs

    @property
    def differs(self) -> bool:
        """Whether anything was otherwise: a step, or what the journal claims beside its steps."""
        return self.difference is not None or bool(self.contradictions)


class NoEndError(Exception):
    """A protocol has said so much in one step that it may never end."""


class _Outbox(list[tuple[str, Message]]):
    """An outbox that takes so many messages: a protocol that goes round in a circle mostly speaks on the way."""

    def __init__(self, most: int, listen: Callable[[str, Message], None]) -> None:
        super().__init__()
        self._most = most
        self._listen = listen

    def append(self, said: tuple[str, Message]) -> None:
        """Take one more. Raises `NoEndError`."""
        if len(self) >= self._most:
            raise NoEndError(f"{len(self):,} messages in one step, and no end of it")
        super().append(said)
        self._listen(*said)


class ReplayStopsError(Exception):
    """The robot cannot be followed any further. `unsaid`: what it was told cannot be made from the journal alone."""

    def __init__(self, why: str, *, unsaid: bool = False) -> None:
        super().__init__(why)
        self.unsaid = unsaid


def replay(
    journal: Journal, means: ReplayOptions | None = None, *, progress: Callable[[Progress], None] | None = None
) -> ReplayResult:
    """Play `journal` again, up to the first difference. Raises `CannotReplayError`."""
    return _Replay(journal, means or ReplayOptions(), progress).whole()


class RunReplay:
    """One run being played again."""

    def __init__(self, run: RecordedRun, ensemble: RebuiltRobots, header: Header | None) -> None:
        self.run = run
        self.ensemble = ensemble
        self.words = MessageDecoder(ensemble.protocol)
        self.channels = RecordedChannels(run.events, self.words)
        self._simulated = header is None or header.runtime == SIMULATED
        self._stamped_late = header is not None and header.version == STAMPED_LATE
        self._begun: set[str] = set()
        self.heard: list[tuple[Sent, Message]] = []
        """What was taken in by the step that was played last."""

    def steps(self) -> Iterator[RecordedStep]:
        """The steps in their order, for who plays each before the next.

        Across machines clocks differ, so that something may seem to be received before it was sent: then it waits.
        """
        waiting: dict[str, deque[RecordedStep]] = {}
        for step in steps_of(self.run.events):
            if step.robot in waiting or not self.channels.can_hand_on(step.received):
                waiting.setdefault(step.robot, deque()).append(step)
                continue
            yield step
            yield from self._now_possible(waiting)
        for steps in waiting.values():
            yield from steps

    def _now_possible(self, waiting: dict[str, deque[RecordedStep]]) -> Iterator[RecordedStep]:
        """Of the steps that wait, those that need no longer; playing one may set another free."""
        moved = True
        while moved:
            moved = False
            for name, steps in list(waiting.items()):
                while steps and self.channels.can_hand_on(steps[0].received):
                    moved = True
                    yield steps.popleft()
                if not steps:
                    del waiting[name]

    def play(
        self, step: RecordedStep, number: int, listen: Callable[[str, Message], None] = lambda *_: None
    ) -> Difference | None:
        """Play the step, its robot's number `number`; return the difference, if there is one.

        Raises `ReplayStopsError`.
        `listen` is called with each receiver and message at the moment the protocol says it, in mid-step.
        """
        host = self.ensemble.hosts.get(step.robot)
        if host is None:
            raise ReplayStopsError("it is not in the team")
        told: list[AnyEvent] = []
        host.observe(told.append, lambda: 0.0)
        recorded = sum(isinstance(event, Sent) for event in step.done)
        host.protocol.outbox = _Outbox(recorded + MORE_THAN_RECORDED, listen)
        packet: list[Sent] = []
        self.heard = []
        said: Sequence[Envelope] = ()
        raised = ""
        try:
            for received in step.received:
                sent, envelope = self._handed_on(received)
                packet.append(sent)
                host.take_in(envelope)
                self.heard.append((sent, self.words.message(envelope.content)))
                self._delay(host, received, told)
            if step.received and (step.whole or step.done):
                said = host.settle()
            elif not step.received and step.robot not in self._begun:  # nobody begins a run twice
                said = host.start(lossless=self.ensemble.lossless)
            self._begun.add(step.robot)
        except ReplayStopsError:
            raise
        except Exception as error:  # noqa: BLE001 - a protocol that is being written may raise anything
            raised = _words_of(error)
        found = self._difference(step, told, raised)
        if found is None and not raised:
            for envelope in said:
                self.channels.say(envelope)
            return None
        event, again = found or (None, None)
        return Difference(
            run=self.run.number,
            protocol=self.ensemble.protocol.__name__,
            robot=step.robot,
            step=number,
            packet=tuple(packet),
            recorded=event,
            replayed=again,
            raised=raised,
        )

    def _handed_on(self, received: Received) -> tuple[Sent, Envelope]:
        sent, envelope = self.channels.hand_on(received)
        if sent is None:
            raise ReplayStopsError(f"what {received.sender} had said to it ({received.type}) is not in the journal")
        if envelope is None:
            why = f"what {received.sender} had said to it ({received.type}) cannot be made again from the journal"
            raise ReplayStopsError(why, unsaid=True)
        return sent, envelope

    def _delay(self, host: Host, received: Received, told: list[AnyEvent]) -> None:
        """A message that was under way for longer has moved the clock on; nobody says so, but the clock."""
        if self._simulated and received.clock > host.clock and told and isinstance(told[-1], Received):
            host.catch_up(received.clock)
            told[-1] = msgspec.structs.replace(told[-1], clock=received.clock)

    def _difference(
        self, step: RecordedStep, told: Sequence[AnyEvent], raised: str
    ) -> tuple[RobotEvent | None, AnyEvent | None] | None:
        """The first pair of events that are not the same."""
        recorded = [*step.received, *step.done]
        if self._stamped_late:
            told = sorted(told, key=_as_it_was_told)
        for place, event in enumerate(recorded):
            again = told[place] if place < len(told) else None
            if again is None or not self._same(event, again):
                return event, again
        if len(told) > len(recorded) and step.whole and not raised:
            return None, told[len(recorded)]
        return None

    def _same(self, recorded: Event, replayed: Event) -> bool:
        if type(recorded) is not type(replayed):
            return False
        if isinstance(recorded, Sent) and isinstance(replayed, Sent) and not self.words.same(recorded, replayed):
            return False
        apart = {"t", "content"}
        if self._stamped_late and isinstance(recorded, Sent):
            apart.add("clock")
        names = [name for name in recorded.__struct_fields__ if name not in apart]
        return all(getattr(recorded, name) == getattr(replayed, name) for name in names)


def _as_it_was_told(event: AnyEvent) -> int:
    """Where an event stood in its step in the first version of journals: decisions came before words."""
    match event:
        case Received():
            return 0
        case Sent():
            return 2
        case Settled():
            return 3
        case _:
            return 1


class _Replay:
    """One journal, all its runs."""

    def __init__(self, journal: Journal, means: ReplayOptions, progress: Callable[[Progress], None] | None) -> None:
        self._journal = journal
        self._cast = Rebuilder(journal.header, means)
        self._progress = progress
        self._began = time.monotonic()
        self._counts: dict[str, int] = {}
        self._steps = self._messages = self._unfinished = self._runs = 0
        self._stopped: list[StoppedRobot] = []
        self._played: list[ReplayedRun] = []
        self._gone: set[str] = set()
        """Robots of which it is not known what they have in mind."""

    def whole(self) -> ReplayResult:
        difference = None
        for run in runs_of(self._journal.events):
            self._show(f"run {run.number + 1}: making the robots")
            ensemble = self._cast.enter(run)
            self._runs += 1
            self._counts.update({name: 0 for name in ensemble.hosts if name not in self._counts})
            difference = self._run(RunReplay(run, ensemble, self._journal.header))
            if difference:
                break
            self._played.append(played(run, ensemble, self._journal.outcome))
        found: Iterable[Contradiction] = ()
        if difference is None:
            whole = not (self._stopped or self._unfinished or self._journal.damage)
            found = contradictions(self._journal, self._played, whole=whole)
        return ReplayResult(
            runs=self._runs,
            robots=len(self._counts),
            steps=self._steps,
            messages=self._messages,
            unfinished=self._unfinished,
            difference=difference,
            stopped=tuple(self._stopped),
            damage=self._journal.damage,
            ended=self._journal.outcome is not None,
            contradictions=tuple(found),
            truncated=self._journal.truncated,
        )

    def _run(self, scene: RunReplay) -> Difference | None:
        self._gone.intersection_update(scene.ensemble.mindful)
        for step in scene.steps():
            number = self._counts.get(step.robot, 0)
            self._counts[step.robot] = number + 1
            if step.robot in self._gone:
                continue
            try:
                difference = scene.play(step, number)
            except ReplayStopsError as stops:
                self._gone.add(step.robot)
                self._stopped.append(StoppedRobot(run=scene.run.number, robot=step.robot, step=number, why=str(stops)))
                continue
            if difference:
                return difference
            self._steps += 1
            if not step.whole:
                self._unfinished += 1
                self._gone.add(step.robot)
            self._messages += sum(isinstance(event, Sent) for event in step.done)
            if self._steps % PROGRESS_EVERY == 0:
                self._show()
        return None

    def _show(self, stage: str = "") -> None:
        if self._progress:
            self._progress(Progress(self._messages, time.monotonic() - self._began, stage))


def _words_of(error: Exception) -> str:
    """What was raised, and the last line of the way there."""
    trace = error.__traceback__
    while trace is not None and trace.tb_next is not None:
        trace = trace.tb_next
    place = f" ({trace.tb_frame.f_code.co_filename}:{trace.tb_lineno})" if trace is not None else ""
    return f"{type(error).__name__}: {error}{place}"
