"""The sniffer's server: sends the page and its data to browsers on this machine only.

The path of the page cannot be guessed, since other users may also have access to this machine. Updates to a browser are
small, and only the newest are sent, so that a slow or stopped browser blocks nothing and needs no buffer. One thread
works on the trace in small steps; another thread computes robots' states.
"""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from socket import socket
from typing import TypeVar

import msgspec
from tornado.web import Application
from tornado.websocket import WebSocketClosedError

from robochoc.sniffer.page import sniffer_page
from robochoc.sniffer.page_data import BadRequestError
from robochoc.sniffer.session import NotBegunError, SnifferSession
from robochoc.view.local_address import loopback_socket, secret_path, url_of
from robochoc.view.loopback import SecretHandler, SecretPage, SecretSocket, application, in_browser, served

POLL_S = 0.1
"""The interval between reads of a file without new content, in seconds."""
NEWS_S = 0.2
"""The minimum interval between two updates to the same page, in seconds."""
_PIECE = 1 << 16
"""The number of bytes of a journal that are sent at once."""
_MOST_DIGITS = 10
_HEAD_PATIENCE_S = 20.0
"""The maximum time for which a request waits for the first block of the journal, in seconds."""

R = TypeVar("R")


def serve_sniffer(
    session: SnifferSession, *, port: int = 0, open_browser: bool = False, ready: Callable[[str], None] | None = None
) -> None:
    """Serve `session` to browsers on this machine until interrupted (Ctrl-C), then return.

    Port 0 selects any free port. `ready` is called with the URL as soon as it can be opened.

    Raises:
        OSError: if the port is in use.
    """
    with suppress(KeyboardInterrupt):
        asyncio.run(_serve(session, port, ready, open_browser=open_browser))


async def _serve(
    session: SnifferSession, port: int, ready: Callable[[str], None] | None, *, open_browser: bool
) -> None:
    with loopback_socket(port) as here:
        token = secret_path()
        url = url_of(here, f"{token}/")
        serving = asyncio.create_task(Server(session, here, token).serve())
        if ready:
            ready(url)
        async with in_browser(url, enabled=open_browser):
            await serving


class Server:
    """Serves the journal of `session` on the socket `listener`, below `/token/`.

    `seen` is called when the first page has connected. The journal is only read after the first request.
    """

    def __init__(
        self, session: SnifferSession, listener: socket, token: str, seen: Callable[[], None] = lambda: None
    ) -> None:
        self.session = session
        self.token = token
        self._listener = listener
        self._seen = seen
        self._reader = ThreadPoolExecutor(1, "reader")
        self._states_thread = ThreadPoolExecutor(1, "states")
        self._wanted = asyncio.Event()
        self._changed = asyncio.Event()
        self.version = 0
        """A version that changes whenever there is something new."""
        self.trouble: str | None = None

    async def serve(self) -> None:
        """Serve until cancelled."""
        following = asyncio.create_task(self._follow())
        try:
            async with served(self._application(), self._listener):
                await asyncio.Event().wait()
        finally:
            following.cancel()
            self.session.stop()
            self._reader.shutdown(wait=False, cancel_futures=True)
            self._states_thread.shutdown(wait=False, cancel_futures=True)

    # Requests of handlers

    async def read(self, answer: Callable[[], R]) -> R:
        """Run `answer` in the thread that works on the trace, as soon as there is a trace, and return the result."""
        self.connected()
        loop = asyncio.get_running_loop()
        while self.trouble is None:
            version = self.version
            if self.session.begun:
                with suppress(NotBegunError):
                    return await loop.run_in_executor(self._reader, answer)
            async with asyncio.timeout(_HEAD_PATIENCE_S):
                await self.change(version)
        raise BadRequestError(self.trouble)

    async def compute(self, answer: Callable[[], R]) -> R:
        """Run `answer` in the thread for slow requests, and return the result."""
        return await asyncio.get_running_loop().run_in_executor(self._states_thread, answer)

    async def change(self, since: int) -> None:
        """Wait until there is a version newer than `since`."""
        while self.version == since:
            await self._changed.wait()

    def connected(self) -> None:
        """Record that a page has connected."""
        if not self._wanted.is_set():
            self._wanted.set()
            self._seen()

    # The journal

    async def _follow(self) -> None:
        await self._wanted.wait()
        loop = asyncio.get_running_loop()
        begun = False
        while True:
            try:
                more = await loop.run_in_executor(self._reader, self.session.advance)
            except Exception as error:  # noqa: BLE001 - the file is untrusted; the error is shown on waiting pages
                self.trouble = str(error) or type(error).__name__
                self._notify()
                return
            if more or self.session.begun != begun:
                begun = self.session.begun
                self._notify()
            if not more:
                await asyncio.sleep(POLL_S)

    def _notify(self) -> None:
        self.version += 1
        changed, self._changed = self._changed, asyncio.Event()
        changed.set()

    def _application(self) -> Application:
        known = {"server": self}
        whole = {"secret": self.token, "page": sniffer_page("served")}
        return application(
            [
                (r"/([^/]*)/", SecretPage, whole),
                (r"/([^/]*)/news", _NewsSocket, known),
                (r"/([^/]*)/journal", _JournalHandler, known),
                (r"/([^/]*)/(about|columns|steps|decisions|details|search|states|scene)", _AnswerHandler, known),
            ],
            compress=True,
        )


