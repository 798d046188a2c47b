"""What a robot waits for: descriptors, each with what is to be done when something comes.

Less than `selectors`, as a robot waits as often as messages come, and pages of what it runs are copied for it.
"""

from __future__ import annotations

import select
import sys
from collections.abc import Callable

from robochoc.model.message import Envelope

Action = Callable[[list[Envelope]], None]
"""What is to be done. Messages that it reads are added to the packet."""


class Watch:
    """The descriptors that are watched, and what is to be done for each."""

    def __init__(self) -> None:
        self._actions: dict[int, Action] = {}
        if sys.platform == "linux":
            self._poll = select.epoll()
        else:
            self._poll = select.poll()

    def __contains__(self, fd: int | None) -> bool:
        """Return whether `fd` is watched."""
        return fd in self._actions

    def add(self, fd: int, action: Action, *, write: bool = False) -> None:
        """Watch `fd` until it can be read, or with `write`, written to. It is not watched yet."""
        self._poll.register(fd, select.POLLOUT if write else select.POLLIN)
        self._actions[fd] = action

    def watch_writing(self, fd: int, wanted: bool) -> None:  # noqa: FBT001 - it is the only thing said
        """Watch `fd`, which is watched for reading, for writing too, or no longer."""
        self._poll.modify(fd, select.POLLIN | (select.POLLOUT if wanted else 0))

    def remove(self, fd: int) -> None:
        """Watch `fd` no longer. It is still open."""
        self._poll.unregister(fd)
        del self._actions[fd]

    def wait(self, patience_s: float | None) -> list[Action]:
        """Return what is to be done, once there is something; nothing after `patience_s` seconds (None: never).

        An end that is closed counts as readable, and as writable.
        """
        if sys.platform == "linux":
            ready = self._poll.poll(patience_s, len(self._actions) or 1)
        else:
            ready = self._poll.poll(None if patience_s is None else patience_s * 1000)
        actions = self._actions
        return [actions[fd] for fd, _ in ready]
