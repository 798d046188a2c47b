"""The protocol between robochoc and an outside player: one JSON object per line (docs/reference/seats.md).

The player is untrusted: lines are decoded strictly, and everything else is a broken rule.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import msgspec

from robochoc.model.problem import Value
from robochoc.rounds.team_rounds import TeamRounds
from robochoc.seats.moves import Breach, Limits, Move, Rule, Seen, Statement
from robochoc.solver.local_problem import LexicographicCost
from robochoc.system.plain_text import LONGEST_REASON, on_one_line, printable

VERSION = 1
"""The version of the protocol. It is increased if something is removed or changes its meaning."""
MAX_TOKENS = 1 << 53
Labelled = dict[str, int | float | str]
"""The values of a robot's variables, in the user's notation."""


class _Claim(msgspec.Struct, forbid_unknown_fields=True, frozen=True):
    """The claim that `value` has the private cost `cost`."""

    value: Labelled
    cost: int


class _Say(msgspec.Struct, forbid_unknown_fields=True, frozen=True):
    """A message to the neighbour `to`."""

    to: str
    text: str | None = None
    claim: _Claim | None = None


class _MoveLine(msgspec.Struct, tag="move", tag_field="type", forbid_unknown_fields=True, frozen=True):
    """The move of a player in a round."""

    round: int
    value: Labelled | None = None
    announce: Labelled | None = None
    say: list[_Say] = []
    tokens: int = 0


_decode = msgspec.json.Decoder(_MoveLine).decode
_encode = msgspec.json.Encoder().encode


class Notation:
    """The values of one robot and its neighbours in the notation of the JSON lines."""

    def __init__(self, rounds: TeamRounds, robot: str) -> None:
        self.robot = robot
        self._rounds = rounds
        self._names = rounds.team[robot].interface
        self._index = {
            tuple(str(part) for part in self.own(index).values()): index
            for index in range(len(rounds.problems[robot].values))
        }

    def own(self, index: int) -> Labelled:
        """Return the robot's value with this index."""
        return self.of(self.robot, self._rounds.problems[self.robot].values[index])

    def of(self, robot: str, value: Value) -> Labelled:
        """Return the value of `robot`, by variable."""
        team = self._rounds.team
        pairs = zip(team[robot].interface, value, strict=True)
        return {name: team.variables[name].domain.label(part) for name, part in pairs if part is not None}

    def index(self, labelled: Mapping[str, float | str]) -> int | None:
        """Return the index of the robot's value; None if it cannot have it."""
        if labelled.keys() != {*self._names}:
            return None
        return self._index.get(tuple(str(labelled[name]) for name in self._names))


def welcome(rounds: TeamRounds, original: str, notation: Notation, number: int, limits: Limits) -> bytes:
    """Return the first line: the robot's problem, the number of rounds, and the limits."""
    problem = rounds.problems[notation.robot]
    variables = rounds.team.variables
    return _line(
        type="welcome",
        version=VERSION,
        robot=notation.robot,
        team=rounds.team.name,
        rounds=number,
        timeout_s=limits.timeout_s,
        limits={
            "messages": limits.messages,
            "characters_each": limits.characters_each,
            "characters": limits.characters,
        },
        problem=original,
        values=[{"value": notation.own(index), "cost": cost} for index, cost in enumerate(problem.charges)],
        neighbours=[
            {
                "robot": name,
                "variables": {
                    variable: [variables[variable].domain.label(part) for part in variables[variable].domain]
                    for variable in rounds.team[name].interface
                },
            }
            for name in problem.neighbours
        ],
    )


def round_line(seen: Seen, costs: Sequence[LexicographicCost], notation: Notation) -> bytes:
    """Return the line that begins a round: announced values, received messages, and the cost of each own value."""
    messages: list[dict[str, Any]] = []
    for one in seen.messages:
        if one.claim is None:
            messages.append({"from": one.sender, "text": one.text})
        else:
            value, cost = one.claim
            messages.append({"from": one.sender, "claim": {"value": notation.of(one.sender, value), "cost": cost}})
    return _line(
        type="round",
        round=seen.round,
        announced={name: notation.of(name, value) for name, value in seen.announced.items()},
        messages=messages,
        costs=[{"violations": broken, "cost": cost} for broken, cost in costs],
    )


