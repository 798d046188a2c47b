"""The moves of players in a game, and the rules that they may break."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import field
from enum import StrEnum

from robochoc.model.problem import Value
from robochoc.rounds.team_rounds import TeamRounds
from robochoc.run.registry import UnknownProtocolError
from robochoc.solver.errors import UnsupportedError
from robochoc.system.lazy_dataclass import dataclass
from robochoc.system.plain_text import listed


class Rule(StrEnum):
    """The rules of a game.

    `LATE`: no move before the time limit of the round. `GARBAGE`: a line that is not a move. `INVALID_VALUE`: a value
    that the robot cannot have. `OVERSIZED`: a line or a text that is too long. `TOO_MANY`: more messages in a round, or
    more characters in the game, than allowed. `WRONG_RECEIVER`: a message to a robot that is not a neighbour.
    `FLOODING`: more output than any game needs; the program is ended. `ENDED`: the program has ended.
    """

    LATE = "late"
    GARBAGE = "garbage"
    INVALID_VALUE = "invalid-value"
    OVERSIZED = "oversized"
    TOO_MANY = "too-many"
    WRONG_RECEIVER = "wrong-receiver"
    FLOODING = "flooding"
    ENDED = "ended"


@dataclass(frozen=True)
class Breach:
    """A broken rule: the round, the rule, and the details in words. The details may quote the player's text."""

    round: int
    rule: Rule
    details: str = ""


@dataclass(frozen=True)
class Limits:
    """The limits on each outside player.

    Attributes:
        timeout_s: The time for a move, in seconds.
        messages: The maximum number of messages of a robot in a round, without announcements.
        characters_each: The maximum number of characters of a text.
        characters: The maximum number of characters of all texts of a robot in the game.
    """

    timeout_s: float = 30.0
    messages: int = 8
    characters_each: int = 2_000
    characters: int = 20_000


@dataclass(frozen=True)
class Statement:
    """A message from a player to a neighbour: a text, or a claim about the private cost of one of its values.

    Attributes:
        receiver: The neighbour.
        text: The text; empty for a claim.
        claim: The index of the player's value and the claimed cost; None for a text.
    """

    receiver: str
    text: str = ""
    claim: tuple[int, int] | None = None


@dataclass(frozen=True)
class Move:
    """The move of a robot in a round.

    Attributes:
        value: The index of the value that the robot plays; None: it keeps its value.
        announced: The index of the value that it announces; None: the value that it plays.
        statements: Its messages.
        tokens: The number of tokens that the player reports to have used; robochoc cannot count them.
        breaches: The rules that the player has broken in this round.
    """

    value: int | None = None
    announced: int | None = None
    statements: tuple[Statement, ...] = ()
    tokens: int = 0
    breaches: tuple[Breach, ...] = ()


@dataclass(frozen=True)
class Delivery:
    """A message that a robot received in the previous round: a text, or a claimed value with its cost."""

    sender: str
    text: str = ""
    claim: tuple[Value, int] | None = None


@dataclass(frozen=True)
class Seen:
    """All that a player learns before its move in a round, besides its robot's own problem."""

    round: int
    announced: Mapping[str, Value] = field(default_factory=dict)
    messages: Sequence[Delivery] = ()


class PlayerError(UnsupportedError):
    """A player cannot play: its program cannot be started, or it does not exist or does not accept the team.

    Attributes:
        robots: The robots that it should play.
        reason: The reason.
    """

    def __init__(self, robots: Iterable[str], reason: str) -> None:
        self.robots, self.reason = tuple(robots), reason
        super().__init__(f"the player of {listed(self.robots)}: {reason}")


@contextmanager
def refused_as_player(robots: Iterable[str]) -> Iterator[None]:
    """Convert a refusal in the block to a `PlayerError` about the player of `robots`."""
    try:
        yield
    except (UnsupportedError, UnknownProtocolError) as refused:
        raise PlayerError(robots, str(refused)) from refused


class Players(ABC):
    """Players of one or several robots of a team.

    Attributes:
        kind: The kind of the players, for the report.
        robots: The robots that they play.
    """

    kind: str
    robots: tuple[str, ...]

    @abstractmethod
    def choose(self, seen: Mapping[str, Seen]) -> Mapping[str, Move]:
        """Return the move of each robot, given what it has seen."""

    def end(self, rounds: TeamRounds) -> None:  # noqa: B027 - optional
        """End the game: notify the players, and release all resources."""

    def close(self) -> None:  # noqa: B027 - optional
        """Release all resources at once. It may be called several times, also after an error."""
