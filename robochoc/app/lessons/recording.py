"""The recorded runs of a lesson, made from real runs (`record.py`) and stored with the lesson.

A test repeats the runs and compares them with the recordings, so that lessons show the actual behaviour of protocols.
"""

from __future__ import annotations

from functools import cache
from importlib.resources import files

import msgspec

from robochoc.app.lessons.lesson import LessonStep


class LessonMessage(msgspec.Struct, frozen=True):
    """A message in the words of the sniffer."""

    sender: str
    to: str
    kind: str
    words: str


class LessonTurn(msgspec.Struct, frozen=True, omit_defaults=True):
    """One step of a robot: the received and sent messages (by number), its level, and the reasons for this level."""

    robot: str
    heard: tuple[int, ...] = ()
    said: tuple[int, ...] = ()
    level: int | None = None
    why: tuple[str, ...] = ()


class LessonRun(msgspec.Struct, frozen=True, omit_defaults=True):
    """A run: its protocol, the reason for choosing it, messages and turns in order, verdict and cost."""

    protocol: str
    reason: str = ""
    messages: tuple[LessonMessage, ...] = ()
    turns: tuple[LessonTurn, ...] = ()
    verdict: str = ""
    cost: int | None = None

    def levels(self, turns: int) -> dict[str, int]:
        """Return the robots' levels after a number of turns."""
        return {turn.robot: turn.level for turn in self.turns[:turns] if turn.level is not None}


class LessonMoment(msgspec.Struct, frozen=True):
    """The content of a picture: levels, the current messages, and the robot that the question is about."""

    levels: dict[str, int]
    messages: tuple[LessonMessage, ...] = ()
    asked: str = ""


@cache
def recordings(number: int) -> dict[str, LessonRun]:
    """Return the runs of a lesson by name."""
    file = files(__package__) / "runs" / f"{number:02}.json"
    return msgspec.json.decode(file.read_bytes(), type=dict[str, LessonRun])


def before(number: int, step: LessonStep) -> LessonMoment:
    """Return the moment of a step: the robot in question has received the drawn messages, but has not sent any yet."""
    if not step.run:
        return LessonMoment(step.levels)
    run = recordings(number)[step.run]
    if step.turn >= len(run.turns):
        return LessonMoment(run.levels(step.turn))
    turn = run.turns[step.turn]
    moved = step.is_spoken and step.about != "next"  # the robot's new level is already known
    return LessonMoment(
        run.levels(step.turn + moved), tuple(run.messages[one] for one in turn.heard), _asked(step, turn)
    )


def after(number: int, step: LessonStep) -> LessonMoment:
    """Return the moment after the answer: the messages that the robot has sent, and its level."""
    if not step.run or not step.is_spoken:
        shown = before(number, step)
        return msgspec.structs.replace(shown, levels=step.answer.levels or shown.levels)
    run = recordings(number)[step.run]
    turn = run.turns[step.turn]
    return LessonMoment(run.levels(step.turn + 1), tuple(run.messages[one] for one in turn.said))


def reasons(number: int, step: LessonStep) -> tuple[str, ...]:
    """Return the reasons for the robot's new level, from the replay of the run."""
    if not step.run or not step.is_spoken:
        return ()
    why = recordings(number)[step.run].turns[step.turn].why
    return tuple(reason for reason in why if "bytes>" not in reason)  # packed tables are not readable


def _asked(step: LessonStep, turn: LessonTurn) -> str:
    return turn.robot if step.is_spoken else ""
