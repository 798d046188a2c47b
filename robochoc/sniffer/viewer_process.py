"""The main program of a viewer's process: `python -m robochoc.sniffer.viewer_process SOCKET JOURNAL` (descriptors).

The first line on standard input contains the settings. A further byte means that the journal is complete, and the end
of the input that the parent has ended. A byte on standard output means that a page has connected. Before the first
request, the process imports nothing else, so it needs little memory.
"""

from __future__ import annotations

import asyncio
import json
import os
import select
import signal
import socket
import sys
import threading
import webbrowser
from contextlib import suppress
from functools import partial
from typing import NamedTuple

from robochoc.system.signals import leave_ctrl_c_to_the_parent, signal_when_orphaned


class _Parent(NamedTuple):
    """The descriptors of the pipes from and to the parent."""

    input: int
    output: int

    def line(self) -> bytes:
        """Read the first line but no further byte. Return the line, or an empty value if the parent has ended."""
        line = b""
        while not line.endswith(b"\n"):
            sign = os.read(self.input, 1)
            if not sign:
                return b""
            line += sign
        return line

    def notify(self) -> None:
        """Report that a page has connected."""
        with suppress(OSError):
            os.write(self.output, b".")


def main() -> None:
    """Serve until the parent ends."""
    signal_when_orphaned(signal.SIGKILL)
    leave_ctrl_c_to_the_parent()
    parent = _parent()
    line = parent.line()
    if not line:
        return
    settings = json.loads(line)
    if settings["shown"]:
        # In a thread, since a text-mode browser returns only when it is closed.
        threading.Thread(target=partial(webbrowser.open, settings["shown"]), daemon=True).start()
    over = False
    listening = socket.socket(fileno=int(sys.argv[1]))
    while listening.fileno() not in select.select([listening.fileno(), parent.input], [], [])[0]:
        if not os.read(parent.input, 1):
            return
        over = True
    asyncio.run(_serve(listening, int(sys.argv[2]), settings, parent, over=over))


async def _serve(
    listening: socket.socket, journal: int, settings: dict[str, list[str]], parent: _Parent, *, over: bool
) -> None:
    from robochoc.sniffer.server import Server  # noqa: PLC0415 - only after the first request
    from robochoc.sniffer.session import SnifferSession  # noqa: PLC0415

    session = SnifferSession(journal, live=True, chosen=settings["chosen"])
    if over:
        session.finish()
    serving = asyncio.create_task(Server(session, listening, str(settings["token"]), parent.notify).serve())

    def read_parent() -> None:
        if os.read(parent.input, 1):
            session.finish()
        else:
            serving.cancel()

    asyncio.get_running_loop().add_reader(parent.input, read_parent)
    with suppress(asyncio.CancelledError):
        await serving
    os._exit(0)  # do not wait for computations in threads


def _parent() -> _Parent:
    """Return the pipes to and from the parent, moved so that a browser started here does not inherit them."""
    parent = _Parent(os.dup(0), os.dup(1))
    with open(os.devnull, "rb") as nothing:  # noqa: PTH123 - not a path of this project
        os.dup2(nothing.fileno(), 0)
    os.dup2(2, 1)
    return parent


if __name__ == "__main__":
    main()