def end_line(rounds: TeamRounds, notation: Notation) -> bytes:
    """Return the last line: the value that the robot plays, and its costs."""
    index = rounds.values[notation.robot]
    broken, cost = rounds.costs(notation.robot)[index]
    return _line(type="end", value=notation.own(index), violations=broken, cost=cost)


def _line(**content: object) -> bytes:
    return _encode(content) + b"\n"


def read_move(line: bytes, number: int, notation: Notation, neighbours: Sequence[str], limits: Limits) -> Move | None:
    """Return the move in a line from a player, with all broken rules.

    Args:
        line: The line, of any content.
        number: The present round.
        notation: The values of the player's robot.
        neighbours: The robot's neighbours.
        limits: The limits on the player.

    Returns:
        The move, without invalid parts; None for a move in an earlier round, which came too late.
    """
    try:
        read = _decode(line)
    except (msgspec.MsgspecError, RecursionError, UnicodeDecodeError) as error:
        return Move(breaches=(Breach(number, Rule.GARBAGE, on_one_line(str(error), LONGEST_REASON)),))
    if read.round < number:
        return None
    breaches: list[Breach] = []
    if read.round > number:
        breaches.append(Breach(number, Rule.GARBAGE, f"a move for round {read.round}"))
        return Move(breaches=tuple(breaches))
    value, announced = (_index(one, number, notation, breaches) for one in (read.value, read.announce))
    if read.value is not None and value is None:
        announced = None
    statements = _statements(read.say, number, notation, neighbours, limits, breaches)
    tokens = min(max(read.tokens, 0), MAX_TOKENS)
    return Move(value, announced, tuple(statements), tokens, tuple(breaches))


def _index(labelled: Labelled | None, number: int, notation: Notation, breaches: list[Breach]) -> int | None:
    """Return the index of a value; report one that the robot cannot have."""
    if labelled is None:
        return None
    index = notation.index(labelled)
    if index is None:
        shown = on_one_line(", ".join(f"{name} = {part}" for name, part in labelled.items()), LONGEST_REASON)
        breaches.append(Breach(number, Rule.INVALID_VALUE, shown))
    return index


def _statements(
    said: Sequence[_Say],
    number: int,
    notation: Notation,
    neighbours: Sequence[str],
    limits: Limits,
    breaches: list[Breach],
) -> list[Statement]:
    """Return the messages that keep the rules; report the others."""
    found: list[Statement] = []
    if len(said) > limits.messages:
        breaches.append(Breach(number, Rule.TOO_MANY, f"{len(said)} messages; {limits.messages} are allowed"))
    for one in said[: limits.messages]:
        if one.to not in neighbours:
            shown = on_one_line(one.to, LONGEST_REASON)
            breaches.append(Breach(number, Rule.WRONG_RECEIVER, f"{shown} is not a neighbour"))
        elif (one.text is None) is (one.claim is None):
            breaches.append(Breach(number, Rule.GARBAGE, "a message has either a text or a claim"))
        elif one.claim is not None:
            index = _index(one.claim.value, number, notation, breaches)
            if index is not None and 0 <= one.claim.cost <= MAX_TOKENS:
                found.append(Statement(one.to, claim=(index, one.claim.cost)))
            elif index is not None:
                breaches.append(Breach(number, Rule.GARBAGE, f"a claimed cost of {one.claim.cost}"))
        elif len(one.text or "") > limits.characters_each:
            breaches.append(Breach(number, Rule.OVERSIZED, f"a text of {len(one.text or ''):,} characters"))
        else:
            found.append(Statement(one.to, printable(" ".join((one.text or "").split()))))
    return found
