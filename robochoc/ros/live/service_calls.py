"""The base class of clients that call services over any middleware. Answers arrive later, in the order of arrival.

Answers are untrusted. Each call gets at most one answer: repeated answers, and answers to unknown calls, are ignored.
A call may also stay without an answer, so callers need a time limit.
"""

from __future__ import annotations

import queue
import threading
from abc import ABC, abstractmethod
from collections.abc import Mapping
from importlib import import_module
from types import MappingProxyType
from typing import NamedTuple, Self, cast

from robochoc.robots.sink import Fields, SinkError
from robochoc.robots.source import Source

_MIDDLEWARES: Mapping[str, tuple[str, str]] = MappingProxyType(
    {
        "dds": ("dds_calls", "DdsCalls"),
        "rmw_zenoh": ("rmw_zenoh_calls", "RmwZenohCalls"),
        "rosbridge": ("rosbridge_calls", "RosbridgeCalls"),
    }
)
"""For each kind of middleware: its module in this package, and its class in that module."""


class Answer(NamedTuple):
    """The answer to the call `number`. `fields` is None if no answer will arrive, for the reason `why`."""

    number: int
    fields: Fields | None
    why: str = ""


class ServiceCalls(ABC):
    """Calls services; a context manager. All methods raise `SinkError`.

    Args:
        place: The place of the middleware, as for its sink.
    """

    where: str = ""
    """A description of the place of the services."""

    def __init__(self, place: str) -> None:
        self.place = place
        self._kinds: dict[str, str] = {}
        self._lock = threading.Lock()
        self._calls = 0
        self._open: set[int] = set()
        self._answers: queue.SimpleQueue[Answer] = queue.SimpleQueue()

    def prepare(self, services: Mapping[str, str]) -> None:
        """Prepare calls of `services` (name to type, such as `std_srvs/Trigger`). May be called once."""
        self._kinds = {**services}

    @abstractmethod
    def has_server(self, service: str) -> bool | None:
        """Return whether a server offers `service`; None if the middleware cannot tell."""

    def call(self, service: str, fields: Fields, wait_s: float) -> int:
        """Call a prepared service, and return the number of the call. The answer is needed within `wait_s` seconds."""
        with self._lock:
            self._calls += 1
            number = self._calls
            self._open.add(number)
        self._send(number, service, fields, wait_s)
        return number

    def answer(self, wait_s: float) -> Answer | None:
        """Return the oldest answer, or the first to arrive within `wait_s` seconds; None if none arrives."""
        try:
            return self._answers.get(timeout=wait_s) if wait_s > 0 else self._answers.get_nowait()
        except queue.Empty:
            self.check()
            return None

    def check(self) -> None:  # noqa: B027 - some middlewares have no connection
        """Raise `SinkError` if no further answers can arrive."""

    @abstractmethod
    def source(self) -> Source:
        """Return a new source of messages in the same place. The caller closes it. Raises `SourceError`."""

    @abstractmethod
    def close(self) -> None:
        """End the connection."""

    @abstractmethod
    def _send(self, number: int, service: str, fields: Fields, wait_s: float) -> None:
        """Send a request."""

    def _put(self, number: int, fields: Fields | None, why: str = "") -> None:
        """Store an answer, in any thread."""
        with self._lock:
            if number not in self._open:
                return
            self._open.remove(number)
        self._answers.put(Answer(number, fields, why))

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


def open_calls(text: str) -> ServiceCalls:
    """Return a client in the place `text`, such as `dds:5`. Raises `SinkError`."""
    from robochoc.robots.connections import missing_packages_of  # noqa: PLC0415 - start-up

    kind, _, place = text.partition(":")
    if kind not in _MIDDLEWARES:
        raise SinkError(f"{kind or 'an empty place'!r} is not a middleware; use {', '.join(_MIDDLEWARES)}, as in dds:5")
    missing = missing_packages_of(kind)
    if missing:
        raise SinkError(missing)
    module, name = _MIDDLEWARES[kind]
    factory = getattr(import_module(f"robochoc.ros.live.{module}"), name)
    return cast("ServiceCalls", factory(place.removeprefix("//")))
