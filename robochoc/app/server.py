"""The application's server, for browsers on this machine only, under a path that cannot be guessed."""

from __future__ import annotations

import asyncio
import os
import signal
import threading
import time
import webbrowser
from collections.abc import Callable
from contextlib import AbstractContextManager, nullcontext
from pathlib import Path
from socket import socket
from types import FrameType

import uvicorn
from fastapi import FastAPI
from nicegui import ui

from robochoc.app.error_log import log_errors_to
from robochoc.app.guard import AccessGuard, BoundedConnection
from robochoc.app.jobs.job import end_all
from robochoc.app.pages import routes
from robochoc.app.projects import Projects
from robochoc.app.store import TeamStore
from robochoc.app.texts import LANGUAGE, say
from robochoc.view.local_address import RedirectFile, loopback_socket, secret_path, url_of

_RECONNECT_S = 30.0
"""The time in seconds for which a disconnected browser can return to its unchanged page; later the page is rebuilt."""
_LONGEST_END_S = 2.5
"""The time in seconds after a signal at which the process is forced to end."""
_LONGEST_SAVE_S = 1.0
_SIGNALLED = 128
"""The exit status of a program ended by a signal is this value plus the signal's number (a convention of shells)."""
_ICON = Path(__file__).with_name("icon.svg")


def serve_app(
    folder: Path, *, port: int = 0, open_browser: bool = False, ready: Callable[[str], None] | None = None
) -> None:
    """Serve the application until it is interrupted.

    Args:
        folder: The folder with the teams.
        port: The port. 0: any free port.
        open_browser: True to open the user's browser.
        ready: Called with the URL when it can be opened.

    Raises:
        OSError: if the port is in use, or the folder is in use by another `robochoc app`.
    """
    store = TeamStore(folder)
    with store.locked(), loopback_socket(port) as here:
        log_errors_to(folder)
        secret = secret_path()
        url = url_of(here, f"{secret}/")
        outside = FastAPI(openapi_url=None)
        projects = Projects(store)
        projects.sweep()
        routes.install(projects)
        ui.run_with(
            outside,
            mount_path=f"/{secret}",
            title=say("app.title"),
            favicon=_ICON,
            dark=None,
            language="en-US" if LANGUAGE == "en" else None,
            reconnect_timeout=_RECONNECT_S,
            show_welcome_message=False,
            tailwind=False,
        )
        config = uvicorn.Config(
            AccessGuard(outside, secret, here.getsockname()[1]),
            http=BoundedConnection,
            log_config=None,
            log_level="error",
            access_log=False,
            ws_max_size=1 << 24,
            timeout_graceful_shutdown=1,
        )
        asyncio.run(_serve(_AppServer(config, projects), here, url, ready, open_browser=open_browser))


class _AppServer(uvicorn.Server):
    """A server that calls `ready` when it accepts requests, and ends within a time limit after a signal."""

    ready: Callable[[], None]
    redirect: RedirectFile | None = None

    def __init__(self, config: uvicorn.Config, projects: Projects) -> None:
        super().__init__(config)
        self._projects = projects

    async def startup(self, sockets: list[socket] | None = None) -> None:
        """Start the server, and call `ready`."""
        await super().startup(sockets)
        self.ready()

    def handle_exit(self, sig: int, frame: FrameType | None) -> None:
        """Start the shutdown."""
        super().handle_exit(sig, frame)
        status = 0 if sig == signal.SIGINT else _SIGNALLED + sig
        threading.Thread(target=self._end_in_time, args=(status,), daemon=True).start()

    def _end_in_time(self, status: int) -> None:
        """End this process after the time limit, even if a computation cannot be interrupted."""
        time.sleep(_LONGEST_END_S)
        end_all(0)
        saving = threading.Thread(target=self._projects.save, daemon=True)
        saving.start()
        saving.join(_LONGEST_SAVE_S)  # a disk may not respond
        if self.redirect:
            self.redirect.close()
        os._exit(status)


async def _serve(
    server: _AppServer, here: socket, url: str, ready: Callable[[str], None] | None, *, open_browser: bool
) -> None:
    shown: AbstractContextManager[RedirectFile | None] = RedirectFile(url) if open_browser else nullcontext()
    with shown as redirect:

        def on_started() -> None:
            if ready:
                ready(url)
            if redirect is not None:  # in a thread: a text-mode browser returns only when it is closed
                threading.Thread(target=webbrowser.open, args=(redirect.url,), daemon=True).start()

        server.ready, server.redirect = on_started, redirect
        await server.serve(sockets=[here])
