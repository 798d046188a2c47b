"""A sniffer's server in a thread, which tests ask as a browser would."""

from __future__ import annotations

import asyncio
import threading
from collections.abc import Iterator
from contextlib import closing, contextmanager, suppress
from typing import Any, Self
from urllib.error import HTTPError
from urllib.request import Request, urlopen

import msgspec

from robochoc.generators.queens3d import queens3d
from robochoc.journal.events import AnyEvent
from robochoc.journal.journal import Header, JournalRecorder
from robochoc.model.outcome import Outcome
from robochoc.run import solve
from robochoc.run.options import Options, Runtime, Withdrawal
from robochoc.sniffer.server import Server
from robochoc.sniffer.session import SnifferSession
from robochoc.view.local_address import loopback_socket, url_of
from tests.support.limits import HANG_S

TOKEN = "a-path-that-nobody-guesses"  # noqa: S105 - it is for tests


def run_events(runtime: Runtime = Runtime.SIMULATOR, n: int = 4) -> tuple[list[AnyEvent], Outcome]:
    """Return the events of a run, in their order, and its outcome."""
    events: list[AnyEvent] = []
    options = Options(runtime=runtime, protocol="abt", withdraw=Withdrawal.MAXIMAL)
    return events, solve(queens3d(n), options, observer=events.append)


def header(runtime: str = "simulator", team: str = "queens3d-4") -> Header:
    return Header(team=team, protocol="abt", runtime=runtime, seed=0)


def journal_of(events: list[AnyEvent], outcome: Outcome | None, of: Header | None = None) -> bytes:
    recorder = JournalRecorder(of or header())
    for event in events:
        recorder(event)
    recorder.outcome = outcome
    return recorder.content()


class SnifferServer:
    """A server that runs in a thread of its own. `get` asks it for an answer."""

    def __init__(self, session: SnifferSession) -> None:
        self._ready = threading.Event()
        self._session = session
        self.loop = asyncio.new_event_loop()
        self.url = ""
        self.port = 0
        self.seen = 0
        self._thread = threading.Thread(target=self._run)

    def __enter__(self) -> Self:
        self._thread.start()
        assert self._ready.wait(HANG_S)
        return self

    def __exit__(self, *_: object) -> None:
        self.loop.call_soon_threadsafe(self._serving.cancel)
        self._thread.join(HANG_S)

    def _run(self) -> None:
        with suppress(asyncio.CancelledError), asyncio.Runner(loop_factory=lambda: self.loop) as runner:
            runner.run(self._serve())

    async def _serve(self) -> None:
        with loopback_socket() as here:
            self.port = here.getsockname()[1]
            self.url = url_of(here, f"{TOKEN}/")
            self.server = Server(self._session, here, TOKEN, self._count)
            self._serving = asyncio.create_task(self.server.serve())
            self.loop.call_soon(self._ready.set)
            await self._serving

    def _count(self) -> None:
        self.seen += 1

    def ask(self, what: str, **headers: str) -> Any:  # noqa: ANN401 - urllib's answer
        """The answer itself; of another status than 200: raises `HTTPError`."""
        return urlopen(Request(self.url + what, headers=headers), timeout=HANG_S)  # noqa: S310 - our own server

    def refusal(self, what: str, **headers: str) -> tuple[int, str]:
        """The status other than 200 that answers `what`, and why."""
        try:
            self.ask(what, **headers).close()
        except HTTPError as refused:
            with refused:
                return refused.code, refused.read().decode()
        return 200, ""

    def get(self, what: str) -> bytes:
        with self.ask(what) as answer:
            content: bytes = answer.read()
            return content

    def json(self, what: str) -> Any:  # noqa: ANN401 - JSON is anything
        return msgspec.json.decode(self.get(what))


@contextmanager
def sniffer_server(session: SnifferSession) -> Iterator[SnifferServer]:
    with closing(session), SnifferServer(session) as server:
        yield server
