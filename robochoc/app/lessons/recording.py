"""What happened in the runs of a lesson: made once from real runs (`record.py`), and kept beside the lesson.

A test makes the runs again and holds them against what is kept, so a lesson tells what the protocols do.
"""

from __future__ import annotations

from functools import cache
from importlib.resources import files

import msgspec

from robochoc.app.lessons.lesson import Step


class Message(msgspec.Struct, frozen=True):
    """A message that was sent, in the words of the sniffer."""

    sender: str
    to: str
    kind: str
    words: str


class Turn(msgspec.Struct, frozen=True, omit_defaults=True):
    """What a robot did at once: the messages that it took in and sent, by number; its level, and why it has that."""

    robot: str
    heard: tuple[int, ...] = ()
    said: tuple[int, ...] = ()
    level: int | None = None
    why: tuple[str, ...] = ()


class Recording(msgspec.Struct, frozen=True, omit_defaults=True):
    """A run: its protocol (the one that was chosen, and why), messages and turns in their order, and its end."""

    protocol: str
    reason: str = ""
    messages: tuple[Message, ...] = ()
    turns: tuple[Turn, ...] = ()
    verdict: str = ""
    cost: int | None = None

    def levels(self, turns: int) -> dict[str, int]:
        """Return the robots' levels after so many turns."""
        return {turn.robot: turn.level for turn in self.turns[:turns] if turn.level is not None}


class Moment(msgspec.Struct, frozen=True):
    """What a picture of the team shows: levels, the messages that count now, and who is asked."""

    levels: dict[str, int]
    messages: tuple[Message, ...] = ()
    asked: str = ""


@cache
def recordings(number: int) -> dict[str, Recording]:
    """Return the runs of a lesson by their names."""
    file = files(__package__) / "runs" / f"{number:02}.json"
    return msgspec.json.decode(file.read_bytes(), type=dict[str, Recording])


def before(number: int, step: Step) -> Moment:
    """Return the moment of a step: the robot that is asked has heard what the arrows say, and not spoken yet."""
    if not step.run:
        return Moment(step.levels)
    run = recordings(number)[step.run]
    if step.turn >= len(run.turns):
        return Moment(run.levels(step.turn))
    turn = run.turns[step.turn]
    moved = step.is_spoken and step.about != "next"  # it is known already that the robot has a new level
    return Moment(run.levels(step.turn + moved), tuple(run.messages[one] for one in turn.heard), _asked(step, turn))


def after(number: int, step: Step) -> Moment:
    """Return what the picture shows once the step is answered: what the robot has said, and its level."""
    if not step.run or not step.is_spoken:
        shown = before(number, step)
        return msgspec.structs.replace(shown, levels=step.answer.levels or shown.levels)
    run = recordings(number)[step.run]
    turn = run.turns[step.turn]
    return Moment(run.levels(step.turn + 1), tuple(run.messages[one] for one in turn.said))


def reasons(number: int, step: Step) -> tuple[str, ...]:
    """Return the robot's own reasons for its new level, as the replay of the run tells them."""
    if not step.run or not step.is_spoken:
        return ()
    why = recordings(number)[step.run].turns[step.turn].why
    return tuple(reason for reason in why if "bytes>" not in reason)  # a table that is packed tells nobody anything


def _asked(step: Step, turn: Turn) -> str:
    return turn.robot if step.is_spoken else ""