class _TokenHandler(SecretHandler):
    """Accepts requests with the correct token, and refuses requests from pages of other sites."""

    def initialize(self, server: Server) -> None:
        self.server = server
        self.secret = server.token


class _AnswerHandler(_TokenHandler):
    """Sends one answer to the page."""

    async def get(self, _token: str, what: str) -> None:
        try:
            content = await self._content(what)
        except BadRequestError as wrong:
            self._refuse(400, str(wrong))
        except TimeoutError:
            self._refuse(503, "the run has not started yet")
        else:
            binary = what in {"columns", "steps"}
            self.set_header("Content-Type", "application/octet-stream" if binary else "application/json")
            self.write(content)

    async def _content(self, what: str) -> bytes:
        server, session = self.server, self.server.session
        match what:
            case "about":
                return await server.read(session.about)
            case "scene":
                first = self._number("from", 0)
                return await server.read(lambda: session.scene(first))
            case "details":
                chunk = self._number("chunk")
                return await server.read(lambda: session.details(chunk))
            case "search":
                text, first, end = self.get_query_argument("text", ""), self._number("from"), self._number("to")
                return await server.read(lambda: session.search(text, first, end))
            case "states":
                robot, chunk = self._number("robot"), self._number("chunk")
                name = await server.read(lambda: session.robot(robot))
                return await server.compute(lambda: session.states(name, chunk))
            case _:
                first, end = self._number("from"), self._number("to")
                return await server.read(lambda: session.rows(what, first, end))

    def _number(self, name: str, default: int | None = None) -> int:
        text = self.get_query_argument(name, None)
        if text is None and default is not None:
            return default
        if text is None or not text.isdecimal() or len(text) > _MOST_DIGITS:
            raise BadRequestError(f"{name} must be a number")
        return int(text)

    def _refuse(self, status: int, why: str) -> None:
        self.set_status(status)
        self.set_header("Content-Type", "text/plain; charset=utf-8")
        self.write(why)


class _JournalHandler(_TokenHandler):
    """Sends the journal's file in its current state."""

    def head(self, _token: str) -> None:
        self._describe()

    async def get(self, _token: str) -> None:
        size = self._describe()
        place = 0
        while place < size:
            piece = self.server.session.bytes_at(place, min(_PIECE, size - place))
            if not piece:
                break
            self.write(piece)
            await self.flush()
            place += len(piece)

    def _describe(self) -> int:
        size = self.server.session.size
        self.set_header("Content-Type", "application/octet-stream")
        self.set_header("Content-Disposition", f'attachment; filename="{self.server.session.file_name}"')
        self.set_header("Content-Length", str(size))
        return size


class _NewsSocket(SecretSocket):
    """Sends the progress to a page. Changes during sending are included in the next message."""

    def initialize(self, server: Server) -> None:
        self.server = server
        self.secret = server.token

    def open(self, *_: str) -> None:
        self.server.connected()
        self._sending = asyncio.create_task(self._send())

    async def _send(self) -> None:
        encode = msgspec.json.encode
        last = ""
        try:
            while True:
                version = self.server.version
                news = encode(await self.server.read(self.server.session.news)).decode()
                if news != last:
                    last = news
                    await self.write_message(news)  # returns after sending, so that the next update is the newest
                await asyncio.sleep(NEWS_S)
                await self.server.change(version)
        except (WebSocketClosedError, BadRequestError, TimeoutError):
            self.close()

    def on_close(self) -> None:
        self._sending.cancel()
