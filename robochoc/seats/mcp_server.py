"""A seat for an MCP client: it plays one robot of a team through tools, over standard input and output.

The package `mcp` is an extra and is imported when a server is made. robochoc calls no language model: the client does.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterable, Iterator, Mapping
from functools import wraps
from threading import Lock
from types import NoneType
from typing import IO, TYPE_CHECKING, Any, cast

import msgspec

from robochoc.formats.diagnostics import shortened
from robochoc.seats.moves import Limits
from robochoc.seats.report import GameReport
from robochoc.seats.seat_game import SeatGame, value_text
from robochoc.solver.errors import UnsupportedError
from robochoc.system.plain_text import counted, listed

if TYPE_CHECKING:
    from mcp.server.mcpserver import MCPServer

MOST_TOKENS = 1 << 53
_ARGUMENTS: dict[str, dict[str, tuple[type, ...]]] = {
    "propose": {"value": (int,), "announce": (int, NoneType)},
    "say": {"to": (str,), "text": (str,)},
    "end_turn": {"tokens": (int,)},
}
"""The arguments of the tools, with their types. The package `mcp` would convert other types: true to 1."""
_OPTIONAL = {"announce", "tokens"}
MOST_BYTES = 1 << 20
"""The maximum number of bytes in a line of a client."""


class ClientLines:
    """The lines that a client sends over standard input.

    Attributes:
        error: The reason why no more lines are read, as a clause; empty if the client has closed its end.
    """

    def __init__(self) -> None:
        self.error = ""

    def readline(self) -> str:
        """Return the next line, or an empty text at the end."""
        if sys.stdin is None:
            self.error = "standard input is closed"
            return ""
        try:
            line = sys.stdin.buffer.readline(MOST_BYTES + 1)
        except OSError as error:
            self.error = f"standard input cannot be read: {error.strerror}"
            return ""
        if len(line) > MOST_BYTES:
            self.error = f"it sent a line with more than {MOST_BYTES:,} bytes"
            return ""
        return line.decode(errors="replace")


class SeatTools:
    """The tools of a seat. Values are numbered from 1, in the order of the problem.

    Args:
        game: The game.
        limits: The limits on the player.
        described: Returns the lines of a report.
    """

    def __init__(self, game: SeatGame, limits: Limits, described: Callable[[GameReport], Iterable[str]]) -> None:
        self._game, self._limits, self._described = game, limits, described
        self._lock = Lock()  # tools run in threads
        number = f"choose a number from 1 to {len(game.values)}"
        neighbours = f"choose one of {', '.join(game.neighbours)}" if game.neighbours else "you have no neighbours"
        tokens = "give a whole number of at least 0"
        self._hints = {
            "value": number, "announce": number, "to": neighbours, "text": "give a text", "tokens": tokens,
        }  # fmt: skip
        self._value: int | None = None
        self._announce: int | None = None
        self._texts: list[tuple[str, str]] = []

    def see_problem(self) -> str:
        """Return your robot's problem in words: its values with their private costs, its neighbours and the rules."""
        game, limits = self._game, self._limits
        pairs = zip(game.values, game.private_costs, strict=True)
        values = [f"{at}. {value_text(one)} (private cost {cost:g})" for at, (one, cost) in enumerate(pairs, 1)]
        rounds = (
            f"The game has {game.rounds} rounds. In each, all robots choose a value at the same time, and announce it"
            " to their neighbours. The values in the last round are the result."
        )
        texts = (
            f"You may send {limits.messages} texts in a round, of {limits.characters_each:,} characters each and"
            f" {limits.characters:,} together in the game."
        )
        neighbours = f"Your neighbours: {', '.join(game.neighbours) or 'none'}."
        return "\n".join([game.problem, "", "Your values:", *values, "", neighbours, rounds, texts])

    def see_messages(self) -> str:
        """Return the values that your neighbours announced, their texts, and what each of your values would cost."""
        with self._lock:
            return "\n".join(self._state())

    def _state(self) -> Iterator[str]:
        game = self._game
        if game.report is not None:
            yield "The game is over."
            yield from self._described(game.report)
            return
        yield f"Round {game.round} of {game.rounds}."
        for name, value in game.announced.items():
            yield f"{name} announced {value_text(value)}."
        for name, text in game.messages:
            yield f"{name} says: {text}"
        yield "If these values stay, your values cost:"
        for number, (broken, cost) in enumerate(game.costs(), 1):
            rules = f", {counted(broken, 'broken rule')}" if broken else ""
            yield f"{number}. {value_text(game.values[number - 1])}: {cost:g}{rules}"

    def propose(self, value: int, announce: int | None = None) -> str:
        """Choose a value for this round, by its number. Your neighbours see `announce`, if you give it, else the value.

        Announcing another value than yours is a lie, which the report names. You may choose again before `end_turn`.
        """
        with self._lock:
            self._refuse_after_the_end()
            chosen = self._index(value)
            self._announce = None if announce is None else self._index(announce)
            self._value = chosen
            return f"You play {value_text(self._game.values[chosen])} in round {self._game.round}. Now end your turn."

    def say(self, to: str, text: str) -> str:
        """Send a text to a neighbour. It arrives before the next round."""
        with self._lock:
            self._refuse_after_the_end()
            if to not in self._game.neighbours:
                raise UnsupportedError(f"{to!r:.100} is not a neighbour: {self._hints['to']}")
            if len(self._texts) >= self._limits.messages:
                raise UnsupportedError(f"you have sent {self._limits.messages} texts in this round: end your turn")
            if len(text) > self._limits.characters_each:
                raise UnsupportedError(f"the text has {len(text):,} characters: send {self._limits.characters_each:,}")
            self._texts.append((to, text))
            return f"{to} receives the text before the next round."

    def end_turn(self, tokens: int = 0) -> str:
        """End your turn. Return the state of the next round or, after the last round, the report of the game.

        `tokens` is the number of tokens that you used in this turn, for the report. If you have not chosen a value, you
        keep your last one.
        """
        with self._lock:
            self._refuse_after_the_end()
            if tokens < 0:
                raise UnsupportedError(f"tokens cannot be {tokens}: {self._hints['tokens']}")
            broken = self._game.play(self._value, self._announce, self._texts, min(tokens, MOST_TOKENS))
            self._value = self._announce = None
            self._texts = []
            return "\n".join([*(f"Broken rule: {one.rule} {one.details}" for one in broken), *self._state()])

    def _refuse_after_the_end(self) -> None:
        if self._game.report is not None:
            raise UnsupportedError("the game is over")

    def _index(self, number: int) -> int:
        if not 1 <= number <= len(self._game.values):
            raise UnsupportedError(f"there is no value {number}: {self._hints['value']}")
        return number - 1

    def refuse_wrong_arguments(self, tool: str, given: Mapping[str, object]) -> None:
        """Raise `UnsupportedError` if arguments of a tool are unknown, missing, or of a wrong type."""
        types = _ARGUMENTS.get(tool, {})
        for name, value in given.items():
            if name not in types:
                known = f"its arguments are {listed(types)}" if types else "it has no arguments"
                raise UnsupportedError(f"{tool} has no argument {name!r:.100}: {known}")
            if type(value) not in types[name]:
                shown = shortened(msgspec.json.encode(value).decode())
                raise UnsupportedError(f"{name} cannot be {shown}: {self._hints[name]}")
        if missing := [name for name in types if name not in given and name not in _OPTIONAL]:
            raise UnsupportedError(f"{missing[0]} is missing: {self._hints[missing[0]]}")


