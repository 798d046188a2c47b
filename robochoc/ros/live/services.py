"""Services of ROS, whatever carries them: requests wait for their turn, or are answered at once.

Requests come from outside: each that can be told from others is answered, also one that cannot be read.
"""

from __future__ import annotations

import queue
from abc import ABC, abstractmethod
from collections.abc import Callable, Collection, Mapping
from typing import Any, NamedTuple, Self

from robochoc.robots.sink import Fields
from robochoc.ros.message_types import types_of

WAITING_MAX = 16
"""Requests that wait for their turn. Others are refused at once."""
ENDED = "the service has ended"

Refuse = Callable[[str], Fields]
"""Makes the fields of an answer that refuses, for a reason in words."""
AtOnce = Mapping[str, Callable[[Fields], Fields]]
"""By their names, services that are answered where the request comes in, also while another waits."""


class Request(NamedTuple):
    """A request to the service `name`: its fields, and that by which its client knows the answer."""

    name: str
    fields: Fields
    client: Any


class Services(ABC):
    """Services that are offered, by their names. It is a context manager. Raises `SinkError`, as its methods do.

    Args:
        kinds: The type of each service, such as `std_srvs/Trigger`.
        refuse: Makes the fields of an answer that refuses.
        at_once: Those of the services that do not wait for their turn.
    """

    where: str = ""
    """The place where they are offered, in words."""
    lacking: Collection[str] = ()
    """The names of services that are not offered, as their types are not known here."""

    def __init__(self, kinds: Mapping[str, str], refuse: Refuse, at_once: AtOnce | None = None) -> None:
        self._kinds = {**kinds}
        self._refuse = refuse
        self._at_once = {**(at_once or {})}
        self._waiting: queue.Queue[Request] = queue.Queue(WAITING_MAX)

    def next(self, wait_s: float) -> Request | None:
        """Return the oldest request that waits, or that comes within `wait_s`; None if none does."""
        self.check()
        try:
            return self._waiting.get(timeout=wait_s)
        except queue.Empty:
            self.check()
            return None

    def check(self) -> None:  # noqa: B027 - some middlewares have nothing that could be lost
        """Raise `SinkError` if requests cannot come any more."""

    @abstractmethod
    def reply(self, request: Request, fields: Fields) -> None:
        """Answer `request`."""

    @abstractmethod
    def announce(self, topic: str, kind: str) -> None:
        """Announce a topic on which `publish` tells all who listen."""

    @abstractmethod
    def publish(self, topic: str, kind: str, fields: Fields) -> None:
        """Publish a message on an announced topic. It may be lost, and never waits long."""

    @abstractmethod
    def close(self) -> None:
        """Refuse what still waits, and offer nothing any more."""

    def _take(self, request: Request) -> None:
        """Take a request, in a thread of the middleware's."""
        at_once = self._at_once.get(request.name)
        if at_once is not None:
            self.reply(request, at_once(request.fields))
            return
        try:
            self._waiting.put_nowait(request)
        except queue.Full:
            self._refuse_now(request, f"{WAITING_MAX} requests wait already; ask again later")

    def _refuse_waiting(self) -> None:
        """Tell those who still wait that the service has ended."""
        while True:
            try:
                request = self._waiting.get_nowait()
            except queue.Empty:
                return
            self._refuse_now(request, ENDED)

    def _refuse_now(self, request: Request, why: str) -> None:
        """Refuse `request` without a wait."""
        self.reply(request, self._refuse(why))

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


def known_fields(kind: str, fields: Fields) -> dict[str, Any]:
    """Return those of `fields` that an answer of the service type `kind` has."""
    known = {field for field, _ in types_of(2).layout(f"{kind}_Response")}
    return {name: value for name, value in fields.items() if name in known}
