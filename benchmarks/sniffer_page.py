"""What a page of the sniffer asks for, without a browser: `URL follow`, `URL stop`, `URL time`; and `FILE write N`.

follow: keep up with all that there is, as the page does; stop: connect, and never listen again; time: print after how
many seconds there is what; write: make a journal of N messages.
"""

from __future__ import annotations

import argparse
import asyncio
import os
import signal
import time
from pathlib import Path
from typing import Any

import msgspec
from tornado.httpclient import AsyncHTTPClient
from tornado.websocket import websocket_connect

from robochoc.journal.events import AnyEvent, Began, Received, Sent, Settled
from robochoc.journal.journal import Header, JournalFile, JournalRecorder

STOPPED = "stopped.pid"
"""In the folder for temporary files: who has stopped, and is to be put out."""
_SPAN = 1 << 16
_ROBOTS = 49
_FANOUT = 4
_LATE_EVERY, _LATE_BY = 100, 10
"""Every 100th step is reported ten steps late."""


async def follow(url: str, *, until_over: bool = False, stops: bool = False) -> None:
    """Ask for whatever is new. With `stops`, this process is stopped once it is connected."""
    client = AsyncHTTPClient()
    began = time.perf_counter()
    about: dict[str, Any] = msgspec.json.decode((await client.fetch(f"{url}about")).body)
    socket = await websocket_connect(f"{url.replace('http', 'ws', 1)}news")
    if stops:
        _stop()
    had = {"columns": 0, "steps": 0}
    first = True
    news: dict[str, Any] = about
    while True:
        if news["generation"] != about["generation"]:
            had, about = dict.fromkeys(had, 0), {**about, "generation": news["generation"]}
        for what, number in (("columns", news["messages"]), ("steps", news["steps"])):
            while had[what] < number:
                to = min(number, had[what] + _SPAN)
                await client.fetch(f"{url}{what}?from={had[what]}&to={to}", request_timeout=60)
                had[what] = to
                if first and what == "steps":
                    first = False
                    await client.fetch(f"{url}details?chunk=0", request_timeout=60)
                    print(f"the first picture can be drawn {time.perf_counter() - began:.2f}", flush=True)
        if until_over and news["over"]:
            print(f"all messages are there, in order {time.perf_counter() - began:.2f}")
            return
        message = await socket.read_message()
        if message is None:
            return
        news = msgspec.json.decode(message)


def _stop() -> None:
    Path(os.environ["TMPDIR"], STOPPED).write_text(str(os.getpid()))
    os.kill(os.getpid(), signal.SIGSTOP)


def write(path: Path, messages: int) -> None:
    """A journal of `messages` messages of 49 robots, whose bundles come out of order."""
    file = JournalFile(path)
    recorder = JournalRecorder(Header(team="long", protocol="abt", runtime="processes", seed=0), None, [file.write])
    recorder(Began(t=0, protocol="ABT"))
    names = [f"Robot{row}.{column}" for row in range(1, 8) for column in range(1, 8)]
    waiting: list[list[str]] = [[] for _ in names]
    late: list[AnyEvent] = []
    for step in range(-(-messages // _FANOUT)):
        robot = step * 31 % _ROBOTS
        name = names[robot]
        t = step * 1e-5
        events: list[AnyEvent] = [
            Received(t=t, sender=sender, receiver=name, type="Ok", clock=step) for sender in waiting[robot]
        ]
        waiting[robot].clear()
        for place in range(_FANOUT):
            to = (robot + 1 + place * 7 + step % 5) % _ROBOTS
            content = {"value": [step % 7 + 1]}
            events.append(Sent(t=t, sender=name, receiver=names[to], type="Ok", content=content, bytes=8, clock=step))
            waiting[to].append(name)
        events.append(Settled(t=t, robot=name, clock=step, checks=step))
        if step % _LATE_EVERY == 0:
            late = events
            continue
        if step % _LATE_EVERY == _LATE_BY:
            events, late = [*late, *events], []
        for event in events:
            recorder(event)
    for event in late:
        recorder(event)
    recorder.close()
    file.close()


def main() -> None:
    """Do what is asked for."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("place", metavar="URL|FILE")
    parser.add_argument("what", choices=["follow", "stop", "time", "write"])
    parser.add_argument("messages", nargs="?", type=int, default=0, metavar="N", help="with write")
    asked = parser.parse_args()
    if asked.what == "write":
        write(Path(asked.place), asked.messages)
    else:
        asyncio.run(follow(asked.place, until_over=asked.what == "time", stops=asked.what == "stop"))


if __name__ == "__main__":
    main()
