"""The sniffer's server: every answer, nobody else's business, files that grow, and pages that are slow."""

from __future__ import annotations

import asyncio
import io
import math
import os
import socket
import time
from collections.abc import Callable, Iterator
from concurrent.futures import Future
from pathlib import Path
from typing import Any, NamedTuple

import msgspec
import pytest
from tornado.httpclient import HTTPClientError, HTTPRequest
from tornado.websocket import WebSocketClientConnection, websocket_connect

from robochoc.journal.events import AnyEvent
from robochoc.journal.journal import lines_of, read_journal
from robochoc.model.outcome import Outcome
from robochoc.run.options import Runtime
from robochoc.sniffer import live_trace, server
from robochoc.sniffer.page_data import message_columns, step_columns
from robochoc.sniffer.session import SnifferSession
from robochoc.sniffer.trace import Trace
from tests.support.cases import cases
from tests.support.limits import HANG_S, wait_until
from tests.support.sniffer_server import TOKEN, SnifferServer, header, journal_of, run_events, sniffer_server


class Run(NamedTuple):
    """A run in the simulator, its journal, and the trace of that."""

    events: list[AnyEvent]
    outcome: Outcome
    whole: bytes
    trace: Trace


@pytest.fixture(scope="module")
def run() -> Run:
    events, outcome = run_events()
    whole = journal_of(events, outcome)
    return Run(events, outcome, whole, Trace.of(read_journal(whole)))


@pytest.fixture(autouse=True)
def whole(monkeypatch: pytest.MonkeyPatch) -> None:
    """A journal is shown when it has been read to its end, however slow the machine is at the moment."""
    monkeypatch.setattr(live_trace, "_AT_ONCE_S", math.inf)


@pytest.fixture
def file(tmp_path: Path, run: Run) -> Path:
    path = tmp_path / "run.journal"
    path.write_bytes(run.whole)
    return path


@pytest.fixture
def page(file: Path) -> Iterator[SnifferServer]:
    with sniffer_server(SnifferSession(file, chosen=("Robot1.*",))) as running:
        yield running


def test_every_answer_is_the_journals(page: SnifferServer, file: Path, run: Run) -> None:
    about = page.json("about")
    messages, steps = len(run.trace.messages.t), len(run.trace.steps.t)
    assert (about["messages"], about["steps"], about["over"], about["chosen"]) == (messages, steps, True, ["Robot1.*"])
    assert page.get(f"columns?from=0&to={messages}") == message_columns(run.trace, 0, messages)
    assert page.get(f"columns?from=3&to={messages - 5}") == message_columns(run.trace, 3, messages - 5)
    assert page.get(f"steps?from=2&to={steps}") == step_columns(run.trace, 2, steps)
    assert page.json("decisions?from=0&to=2") == [list(decision) for decision in run.trace.decisions[:2]]
    details = page.json("details?chunk=0")
    assert len(details) == min(messages, 1024)
    assert details[7]["content"] == run.trace.content(7)
    found = page.json(f"search?text=Robot1.1%20Robot&from=0&to={messages}")
    assert 0 < len(found["hits"]) < found["to"] <= messages
    assert page.get("journal") == file.read_bytes()


def test_the_text_form_is_served_too(tmp_path: Path, run: Run) -> None:
    path = tmp_path / "run.jsonl"
    path.write_bytes(b"".join(lines_of(read_journal(run.whole))))
    with sniffer_server(SnifferSession(path)) as page:
        assert page.get("columns?from=0&to=50") == message_columns(run.trace, 0, 50)


def test_what_a_robot_knew_comes_in_chunks(page: SnifferServer, run: Run) -> None:
    why_not = page.json("about")["replay"]
    if why_not:
        assert page.refusal("states?robot=0&chunk=0")[0] == 400
        return
    states = page.json("states?robot=1&chunk=0")
    own = [step for step in range(len(run.trace.steps.t)) if run.trace.steps.robot[step] == 1]
    assert [state["step"] for state in states] == [*range(min(64, len(own)))]
    assert page.json("states?robot=1&chunk=1000") == []


def test_the_scene_moves_by_decisions(page: SnifferServer, run: Run) -> None:
    scene = page.json("scene")
    assert len(scene["drones"]) == 16
    assert scene["commands"]
    assert scene["decisions"] == len(run.trace.decisions)
    step, values = next((step, values) for step, values in run.trace.decisions if values)
    drone = next(
        n for n, one in enumerate(scene["drones"]) if one["robot"] == run.trace.robots[run.trace.steps.robot[step]]
    )
    moved = next(move for move in scene["moves"] if move[:2] == [step, drone])
    x, y, ground = scene["drones"][drone]["ground"]
    assert moved[2:] == [x, y, ground + next(iter(values.values()))]
    rest = page.json(f"scene?from={scene['decisions'] - 1}")
    assert rest["commands"] == []
    assert rest["moves"] == scene["moves"][-len(rest["moves"]) :]


