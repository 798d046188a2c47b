"""A game in which the caller plays one robot, move by move: for an MCP client, or a person in the application."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import msgspec

from robochoc.journal.recorder import JournalRecorder
from robochoc.model.problem import Team
from robochoc.rounds.optimum import certified_optimum
from robochoc.seats.game import Game, GameOptions, refuse_options
from robochoc.seats.json_lines import Labelled, Notation, read_move
from robochoc.seats.moves import Breach, Move, Players, Seen
from robochoc.seats.report import GameReport
from robochoc.seats.words import problem_in_words
from robochoc.solver.errors import UnsupportedError
from robochoc.solver.local_problem import LexicographicCost


class _Seat(Players):
    """The player of one robot, whose move the caller sets before each round."""

    kind = "seat"

    def __init__(self, robot: str) -> None:
        self.robots = (robot,)
        self.move = Move()

    def choose(self, seen: Mapping[str, Seen]) -> Mapping[str, Move]:
        """Return the move that the caller has set."""
        return dict.fromkeys(seen, self.move)


class SeatGame:
    """A game in which the caller plays one robot. `close` must be called unless all rounds are played.

    Args:
        team: The team.
        robot: The robot that the caller plays.
        options: The players of all other robots, the rounds and the limits. There is no time limit.
        recorder: Records the game; None: no journal.

    Attributes:
        robot: The robot.
        problem: The robot's problem in words.
        rounds: The number of rounds.
        neighbours: The robot's neighbours.
        values: The values of the robot, by variable.
        private_costs: The private cost of each of `values`.

    Raises:
        InvalidInputError: if the team is not valid.
        PlayerError: if a player is not known or cannot play.
        UnsupportedError: if the options do not fit each other or the team.
    """

    def __init__(self, team: Team, robot: str, options: GameOptions, recorder: JournalRecorder | None = None) -> None:
        refuse_options(team, options)
        if robot not in team.order:
            raise UnsupportedError(f"{team.name} has no robot {robot!r}: its robots are {', '.join(team.order)}")
        if robot in options.players or robot in options.commands:
            raise UnsupportedError(f"{robot} has two players: name one")
        optimum = None if options.optimum is None else certified_optimum(team, options.optimum)
        self._seat = _Seat(robot)
        self._game = Game(team, options, optimum, recorder, self._seat)
        self._limits, self._recorder = options.limits, recorder
        self._notation = Notation(self._game.rounds, robot)
        self.robot, self.rounds = robot, options.rounds
        self.problem = problem_in_words(team, robot)
        own = self._game.rounds.problems[robot]
        self.neighbours: Sequence[str] = own.neighbours
        self.values: Sequence[Labelled] = [self._notation.own(index) for index in range(len(own.values))]
        self.private_costs: Sequence[int | float] = own.charges
        self._turns = self._game.turns()
        self._seen: Seen | None = next(self._turns)[robot]

    @property
    def report(self) -> GameReport | None:
        """The report; None before the end of the game."""
        return self._game.report

    def report_so_far(self) -> GameReport | None:
        """Return the report of the rounds that have been played; None if there are none."""
        return self._game.report_so_far() if self.round > 1 or self.report else None

    @property
    def round(self) -> int:
        """The number of the present round, from 1; after the game, the number of rounds."""
        return self._seen.round if self._seen else self.rounds

    @property
    def announced(self) -> dict[str, Labelled]:
        """The value that each neighbour announced in the previous round."""
        known = self._seen.announced if self._seen else self._game.rounds.view(self.robot)
        return {name: self._notation.of(name, value) for name, value in known.items()}

    @property
    def messages(self) -> list[tuple[str, str]]:
        """The texts received in the previous round, with their senders. Claims are put in words."""
        return [
            (one.sender, one.text or self._claim(one.sender, one.claim)) for one in (self._seen or Seen(0)).messages
        ]

    def _claim(self, sender: str, claim: tuple[Any, int] | None) -> str:
        value, cost = claim or ((), 0)
        return f"my private cost of {value_text(self._notation.of(sender, value))} is {cost}"

    def costs(self) -> list[LexicographicCost]:
        """Return violations and cost of each of `values`, if the neighbours have the values that they announced."""
        return self._game.rounds.costs(self.robot)

    def play(
        self,
        value: int | None,
        announce: int | None = None,
        texts: Sequence[tuple[str, str]] = (),
        tokens: int = 0,
    ) -> tuple[Breach, ...]:
        """Play a round. The rules are those of programs (docs/reference/seats.md).

        Args:
            value: The index of the value; None: the robot keeps its value.
            announce: The index of the value that the neighbours see; None: `value`.
            texts: Texts and the neighbours that receive them.
            tokens: The number of tokens that the player has used.

        Returns:
            The rules that the move has broken.

        Raises:
            UnsupportedError: if the game is over.
        """
        if self._seen is None:
            raise UnsupportedError("the game is over")
        line: dict[str, object] = {"type": "move", "round": self._seen.round, "tokens": tokens}
        if value is not None:
            line["value"] = self.values[value]
        if announce is not None:
            line["announce"] = self.values[announce]
        line["say"] = [{"to": name, "text": text} for name, text in texts]
        encoded = msgspec.json.encode(line)
        move = read_move(encoded, self._seen.round, self._notation, self.neighbours, self._limits)
        assert move is not None  # noqa: S101 - for mypy: the move is for the present round
        self._seat.move = move
        following = next(self._turns, None)
        self._seen = following[self.robot] if following else None
        if self._seen is None and self._recorder:
            self._recorder.outcome = self._game.outcome()
        return move.breaches

    def close(self) -> None:
        """End the game, and all programs in it."""
        self._turns.close()


def value_text(labelled: Mapping[str, float | str]) -> str:
    """Return a value in words: `V1 = 2, V2 = red`."""
    return ", ".join(f"{name} = {part}" for name, part in labelled.items())
