"""What a robot knows after each of its own steps, and why it has changed its mind.

The robot is played again, by what its journal says that it was told; nobody else has to be, but where a journal's
text form has lost what a message said.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence

import msgspec

from robochoc.journal.events import AnyEvent
from robochoc.journal.journal import Header, Journal
from robochoc.replay.inspection import Inspector, safely
from robochoc.replay.reasons import Reasons
from robochoc.replay.rebuild import CannotReplayError, Rebuilder, ReplayOptions
from robochoc.replay.replay import Difference, ReplayStopsError, RunReplay
from robochoc.replay.steps import RecordedStep, runs_of, steps_of


class Choice(msgspec.Struct, frozen=True):
    """An own value, and what rules it out (None: nothing that the robot knows)."""

    value: str
    ruled_out_by: str | None


class RobotState(msgspec.Struct, frozen=True, kw_only=True):
    """What a robot knows after its step number `step`, counted from 0 over the whole journal; all of it to be shown.

    `value` are its variables' values (empty: none), `view` says of others what it knows, as pairs (robot, words),
    `domain` tells each own value with what rules it out, `nogoods` are those that are kept, `more` whatever else the
    protocol keeps, by name, and `why` says why the value is another one than before, or why the robot has concluded the
    search (empty: neither).
    """

    step: int
    value: dict[str, int] = {}
    view: list[tuple[str, str]] = []
    domain: list[Choice] = []
    nogoods: list[str] = []
    more: dict[str, str] = {}
    why: list[str] = []


def states_of(
    journal: Journal | Iterable[AnyEvent],
    robot: str,
    means: ReplayOptions | None = None,
    *,
    header: Header | None = None,
    since: int = 0,
    everything: Callable[[], Iterable[AnyEvent]] | None = None,
) -> Iterator[RobotState]:
    """The states of `robot` after its own steps, from step number `since` on; a step that is there in part has none.

    `journal` may be events alone, sorted as in one; then `header` is its header, if there is any. They may be those
    of `robot` and to it, where `everything` gives those of all robots when they turn out to be needed. Raises
    `CannotReplayError` where there is nothing to play by, and where it turns out that the protocol is not the one that
    was recorded. Where the journal does not tell what the robot was told next, the last state says so in `more`.
    """
    if isinstance(journal, Journal):
        header, events = journal.header, journal.events
    else:
        events = tuple(journal)
    for alone in (True, False):
        if not alone and everything is not None:
            events = tuple(everything())
        player = _Player(header, robot, means or ReplayOptions(), alone=alone)
        try:
            for state in player.states(events, since):
                yield state
                since = state.step + 1
        except _UnsaidError:
            continue
        return


class _UnsaidError(Exception):
    """What the robot was told can only be made again by those who had said it."""


class _Player:
    """Plays the robot's steps, and looks at it after each; `alone`, or with all others."""

    def __init__(self, header: Header | None, robot: str, means: ReplayOptions, *, alone: bool) -> None:
        self._cast = Rebuilder(header, means, {robot} if alone else None)
        self._header = header
        self._robot = robot
        self._alone = alone
        self._step = 0

    def states(self, events: Sequence[AnyEvent], since: int) -> Iterator[RobotState]:
        gone: set[str] = set()
        for run in runs_of(events):
            ensemble = self._cast.enter(run)
            if self._robot not in ensemble.hosts:
                continue
            scene = RunReplay(run, ensemble, self._header)
            look = Inspector(ensemble.parts[self._robot])
            gone.intersection_update(ensemble.mindful)
            for step in steps_of(run.events):
                if self._alone and step.robot != self._robot:
                    continue
                if step.robot in gone:
                    self._step += step.robot == self._robot
                    continue
                try:
                    state = self._played(scene, look, step, since)
                except ReplayStopsError as stops:
                    if stops.unsaid and self._alone:
                        raise _UnsaidError from stops
                    gone.add(step.robot)
                    state = self._last(step, str(stops), since)
                if state is not None:
                    yield state

    def _played(self, scene: RunReplay, look: Inspector, step: RecordedStep, since: int) -> RobotState | None:
        """What the robot knows after `step`; None where the step is another's, is not whole, or is not asked for."""
        if step.robot != self._robot:
            scene.play(step, 0)
            return None
        number, protocol = self._step, scene.ensemble.hosts[self._robot].protocol
        self._step += 1
        wanted = step.whole and number >= since
        reasons = Reasons(look, protocol) if wanted else None
        difference = scene.play(step, number, reasons.listen) if reasons else scene.play(step, number)
        if difference is not None:
            raise CannotReplayError(f"{self._robot} does not do again what was recorded: {in_short(difference)}")
        heard = scene.heard
        for sent, message in heard:
            look.hear(sent.sender, message)
        if reasons is None:
            return None
        return RobotState(
            step=number,
            value=dict(protocol.assignment),
            view=safely(lambda: look.view(protocol), []),
            domain=[Choice(*pair) for pair in safely(lambda: look.domain(protocol), [])],
            nogoods=safely(lambda: look.nogoods(protocol), []),
            more=look.more(protocol),
            why=safely(lambda: reasons.told(heard, step), []),
        )

    def _last(self, step: RecordedStep, why: str, since: int) -> RobotState | None:
        """Instead of the state that nobody knows: that there is none, and why."""
        if step.robot != self._robot:
            return None
        self._step += 1
        return RobotState(step=self._step - 1, more={"replay": f"ends here: {why}"}) if self._step > since else None


def in_short(difference: Difference) -> str:
    """`difference` in one line."""
    if difference.raised:
        return f"in its step {difference.step} the protocol raised {difference.raised}"
    recorded = type(difference.recorded).__name__ if difference.recorded else "nothing more"
    replayed = type(difference.replayed).__name__ if difference.replayed else "nothing more"
    where = f"in its step {difference.step} of run {difference.run}"
    return f"{where}, recorded is {recorded}, and replayed {replayed}"
