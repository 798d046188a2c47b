"""The built-in players: baselines to which outside players are compared."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from random import Random

from robochoc.rounds.optimum import Optimum
from robochoc.rounds.team_rounds import TeamRounds
from robochoc.seats.moves import Move, Players, Seen
from robochoc.solver.errors import UnsupportedError


class RandomPlayer(Players):
    """Plays a random value in each round."""

    kind = "random"

    def __init__(self, rounds: TeamRounds, robot: str, seed: int) -> None:
        self.robots = (robot,)
        self._number = len(rounds.problems[robot].values)
        self._random = Random(f"{seed} {robot}")  # noqa: S311 - a player, no secret

    def choose(self, seen: Mapping[str, Seen]) -> Mapping[str, Move]:
        """Return a random value."""
        return {name: Move(self._random.randrange(self._number)) for name in seen}


class GreedyPlayer(Players):
    """Plays the best answer to the values that its neighbours have announced; in the first round, to no values."""

    kind = "greedy"

    def __init__(self, rounds: TeamRounds, robot: str) -> None:
        self.robots = (robot,)
        self._rounds = rounds

    def choose(self, seen: Mapping[str, Seen]) -> Mapping[str, Move]:
        """Return the first of the best values."""
        found = {}
        for name in seen:
            costs = self._rounds.costs(name)
            found[name] = Move(costs.index(min(costs)))
        return found


class ScriptedPlayer(Players):
    """Plays the values in a list, one in each round, and then the last one again."""

    kind = "script"

    def __init__(self, rounds: TeamRounds, robot: str, script: Sequence[int]) -> None:
        number = len(rounds.problems[robot].values)
        wrong = [index for index in script if not 0 <= index < number]
        if wrong or not script:
            place = f"{wrong[0]} is not one of them" if wrong else "the list is empty"
            raise UnsupportedError(f"the script of {robot} needs indices of values from 0 to {number - 1}: {place}")
        self.robots = (robot,)
        self._script = [*script]

    def choose(self, seen: Mapping[str, Seen]) -> Mapping[str, Move]:
        """Return the value of this round."""
        return {name: Move(self._script[min(one.round, len(self._script)) - 1]) for name, one in seen.items()}


class OptimalPlayer(Players):
    """Plays the robot's value in the certified optimum, whatever its neighbours do."""

    kind = "optimal"

    def __init__(self, rounds: TeamRounds, robot: str, optimum: Optimum | None) -> None:
        index = None if optimum is None else rounds.index_of(robot, optimum.assignment)
        if index is None:
            raise UnsupportedError(f"{robot} cannot play the optimum, which is not known: choose another player")
        self.robots = (robot,)
        self._move = Move(index)

    def choose(self, seen: Mapping[str, Seen]) -> Mapping[str, Move]:
        """Return the value in the optimum."""
        return dict.fromkeys(seen, self._move)
