"""Requests that do not come, or do not come on, hold no connection for long; nor do too many connections."""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable, Callable, MutableMapping
from socket import socket
from typing import Any

import pytest
import uvicorn
from tornado.web import RequestHandler

from robochoc.app import guard
from robochoc.app.guard import BoundedConnection
from robochoc.view import loopback
from robochoc.view.local_address import loopback_socket
from tests.support.limits import HANG_S

HEAD = b"GET /x HTTP/1.1\r\nHost: localhost\r\n"
UNFINISHED = (b"", b"GET", HEAD, HEAD + b"\r\n" + HEAD, b"POST" + HEAD[3:] + b"Content-Length: 9\r\n\r\nx")
"""Nothing, half a request, half a second request, and half a body."""


async def answer_to(port: int, content: bytes) -> bytes:
    """Return what a server sends, until it closes the connection, to somebody who sends `content` and stays."""
    reader, writer = await asyncio.open_connection("127.0.0.1", port)
    writer.write(content)
    try:
        return await asyncio.wait_for(reader.read(), HANG_S)
    except ConnectionResetError:
        return b""
    finally:
        writer.close()


async def served_by_uvicorn(here: socket, look: Callable[[int], Awaitable[None]]) -> None:
    """Call `look` with the port of a server that answers "hello" to each request without reading it."""

    async def app(scope: MutableMapping[str, Any], receive: object, send: Any) -> None:  # noqa: ANN401 - ASGI
        del receive
        if scope["type"] == "http":
            await send({"type": "http.response.start", "status": 200, "headers": [(b"content-length", b"5")]})
            await send({"type": "http.response.body", "body": b"hello"})

    server = uvicorn.Server(uvicorn.Config(app, http=BoundedConnection, log_config=None, lifespan="off"))
    serving = asyncio.create_task(server.serve(sockets=[here]))
    while not server.started:  # noqa: ASYNC110 - uvicorn has no event for it
        await asyncio.sleep(0.001)
    try:
        await look(here.getsockname()[1])
    finally:
        server.should_exit = True
        await serving


async def served_by_tornado(here: socket, look: Callable[[int], Awaitable[None]]) -> None:
    """Do the same with the server of the sniffer and of scenes."""

    class Hello(RequestHandler):
        def get(self) -> None:
            self.write("hello")

        post = get

    async with loopback.served(loopback.application([("/x", Hello)]), here):
        await look(here.getsockname()[1])


@pytest.mark.parametrize("serve", [served_by_uvicorn, served_by_tornado])
def test_unfinished_requests_end_and_finished_ones_are_answered(
    serve: Callable[..., Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(guard, "HEAD_S", 1.0)
    monkeypatch.setattr(loopback, "REQUEST_S", 1.0)

    async def look(port: int) -> None:
        answers = await asyncio.gather(*(answer_to(port, content) for content in UNFINISHED))
        assert [answer.count(b"hello") for answer in answers[:4]] == [0, 0, 0, 1]
        assert b"hello" not in await answer_to(port, HEAD + b"X: " + b"x" * (1 << 17))
        assert (await answer_to(port, HEAD + b"\r\n" + HEAD + b"Connection: close\r\n\r\n")).count(b"hello") == 2

    with loopback_socket(0) as here:
        asyncio.run(serve(here, look))


@pytest.mark.parametrize("serve", [served_by_uvicorn, served_by_tornado])
def test_too_many_connections_are_closed_at_once(serve: Callable[..., Any], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(guard, "MAX_CONNECTIONS", 2)
    monkeypatch.setattr(loopback, "MAX_CONNECTIONS", 2)

    async def look(port: int) -> None:
        waiting = [await asyncio.open_connection("127.0.0.1", port) for _ in range(2)]
        assert await answer_to(port, HEAD + b"\r\n") == b""
        for _, writer in waiting:
            writer.close()

    with loopback_socket(0) as here:
        asyncio.run(serve(here, look))
