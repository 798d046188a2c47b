"""The application's server: for browsers of this machine alone, under a path that cannot be guessed."""

from __future__ import annotations

import asyncio
import threading
import webbrowser
from collections.abc import Callable
from contextlib import AbstractContextManager, nullcontext
from pathlib import Path
from socket import socket

import uvicorn
from fastapi import FastAPI
from nicegui import ui

from robochoc.app.faults import keep_faults
from robochoc.app.guard import Guard
from robochoc.app.pages import routes
from robochoc.app.projects import Projects
from robochoc.app.store import Store
from robochoc.app.texts import LANGUAGE, say
from robochoc.view.address import loopback_socket, secret_path, url_of
from robochoc.view.redirect import RedirectFile

_RECONNECT_S = 30.0
"""A browser that was away for so long finds its page as it was. After it, the page is made again: nothing is lost."""
_ICON = Path(__file__).with_name("icon.svg")


def serve_app(
    folder: Path, *, port: int = 0, open_browser: bool = False, ready: Callable[[str], None] | None = None
) -> None:
    """Serve the application until it is interrupted.

    Args:
        folder: Where teams are kept.
        port: The port; 0: any that is free.
        open_browser: Whether the user's browser is to show it.
        ready: Is called with the URL once it can be opened.

    Raises:
        OSError: if the port is taken, or the folder, by another `robochoc app`.
    """
    store = Store(folder)
    with store.held(), loopback_socket(port) as here:
        keep_faults(folder)
        secret = secret_path()
        url = url_of(here, f"{secret}/")
        outside = FastAPI(openapi_url=None)
        routes.install(Projects(store))
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
            Guard(outside, secret, here.getsockname()[1]),
            log_config=None,
            log_level="error",
            access_log=False,
            ws_max_size=1 << 24,
            timeout_graceful_shutdown=1,
        )
        asyncio.run(_serve(config, here, url, ready, open_browser=open_browser))


class _Server(uvicorn.Server):
    """Calls `ready` once browsers can ask."""

    def __init__(self, config: uvicorn.Config, ready: Callable[[], None]) -> None:
        super().__init__(config)
        self._ready = ready

    async def startup(self, sockets: list[socket] | None = None) -> None:
        """Start, and say so."""
        await super().startup(sockets)
        self._ready()


async def _serve(
    config: uvicorn.Config, here: socket, url: str, ready: Callable[[str], None] | None, *, open_browser: bool
) -> None:
    shown: AbstractContextManager[RedirectFile | None] = RedirectFile(url) if open_browser else nullcontext()
    with shown as redirect:

        def begin() -> None:
            if ready:
                ready(url)
            if redirect is not None:  # in a thread: a browser for the terminal returns when it is closed
                threading.Thread(target=webbrowser.open, args=(redirect.url,), daemon=True).start()

        await _Server(config, begin).serve(sockets=[here])
