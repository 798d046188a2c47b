"""The main program of a viewer's process: `python -m robochoc.sniffer.viewer_process SOCKET JOURNAL` (descriptors).

The first line of standard input says what else there is to know, a byte after it that nothing more will be written,
and its end is the end of the parent. A byte on standard output says that a page has connected. Until the first browser
asks, it costs no more than Python does.
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

from robochoc.system.orphans import signal_when_orphaned
from robochoc.system.signals import leave_ctrl_c_to_the_parent


class _Parent(NamedTuple):
    """The descriptors of the pipes from and to the parent."""

    input: int
    output: int

    def line(self) -> bytes:
        """Return the first line, and no further byte; empty if the parent has ended."""
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
        # In a thread: a browser for the terminal returns when it is closed.
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
    from robochoc.sniffer.server import Server  # noqa: PLC0415 - when somebody looks
    from robochoc.sniffer.session import SnifferSession  # noqa: PLC0415

    session = SnifferSession(journal, live=True, chosen=settings["chosen"])
    if over:
        session.finish()
    serving = asyncio.create_task(Server(session, listening, str(settings["token"]), parent.notify).serve())

    def hear() -> None:
        if os.read(parent.input, 1):
            session.finish()
        else:
            serving.cancel()

    asyncio.get_running_loop().add_reader(parent.input, hear)
    with suppress(asyncio.CancelledError):
        await serving
    os._exit(0)  # what a thread still works out, nobody asks for any more


def _parent() -> _Parent:
    """Return the pipes from and to the parent, moved so that a started browser does not inherit them."""
    parent = _Parent(os.dup(0), os.dup(1))
    with open(os.devnull, "rb") as nothing:  # noqa: PTH123 - the name is no path of ours
        os.dup2(nothing.fileno(), 0)
    os.dup2(2, 1)
    return parent


if __name__ == "__main__":
    main()
