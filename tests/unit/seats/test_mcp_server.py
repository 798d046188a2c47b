"""A seat for MCP clients: the package's own client plays a robot through `robochoc play --mcp`."""

from __future__ import annotations

import sys
from collections.abc import Awaitable, Callable
from pathlib import Path

import anyio
import pytest
from mcp import Client, StdioServerParameters
from mcp.client.stdio import stdio_client
from mcp.types import CallToolResult, TextContent

import robochoc
from robochoc.formats import write_team
from robochoc.seats import GameOptions, Limits
from robochoc.seats.mcp_server import SeatTools, seat_server
from robochoc.seats.seat_game import SeatGame
from robochoc.solver.errors import UnsupportedError
from tests.support.limits import HANG_S
from tests.support.program import ROOT, robochoc_within
from tests.support.seats import lamps

Call = Callable[..., Awaitable[CallToolResult]]
LIMITS = Limits(messages=1, characters_each=20, characters=25)


def text(result: CallToolResult) -> str:
    content = result.content[0]
    assert isinstance(content, TextContent)
    return content.text


def in_process(playing: Callable[[Call], Awaitable[None]], rounds: int = 2) -> SeatGame:
    """Play a game of lamps against greedy robots, in this process, and return it."""
    game = SeatGame(lamps(), "r1", GameOptions(others="greedy", rounds=rounds, limits=LIMITS))
    server = seat_server(game, LIMITS, lambda report: [f"cost {report.cost}"])

    async def play() -> None:
        async with Client(server) as client:
            with anyio.fail_after(HANG_S):
                await playing(lambda name, **given: client.call_tool(name, given))

    try:
        anyio.run(play)
    finally:
        game.close()
    return game


def test_a_game_over_stdio_with_journal(tmp_path: Path) -> None:
    write_team(lamps(), tmp_path / "lamps")
    words = ["-m", "robochoc", "play", str(tmp_path / "lamps"), "--mcp", "r1", "--others", "greedy", "--rounds", "2"]
    journal = tmp_path / "game.journal"
    command = StdioServerParameters(
        command=sys.executable, args=[*words, "--journal", str(journal)], env={"PYTHONPATH": str(ROOT)}, cwd=str(ROOT)
    )

    async def play() -> None:
        async with Client(stdio_client(command)) as client:
            with anyio.fail_after(HANG_S):
                assert client.server_info is not None
                assert client.server_info.version == robochoc.__version__
                tools = {tool.name for tool in (await client.list_tools()).tools}
                assert tools == {"see_problem", "see_messages", "propose", "say", "end_turn"}
                assert "1. r1.c = 0 (private cost 0)" in text(await client.call_tool("see_problem", {}))
                await client.call_tool("propose", {"value": 2})
                await client.call_tool("say", {"to": "r0", "text": "hello"})
                assert "Round 2 of 2." in text(await client.call_tool("end_turn", {"tokens": 7}))
                assert "r0 announced" in text(await client.call_tool("see_messages", {}))
                assert "lamps: 2 rounds, cost " in text(await client.call_tool("end_turn", {}))
                assert (await client.call_tool("end_turn", {})).is_error

    anyio.run(play)
    assert "hello" in robochoc_within("journal", "export", journal, "--format", "words").stdout + journal.read_text(
        errors="replace"
    )


def test_the_report_has_lies_texts_and_tokens() -> None:
    async def playing(call: Call) -> None:
        await call("propose", value=1, announce=3)
        await call("say", to="r2", text="I take 2\x1b[31m")
        await call("end_turn", tokens=9)
        await call("end_turn", tokens=10**30)

    report = in_process(playing).report
    assert report is not None
    seat = report["r1"]
    assert (seat.player, seat.texts, seat.lies) == ("seat", 1, (1,))
    assert seat.tokens >= 9


@pytest.mark.parametrize(
    ("tool", "given", "says"),
    [
        ("propose", {"value": 4}, "choose a number from 1 to 3"),
        ("propose", {"value": 0}, "choose a number from 1 to 3"),
        ("propose", {"value": "red"}, 'value cannot be "red": choose a number from 1 to 3'),
        ("propose", {"value": True}, "value cannot be true: choose a number from 1 to 3"),
        ("propose", {"value": "1"}, 'value cannot be "1": choose a number from 1 to 3'),
        ("propose", {"value": 1.0}, "value cannot be 1.0: choose a number from 1 to 3"),
        ("propose", {}, "value is missing: choose a number from 1 to 3"),
        ("propose", {"value": 1, "color": 2}, "propose has no argument 'color': its arguments are value and announce"),
        ("see_problem", {"robot": "r0"}, "see_problem has no argument 'robot': it has no arguments"),
        ("say", {"to": "r0", "text": 7}, "text cannot be 7: give a text"),
        ("propose", {"value": 1, "announce": -1}, "choose a number from 1 to 3"),
        ("say", {"to": "r3", "text": "hello"}, "choose one of r0, r2"),
        ("say", {"to": "r0", "text": "x" * 21}, "the text has 21 characters"),
        ("end_turn", {"tokens": "many"}, 'tokens cannot be "many": give a whole number of at least 0'),
        ("end_turn", {"tokens": -1}, "tokens cannot be -1: give a whole number of at least 0"),
    ],
)
def test_a_wrong_call_is_an_error_in_words(tool: str, given: dict[str, object], says: str) -> None:
    async def playing(call: Call) -> None:
        result = await call(tool, **given)
        assert result.is_error
        assert says in text(result)

    in_process(playing)


def test_one_broken_rule_is_singular() -> None:
    model = robochoc.Model("colours")
    one, other = (model.robot(f"r{number}").variable("c", range(2)) for number in range(2))
    model.add(one != other)
    game = SeatGame(model.team, "r1", GameOptions(others="script:0", rounds=2, optimum=None))
    tools = SeatTools(game, LIMITS, lambda _: [])
    assert "1. r1.c = 0: 0, 1 broken rule\n" in tools.end_turn()
    game.close()


def test_limits_and_the_end() -> None:
    async def playing(call: Call) -> None:
        await call("say", to="r0", text="x" * 20)
        assert "end your turn" in text(await call("say", to="r0", text="y"))
        await call("end_turn")
        await call("say", to="r0", text="x" * 20)
        await call("end_turn")
        assert "The game is over." in text(await call("see_messages"))
        for tool, given in (("propose", {"value": 1}), ("say", {"to": "r0", "text": "x"}), ("end_turn", {})):
            assert "the game is over" in text(await call(tool, **given))

    report = in_process(playing).report
    assert report is not None
    assert dict(report["r1"].broken_rules) == {"too-many": 1}


def test_the_extra_is_missing(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "mcp.server.mcpserver", None)
    game = SeatGame(lamps(), "r1", GameOptions(others="greedy"))
    with pytest.raises(UnsupportedError, match=r"pip install 'robochoc\[mcp\]'"):
        seat_server(game, LIMITS, lambda _: [])
    game.close()


def test_wrong_robots() -> None:
    for robot, options, says in (
        ("r9", GameOptions(), "no robot 'r9'"),
        ("r1", GameOptions(players={"r1": "random"}), "two players"),
    ):
        with pytest.raises(UnsupportedError, match=says):
            SeatGame(lamps(), robot, options)