MISSING: list[str] = [
    "columns",
    "columns?from=0",
    "columns?from=-1&to=2",
    "columns?from=5&to=4",
    "columns?from=0&to=999999999",
    "steps?from=zero&to=2",
    "steps?from=0&to=99999999999999999999",
    "decisions?from=0&to=1e3",
    "details?chunk=1000000",
    "states?robot=999&chunk=0",
    "scene?from=9999999999",
    "states?robot=0&chunk=x",
]


def test_what_there_is_not_is_told_in_words(page: SnifferServer) -> None:
    with cases() as each:
        for what in MISSING:
            with each(what):
                status, why = page.refusal(what)
                assert status == 400
                assert len(why.splitlines()) == 1


def test_nobody_else_gets_an_answer(page: SnifferServer) -> None:
    known = page.url
    with cases() as each:
        for what in ("", "about", "columns?from=0&to=1", "journal", "scene", "news"):
            with each(what):
                page.url = known
                assert page.refusal(what, Host="example.org")[0] == 404
                for url in (known.replace(TOKEN, "a-path-that-somebody-guesses"), known.replace(f"{TOKEN}/", "")):
                    page.url = url
                    assert page.refusal(what)[0] == 404


def test_no_other_site_gets_an_answer(page: SnifferServer) -> None:
    with cases() as each:
        for what in ("", "about", "journal"):
            with each(what):
                assert page.refusal(what, Origin="http://example.org")[0] == 403
                with page.ask(what, Origin=page.url.partition(f"/{TOKEN}")[0]) as answer:
                    assert "Access-Control-Allow-Origin" not in answer.headers
                    assert answer.headers["Cache-Control"] == "no-store"
                    assert answer.headers["Referrer-Policy"] == "no-referrer"


def test_json_is_compressed_where_the_browser_can(page: SnifferServer) -> None:
    with page.ask("about", **{"Accept-Encoding": "gzip"}) as answer:
        assert answer.headers["Content-Encoding"] == "gzip"


def test_only_this_machine_is_listened_to(page: SnifferServer) -> None:
    with pytest.raises(OSError, match="refused"), socket.create_connection(("127.0.0.2", page.port), HANG_S):
        pass


# Files that grow


def blocks(events: list[AnyEvent], outcome: Outcome | None, sizes: int) -> list[bytes]:
    """The journal in pieces, as it comes into being."""
    whole = journal_of(events, outcome)
    step = len(whole) // sizes + 1
    return [whole[place : place + step] for place in range(0, len(whole), step)]


def in_the_loop(page: SnifferServer, does: Callable[[], Any]) -> Any:  # noqa: ANN401
    """What `does`, a coroutine's maker, comes to in the server's own loop."""
    future: Future[Any] = asyncio.run_coroutine_threadsafe(does(), page.loop)
    return future.result(HANG_S)


def connected(page: SnifferServer) -> WebSocketClientConnection:
    found: WebSocketClientConnection = in_the_loop(page, lambda: _connect(page.url.replace("http", "ws", 1) + "news"))
    return found


async def _connect(url: str, **headers: str) -> WebSocketClientConnection:
    return await websocket_connect(HTTPRequest(url, headers=headers))


async def _news_until(socket: WebSocketClientConnection, enough: Callable[[dict[str, Any]], bool]) -> dict[str, Any]:
    async with asyncio.timeout(HANG_S):
        while True:
            message = await socket.read_message()
            assert message is not None
            news: dict[str, Any] = msgspec.json.decode(message)
            if enough(news):
                return news


