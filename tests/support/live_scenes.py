"""The live viewer of a scene, in a thread."""

from __future__ import annotations

import asyncio
from asyncio import AbstractEventLoop, Task
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from queue import SimpleQueue
from threading import Thread
from typing import Any

from robochoc.view.live import serve_scene
from robochoc.view.scene import Scene
from tests.support.limits import HANG_S

_Serving = tuple[str, AbstractEventLoop, Task[Any] | None]


@contextmanager
def served_scene(scene: Scene) -> Iterator[str]:
    """The URL at which `scene` is shown; it is taken from there in the end."""
    serving: SimpleQueue[_Serving] = SimpleQueue()

    def serve() -> None:
        with suppress(asyncio.CancelledError):
            serve_scene(scene, ready=lambda url: serving.put((url, asyncio.get_running_loop(), asyncio.current_task())))

    thread = Thread(target=serve)
    thread.start()
    url, loop, task = serving.get(timeout=HANG_S)
    assert task
    try:
        yield url
    finally:
        loop.call_soon_threadsafe(task.cancel)
        thread.join(HANG_S)
