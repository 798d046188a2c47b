"""A viewer: a separate process that serves the page for a run, so that viewing does not slow down the robots.

The viewer is started before the robots, with the journal's file and a listening socket, so that its URL is known at
once. The robots and the viewer share only the file, which the viewer reads once a page has connected. The viewer ends
when its parent closes the pipe or ends.
"""

from __future__ import annotations

import json
import os
import select
import subprocess
import sys
from collections.abc import Sequence
from contextlib import suppress
from typing import Self

from robochoc.system.signals import signals_delayed
from robochoc.view.local_address import RedirectFile, loopback_socket, secret_path, url_of

_PATIENCE_S = 2.0
"""The time limit for ending the process, in seconds."""
_MOST_CHOSEN = 1000
_PROGRAM = "robochoc.sniffer.viewer_process"


class Viewer:
    """The viewer for the journal in the file `journal` (a descriptor that is open for reading).

    `chosen`: names or patterns of the robots that are shown at first. Port 0 selects any free port. With
    `open_browser`, the page is opened in the user's browser.

    Raises:
        OSError: if the port is in use, or the process cannot be started.
    """

    def __init__(self, journal: int, chosen: Sequence[str] = (), port: int = 0, *, open_browser: bool = False) -> None:
        heard, theirs_out = os.pipe()
        theirs_in, lifeline = os.pipe()
        with loopback_socket(port) as here:
            token = secret_path()
            self.url = url_of(here, f"{token}/")
            self._redirect: RedirectFile | None = None
            try:
                self._redirect = RedirectFile(self.url) if open_browser else None
                self._process = _started(here.fileno(), journal, theirs_in, theirs_out)
            except BaseException:
                os.close(heard)
                os.close(lifeline)
                if self._redirect:
                    self._redirect.close()
                raise
            finally:
                os.close(theirs_in)
                os.close(theirs_out)
        self._heard, self._lifeline = heard, lifeline
        # On the pipe instead of as arguments, which all users of this machine can see.
        shown = self._redirect.url if self._redirect else None
        settings = json.dumps({"token": token, "chosen": [*chosen][:_MOST_CHOSEN], "shown": shown}).encode()
        with suppress(BrokenPipeError):  # the process has already ended; this is reported later
            os.write(lifeline, settings + b"\n")

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def wait_until_seen(self, most_s: float) -> bool:
        """Wait until a page has connected. Return False if none has connected after `most_s` seconds."""
        ready, _, _ = select.select([self._heard], [], [], most_s)
        seen = bool(ready and os.read(self._heard, 1))
        if seen and self._redirect:
            self._redirect.close()
        return seen

    def finish(self) -> None:
        """Report that the journal is complete."""
        with suppress(BrokenPipeError):
            os.write(self._lifeline, b".")

    @property
    def is_gone(self) -> bool:
        """True if the viewer's process has ended."""
        return self._process.poll() is not None

    def wait(self) -> None:
        """Wait until the process has ended."""
        self._process.wait()

    def close(self) -> None:
        """End the process."""
        os.close(self._lifeline)
        try:
            self._process.wait(_PATIENCE_S)
        except BaseException as reason:
            self._process.kill()
            self._process.wait()
            if not isinstance(reason, subprocess.TimeoutExpired):
                raise
        finally:
            os.close(self._heard)
            if self._redirect:
                self._redirect.close()


def _started(listening: int, journal: int, theirs_in: int, theirs_out: int) -> subprocess.Popen[bytes]:
    """Start the viewer's process with these descriptors."""
    with signals_delayed():  # until the process handles signals, since Ctrl-C is also sent to it
        return subprocess.Popen(  # noqa: S603 - our own module
            [sys.executable, "-P", "-m", _PROGRAM, str(listening), str(journal)],
            stdin=theirs_in,
            stdout=theirs_out,
            pass_fds=(listening, journal),
        )