def test_a_page_hears_of_a_file_that_grows(tmp_path: Path, run: Run, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(server, "POLL_S", 0.01)
    path = tmp_path / "run.journal"
    pieces = blocks(run.events, run.outcome, 4)
    path.write_bytes(pieces[0])
    with sniffer_server(SnifferSession(path)) as page:
        socket = connected(page)
        wait_until(lambda: page.seen == 1, "the page was not seen")
        with path.open("ab") as writing:
            for piece in pieces[1:]:
                writing.write(piece)
                writing.flush()
                time.sleep(0.02)  # it may be looked at meanwhile, or not
        news = in_the_loop(page, lambda: _news_until(socket, lambda news: news["over"]))
        assert (news["messages"], news["loaded"], news["generation"]) == (len(run.trace.messages.t), 1, 0)
        in_the_loop(page, lambda: _close(socket))


async def _close(socket: WebSocketClientConnection) -> None:
    socket.close()
    await socket.read_message()


def test_another_site_hears_no_news(page: SnifferServer) -> None:
    address = page.url.replace("http", "ws", 1) + "news"
    with pytest.raises(HTTPClientError, match="403"):
        in_the_loop(page, lambda: _connect(address, Origin="http://example.org"))


def test_bundles_out_of_order_are_put_in_order_at_the_end(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    events, outcome = run_events(Runtime.PROCESSES, 3)
    content = journal_of(events, outcome, header("processes"))
    expected = Trace.of(read_journal(content))
    monkeypatch.setattr(live_trace, "PIECE_BYTES", 700)
    monkeypatch.setattr(live_trace, "_EVENTS_AT_ONCE", 50)
    path = tmp_path / "run.journal"
    path.write_bytes(content)
    session = SnifferSession(path)
    over = []
    while session.advance():
        over.append(session.begun and session.news()["over"])
    news = session.news()
    assert (news["generation"], news["over"]) == (1, True)
    assert not any(over[:-1])  # what is over does not change any more
    count = len(expected.messages.t)
    assert session.rows("columns", 0, count) == message_columns(expected, 0, count)
    session.close()


def test_a_file_that_is_replaced_is_another_generation(file: Path, tmp_path: Path, run: Run) -> None:
    with sniffer_server(SnifferSession(file)) as page:
        assert page.json("about")["generation"] == 0
        other = tmp_path / "other"
        other.write_bytes(journal_of(run.events, run.outcome, header(team="another")))
        other.replace(file)
        wait_until(lambda: page.json("about")["team"] == "another", "it was not noticed")
        assert page.json("about")["generation"] > 0


@pytest.mark.parametrize("times", [0.2, 1.5])
def test_a_file_that_is_written_anew_is_another_generation(file: Path, times: float, run: Run) -> None:
    """Also where there is more of it than there was."""
    with sniffer_server(SnifferSession(file)) as page:
        assert page.json("about")["generation"] == 0
        some = run.events[: int(len(run.events) * times)] + run.events[: int(len(run.events) * max(0, times - 1))]
        file.write_bytes(journal_of(some, None, header(team="another")))
        wait_until(lambda: page.json("about")["team"] == "another", "it was not noticed")
        assert page.json("about")["generation"] > 0


def test_a_journal_without_an_end_is_over_when_nobody_writes(file: Path, run: Run) -> None:
    file.write_bytes(journal_of(run.events, None))
    with sniffer_server(SnifferSession(file)) as page:
        assert not page.json("about")["over"]
    os.utime(file, (0, 0))
    with sniffer_server(SnifferSession(file)) as page:
        wait_until(lambda: page.json("about")["over"], "it goes on for ever")


def test_damage_is_told_and_what_is_before_it_shown(file: Path, run: Run) -> None:
    lines = [*lines_of(read_journal(run.whole))]
    file.write_bytes(b"".join(lines[:300]) + b"nonsense\n" + b"".join(lines[300:]))
    with sniffer_server(SnifferSession(file)) as page:
        about = page.json("about")
    assert "301" in about["damage"]
    assert 0 < about["messages"] < len(run.trace.messages.t)


def test_a_file_that_turns_out_to_be_none_is_told(tmp_path: Path) -> None:
    path = tmp_path / "empty"
    path.write_bytes(b"")
    with sniffer_server(SnifferSession(path)) as page:
        path.write_bytes(b"what is this?\n")
        assert page.refusal("about")[0] == 400


@pytest.mark.parametrize("most", [0, live_trace.MOST_PENDING])
def test_events_with_large_numbers_are_sorted_or_refused(
    tmp_path: Path, run: Run, monkeypatch: pytest.MonkeyPatch, most: int
) -> None:
    """In memory any number can be sorted. The temporary file has 64 bits for a number; the page shows the error."""
    monkeypatch.setattr(live_trace, "MOST_PENDING", most)
    beginning, *_ = lines_of(read_journal(run.whole))
    said = [
        b'{"event":"Sent","t":%d,"sender":"a","receiver":"b","type":"X","content":{"x":%d},"bytes":1,"clock":0}\n' % one
        for one in ((2, 1), (1, 10**30))
    ]
    path = tmp_path / "run.jsonl"
    path.write_bytes(b"".join([beginning, *said]))
    os.utime(path, (0, 0))
    with sniffer_server(SnifferSession(path)) as page:
        if most:
            wait_until(lambda: page.json("about")["over"], "the journal is not sorted")
            assert page.json("details?chunk=0")[0]["content"] == {"x": str(10**30)}
        else:
            wait_until(lambda: page.refusal("about")[0] == 400, "no error is shown")


def test_a_page_that_does_not_listen_makes_nothing_wait_or_grow(
    page: SnifferServer, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Its socket is full: whatever comes meanwhile is one news, when it listens again."""
    written: list[bytes] = []
    full = page.loop.create_future()

    def write_message(_: object, message: bytes) -> Any:  # noqa: ANN401 - a future
        written.append(message)
        return full

    monkeypatch.setattr(server, "NEWS_S", 0)
    monkeypatch.setattr(server._NewsSocket, "write_message", write_message)  # noqa: SLF001
    socket = connected(page)
    wait_until(lambda: len(written) == 1, "there are no news")
    for _ in range(100):
        page.loop.call_soon_threadsafe(page.server._notify)  # noqa: SLF001
    assert page.json("about")["over"]
    assert len(written) == 1
    in_the_loop(page, lambda: _close(socket))


def test_the_download_is_the_file_as_it_stood(tmp_path: Path, run: Run) -> None:
    path = tmp_path / 'a "strange" näme.journal'
    path.write_bytes(run.whole)
    with sniffer_server(SnifferSession(path)) as page, page.ask("journal") as answer:
        assert answer.headers["Content-Disposition"] == 'attachment; filename="a__strange__n_me.journal"'
        assert read_journal(answer.read()) == read_journal(io.BytesIO(run.whole).read())
