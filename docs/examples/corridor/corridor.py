"""Two robots patrol between two halls, through a corridor that is too narrow for both. They swap places each time.

Before a robot enters the corridor, the robots decide on their order: a constraint problem with a turn for each robot,
whose turns differ. A robot enters only after all robots with earlier turns have arrived. So a robot waits only for
robots with earlier turns: there is no circle of waiting robots, and the robot with the first turn never waits. A robot
in the corridor can always leave it, since each robot has its own bay in both halls.

    python corridor.py 100
"""

from __future__ import annotations

import os
import sys
from collections.abc import Mapping, Sequence
from functools import cache
from random import Random

import robochoc

LENGTH = 5
"""The number of cells of the corridor. A robot at 0 or `LENGTH` + 1 is in a hall."""
HALLS = (0, LENGTH + 1)
_FAR = 100

Positions = tuple[int, ...]
"""The cell of each robot."""
Turns = tuple[int, ...]
"""The turn of each robot, from 1."""


def decide(distances: Sequence[int], protocol: str = "dpop") -> Turns:
    """Return the turns of robots at these distances from the corridor: near robots come first.

    Each robot knows only its own distance.
    """
    model = robochoc.Model("corridor")
    robots = [model.robot(f"robot{number}") for number, _ in enumerate(distances)]
    turns = [robot.variable("turn", range(1, len(distances) + 1)) for robot in robots]
    model.add(robochoc.all_different(turns))
    model.minimize(sum(turn * (_FAR - distance) for turn, distance in zip(turns, distances, strict=True)))
    solution = model.solve(protocol)
    return tuple(int(str(solution[turn])) for turn in turns)


def able_to_move(positions: Positions, goals: Positions, turns: Turns) -> list[int]:
    """Return the robots that may move by one cell: those in the corridor, and those whose turn it is to enter."""
    return [
        robot
        for robot, (at, goal) in enumerate(zip(positions, goals, strict=True))
        if at != goal and (at not in HALLS or _is_next(robot, positions, goals, turns))
    ]


def _is_next(robot: int, positions: Positions, goals: Positions, turns: Turns) -> bool:
    """Return whether all robots with earlier turns have arrived."""
    return all(positions[other] == goals[other] for other, turn in enumerate(turns) if turn < turns[robot])


def moved(positions: Positions, goals: Positions, robot: int) -> Positions:
    """Return the positions after a robot has moved by one cell towards its goal."""
    step = 1 if goals[robot] > positions[robot] else -1
    return tuple(at + step if number == robot else at for number, at in enumerate(positions))


def opposite(positions: Positions) -> Positions:
    """Return the other hall for each robot."""
    return tuple(HALLS[1] if at == HALLS[0] else HALLS[0] for at in positions)


def in_corridor(positions: Positions) -> int:
    """Return the number of robots in the corridor."""
    return sum(at not in HALLS for at in positions)


def swap(positions: Positions, turns: Turns, chance: Random) -> Positions:
    """Return the positions after all robots have crossed the corridor, at random speeds.

    Raises:
        AssertionError: No robot can move, or two robots are in the corridor.
    """
    goals = opposite(positions)
    while positions != goals:
        able = able_to_move(positions, goals, turns)
        if not able:
            raise AssertionError(f"deadlock at {positions}")
        positions = moved(positions, goals, chance.choice(able))
        if in_corridor(positions) > 1:
            raise AssertionError(f"two robots in the corridor at {positions}")
    return positions


def reachable(start: Positions, turns: Turns) -> Mapping[Positions, list[Positions]]:
    """Return all positions that can be reached by any order of moves, each with the next positions."""
    goals = opposite(start)
    found: dict[Positions, list[Positions]] = {}
    waiting = [start]
    while waiting:
        positions = waiting.pop()
        if positions not in found:
            found[positions] = [moved(positions, goals, robot) for robot in able_to_move(positions, goals, turns)]
            waiting += found[positions]
    return found


def main(swaps: int) -> None:
    """Swap places many times, with random distances, and print the result."""
    chance = Random(1)
    positions: Positions = HALLS
    cached = cache(decide)  # equal distances lead to equal turns
    first = 0
    for _ in range(swaps):
        turns = cached(tuple(chance.randrange(10) for _ in positions))
        first += turns[0] == 1
        positions = swap(positions, turns, chance)
    try:
        print(f"{swaps:,} swaps, robot0 first in {first:,}, no deadlock", flush=True)
    except BrokenPipeError:  # the reader of the output has ended
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())  # else Python fails again when it ends
        sys.exit(1)


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 100)
