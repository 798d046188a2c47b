"""Outside programs as players: each plays one robot by JSON lines over its standard input and output."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from robochoc.rounds.team_rounds import TeamRounds
from robochoc.seats.json_lines import Notation, end_line, read_move, round_line, welcome
from robochoc.seats.line_process import LineProcess, exchange
from robochoc.seats.moves import Breach, Limits, Move, Players, Rule, Seen, refused_as_player


class CommandSeats(Players):
    """All robots of a game that outside programs play. In a round, all programs have the same time.

    Args:
        rounds: The team.
        commands: The command for each robot, with its arguments.
        words: The problem of each of these robots, in words.
        number: The number of rounds.
        limits: The limits on each program.

    Raises:
        PlayerError: if a program cannot be started.
    """

    kind = "program"

    def __init__(
        self,
        rounds: TeamRounds,
        commands: Mapping[str, Sequence[str]],
        words: Mapping[str, str],
        number: int,
        limits: Limits,
    ) -> None:
        self.robots = tuple(commands)
        self._rounds, self._limits = rounds, limits
        self._notations = {name: Notation(rounds, name) for name in commands}
        self._processes: dict[str, LineProcess] = {}
        try:
            for name, command in commands.items():
                with refused_as_player([name]):
                    self._processes[name] = LineProcess(command)
                self._processes[name].send(welcome(rounds, words[name], self._notations[name], number, limits))
        except BaseException:
            self.close()
            raise

    def choose(self, seen: Mapping[str, Seen]) -> Mapping[str, Move]:
        """Ask all programs for their moves, and return them. A program without a move keeps its value."""
        was_running = {name for name, one in self._processes.items() if not one.ended}
        for name, one in self._processes.items():
            one.begin_round()
            one.send(round_line(seen[name], self._rounds.costs(name), self._notations[name]))
        moves: dict[str, Move] = {}

        def accept(name: str, line: bytes) -> bool:
            neighbours = self._rounds.problems[name].neighbours
            move = read_move(line, seen[name].round, self._notations[name], neighbours, self._limits)
            if move is not None:
                moves[name] = move
            return move is not None

        exchange(self._processes, accept, self._limits.timeout_s)
        return {name: self._judged(name, seen[name].round, moves.get(name), name in was_running) for name in seen}

    def _judged(self, name: str, number: int, move: Move | None, was_running: bool) -> Move:  # noqa: FBT001
        """Return the move, with the broken rules that concern the program's output."""
        one = self._processes[name]
        found: list[Breach] = []
        if one.oversized:
            found.append(Breach(number, Rule.OVERSIZED, f"{one.oversized} lines were too long"))
        if one.flooding and was_running:
            found.append(Breach(number, Rule.FLOODING))
        elif one.ended and was_running:
            found.append(Breach(number, Rule.ENDED))
        if move is None:
            if not one.ended:
                found.append(Breach(number, Rule.LATE))
            return Move(breaches=tuple(found))
        return Move(move.value, move.announced, move.statements, move.tokens, (*move.breaches, *found))

    def end(self, rounds: TeamRounds) -> None:
        """Send each program the end of the game, and end it."""
        for name, one in self._processes.items():
            one.send(end_line(rounds, self._notations[name]))
        exchange(self._processes, lambda _name, _line: False, min(1.0, self._limits.timeout_s))
        self.close()

    def close(self) -> None:
        """End all programs."""
        for one in self._processes.values():
            one.end()
