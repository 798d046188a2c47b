"""A lesson: a team of four robots, runs of protocols, and steps that ask about the next event.

A lesson is a data file (`data/NN.toml`) with its texts, teams, runs and steps. Fields of a choice repeat its claim,
which a test compares with the recorded run.
"""

from __future__ import annotations

from functools import cache
from importlib.resources import files

import msgspec

ROBOTS = ("Ada", "Bob", "Cleo", "Dan")
"""The team in all lessons, the highest priority first."""
COUNT = 10
PLACES = {"Ada": (90, 72), "Bob": (310, 72), "Cleo": (90, 218), "Dan": (310, 218)}
"""The default positions of the drawn robots."""
Apart = tuple[str, str]


class TeamSpec(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """A team in which each robot chooses a level, and pairs in `apart` must choose different levels.

    Attributes:
        values: The levels of all robots, except those in `values_of`.
        apart: The pairs of robots that must be at different levels.
        broken_costs: The cost if a pair has the same level. 0: this is forbidden.
        low: True if a robot's level number is also a cost.
        chain: The number of robots in a row, instead of the four robots.
        partly_known: True if only the first robot in each rule knows the rule.
        changes: True if a level is removed after the first solution.
        places: The positions of the drawn robots.
        names: The side on which a robot's name is drawn: `left` or `right`; by default above or below.
    """

    values: tuple[int, ...] = (1, 2)
    values_of: dict[str, tuple[int, ...]] = {}
    apart: tuple[Apart, ...] = ()
    broken_costs: int = 0
    low: bool = False
    chain: int = 0
    partly_known: bool = False
    changes: bool = False
    places: dict[str, tuple[int, int]] = {}
    names: dict[str, str] = {}

    def levels(self, robot: str) -> tuple[int, ...]:
        """Return the levels of a robot."""
        return self.values_of.get(robot, self.values)

    def place(self, robot: str) -> tuple[int, int]:
        """Return the position of a drawn robot."""
        return self.places.get(robot, PLACES[robot])


class RunSpec(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """A run in the simulator, or only the choice of `auto`. `turns`: the number of recorded turns; 0: all."""

    team: str = "team"
    protocol: str
    settings: dict[str, int | float] = {}
    seed: int = 0
    schedule: str = "concurrent"
    turns: int = 0


class AnswerChoice(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """One possible answer: its text, its claim, and the reason why it is right or wrong.

    Attributes:
        text: The text of the answer. Messages are shown unchanged.
        why: The reason why the answer is right or wrong.
        right: True if this is the correct answer.
        to, words: The claim that the robot sends this message to that robot.
        silent: The claim that the robot sends nothing.
        undecided: The claim that the robot chooses no level.
        takes: The claim that the robot chooses this level.
        levels: The claimed levels of the team.
        breaks: A pair of robots for which `levels` are wrong.
        robots: The claim that exactly these robots are meant.
        number: The claimed number.
        protocol: The claimed protocol.
    """

    text: str = ""
    why: str
    right: bool = False
    to: str = ""
    words: str = ""
    silent: bool = False
    undecided: bool = False
    takes: int | None = None
    levels: dict[str, int] = {}
    breaks: Apart | None = None
    robots: tuple[str, ...] | None = None
    number: int | None = None
    protocol: str = ""

    @property
    def shown(self) -> str:
        """The answer in words."""
        return self.text or f"To {self.to}: “{self.words}”"


class LessonStep(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """A moment in a run, and a question about it.

    Attributes:
        title: The title of the step.
        text: The events so far, and further information.
        ask: The question.
        about: The kind of question, followed by names (`tests/support/lesson_truth.py`).
        run: The run. Empty: there are no messages yet, and the picture shows the team.
        turn: The number of past turns. The question is about the robot of the next turn.
        team: The team, if there is no run.
        levels: The levels shown in the picture, if there is no run.
        choices: Three or four possible answers.
    """

    title: str
    text: str
    ask: str
    about: str = "next"
    run: str = ""
    turn: int = 0
    team: str = "team"
    levels: dict[str, int] = {}
    choices: tuple[AnswerChoice, ...]

    @property
    def is_spoken(self) -> bool:
        """True if the question is about the actions and messages of the robot in the next turn."""
        return self.about == "next" or self.about.startswith("told ")

    @property
    def answer(self) -> AnswerChoice:
        """The right choice."""
        return next(choice for choice in self.choices if choice.right)


class Lesson(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """A lesson of four to seven steps."""

    title: str
    goal: str
    teams: dict[str, TeamSpec]
    runs: dict[str, RunSpec] = {}
    steps: tuple[LessonStep, ...]
    end: str

    def team_of(self, step: LessonStep) -> TeamSpec:
        """Return the team in a step."""
        return self.teams[self.runs[step.run].team if step.run else step.team]


@cache
def lesson(number: int) -> Lesson:
    """Return a lesson, counted from 1.

    Raises:
        KeyError: if there is no lesson with this number.
    """
    if not 1 <= number <= COUNT:
        raise KeyError(number)
    return msgspec.toml.decode((files(__package__) / "data" / f"{number:02}.toml").read_bytes(), type=Lesson)
