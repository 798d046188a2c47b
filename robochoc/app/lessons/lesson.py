"""A lesson: a team of four, runs of protocols on it, and steps that ask what comes next.

A lesson is a file of data (`data/NN.toml`), which is also the catalogue of its texts: its teams, the runs, and the
steps. What a choice claims is written beside its words, in fields that a program can hold against the recorded run.
"""

from __future__ import annotations

from functools import cache
from importlib.resources import files

import msgspec

ROBOTS = ("Ada", "Bob", "Cleo", "Dan")
"""The team of all lessons, in its order: the highest priority first."""
COUNT = 10
PLACES = {"Ada": (90, 72), "Bob": (310, 72), "Cleo": (90, 218), "Dan": (310, 218)}
"""Where robots are drawn, unless a team says otherwise."""
Apart = tuple[str, str]


class TeamSpec(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """A team: each robot takes a level, and two that are `apart` may not take the same.

    Attributes:
        values: The levels of all robots; `values_of` says otherwise for some.
        apart: Who may not be at the same level.
        broken_costs: The cost of two at the same level; 0: it must not be.
        low: Whether a robot's level is a cost, too: as much as its number.
        chain: So many robots in a row instead of the four.
        partly_known: Whether each rule is known to its first robot alone.
        changes: Whether a level is lost after the first solution.
        places: Where robots are drawn.
        names: Where their names stand: `left` or `right` of them; otherwise above or below.
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
        """Return the levels that a robot can take."""
        return self.values_of.get(robot, self.values)

    def place(self, robot: str) -> tuple[int, int]:
        """Return where a robot is drawn."""
        return self.places.get(robot, PLACES[robot])


class RunSpec(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """A run in the simulator; of `auto` only the choice is recorded. `turns`: so many are kept; 0: all."""

    team: str = "team"
    protocol: str
    settings: dict[str, int | float] = {}
    seed: int = 0
    schedule: str = "concurrent"
    turns: int = 0


class Choice(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """One of the answers: its words, what it claims, and why it is right or wrong.

    Attributes:
        text: Its words; a message is shown as it is.
        why: Why it is the answer, or why not.
        right: Whether it is the answer.
        to, words: The robot says this to that one.
        silent: The robot says nothing.
        undecided: The robot takes no level.
        takes: The robot takes this level.
        levels: The team's levels.
        breaks: Why `levels` are wrong: these two may not be at the same level.
        robots: These robots, and no others.
        number: So many.
        protocol: That protocol.
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


class Step(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """A moment of a run, and a question.

    Attributes:
        title: What it is about.
        text: What has happened so far, and what there is to know.
        ask: The question.
        about: What kind of question it is, with the names that belong to it (`tests/support/lesson_truth.py`).
        run: The run; empty: nobody has spoken yet, and the picture shows the team.
        turn: The turns that are over. The robot of the next one is asked.
        team: The team, where there is no run.
        levels: What the picture shows where there is no run.
        choices: Three or four.
    """

    title: str
    text: str
    ask: str
    about: str = "next"
    run: str = ""
    turn: int = 0
    team: str = "team"
    levels: dict[str, int] = {}
    choices: tuple[Choice, ...]

    @property
    def is_spoken(self) -> bool:
        """Whether the robot of the next turn is asked about what it does and says then."""
        return self.about == "next" or self.about.startswith("told ")

    @property
    def answer(self) -> Choice:
        """The right choice."""
        return next(choice for choice in self.choices if choice.right)


class Lesson(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """A lesson of four to seven steps."""

    title: str
    goal: str
    teams: dict[str, TeamSpec]
    runs: dict[str, RunSpec] = {}
    steps: tuple[Step, ...]
    end: str

    def team_of(self, step: Step) -> TeamSpec:
        """Return the team that a step is about."""
        return self.teams[self.runs[step.run].team if step.run else step.team]


@cache
def lesson(number: int) -> Lesson:
    """Return a lesson, counted from 1.

    Raises:
        KeyError: if there is none of that number.
    """
    if not 1 <= number <= COUNT:
        raise KeyError(number)
    return msgspec.toml.decode((files(__package__) / "data" / f"{number:02}.toml").read_bytes(), type=Lesson)