def seat_server(
    game: SeatGame,
    limits: Limits,
    described: Callable[[GameReport], Iterable[str]],
    version: str = "",
    lines: ClientLines | None = None,
) -> MCPServer:
    """Return an MCP server with the tools of a seat; for the arguments see `SeatTools`. `version` is robochoc's.

    `lines` are the lines of the client; None: the package reads standard input.

    Raises:
        UnsupportedError: if the package `mcp` is not installed.
    """
    try:
        from anyio import wrap_file  # noqa: PLC0415 - comes with mcp
        from mcp.server.mcpserver import MCPServer  # noqa: PLC0415 - an extra
        from mcp.server.mcpserver.exceptions import ToolError  # noqa: PLC0415
        from mcp.server.stdio import stdio_server  # noqa: PLC0415
    except ImportError:
        raise UnsupportedError("a seat for MCP clients requires mcp: run pip install 'robochoc[mcp]'") from None
    tools = SeatTools(game, limits, described)

    class SeatServer(MCPServer):
        """A server that reads `lines`, and checks arguments before the package converts them."""

        async def run_stdio_async(self) -> None:
            stdin = wrap_file(cast("IO[str]", lines)) if lines else None
            async with stdio_server(stdin=stdin) as (received, sent):
                server = self._lowlevel_server
                await server.run(received, sent, server.create_initialization_options())

        async def call_tool(self, name: str, arguments: dict[str, Any], context: Any = None) -> Any:  # noqa: ANN401 - as in the base class
            try:
                tools.refuse_wrong_arguments(name, arguments)
            except UnsupportedError as refused:
                raise ToolError(str(refused)) from None
            return await super().call_tool(name, arguments, context)

    server = SeatServer(
        "robochoc",
        version=version,
        instructions=f"You play the robot {game.robot}. Call see_problem first. In each round, call see_messages,"
        " propose a value, say something if you like, and call end_turn.",
        log_level="ERROR",
    )

    def refusing(tool: Callable[..., str]) -> Callable[..., str]:
        @wraps(tool)
        def call(*arguments: object, **named: object) -> str:
            try:
                return tool(*arguments, **named)
            except UnsupportedError as refused:
                raise ToolError(str(refused)) from None

        return call

    for tool in (tools.see_problem, tools.see_messages, tools.propose, tools.say, tools.end_turn):
        server.tool()(refusing(tool))
    return server
