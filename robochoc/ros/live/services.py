"""The base class of services over any middleware. Requests wait in a queue, or are answered at once.

Requests are untrusted. Every request from a known client is answered, even if the request cannot be read.
"""

from __future__ import annotations

import queue
from abc import ABC, abstractmethod
from collections.abc import Callable, Collection, Mapping
from typing import TYPE_CHECKING, Any, NamedTuple, Self

from robochoc.robots.sink import Fields
from robochoc.ros.message_types import types_of

if TYPE_CHECKING:
    from robochoc.ros.live.action_goals import ActionGoals

WAITING_MAX = 16
"""The size of the queue of requests. Requests beyond it are refused at once."""
ENDED = "the service has ended"

Refuse = Callable[[str], Fields]
"""Returns the fields of an answer that refuses a request for a given reason."""


class ServiceRequest(NamedTuple):
    """A request to the service `name`: its fields, and the client's id, whose type depends on the middleware."""

    name: str
    fields: Fields
    client: Any


ImmediateServices = Mapping[str, Callable[[ServiceRequest], Fields | None]]
"""The services, by name, that are answered in the receiving thread, even while other requests wait. A service that
returns None answers later, by `Services.reply`.
"""


class Services(ABC):
    """Offers services; a context manager. All methods raise `SinkError`.

    Args:
        kinds: The type of each service, such as `std_srvs/Trigger`, by service name.
        refuse: Returns the fields of an answer that refuses a request.
        immediate: The services that are answered without a queue.
    """

    where: str = ""
    """A description of the place of the services."""
    lacking: Collection[str] = ()
    """The names of services that are not offered, because their types are not installed."""

    def __init__(self, kinds: Mapping[str, str], refuse: Refuse, immediate: ImmediateServices | None = None) -> None:
        self._kinds = {**kinds}
        self._refuse = refuse
        self._immediate = {**(immediate or {})}
        self._waiting: queue.Queue[ServiceRequest] = queue.Queue(WAITING_MAX)

    def next(self, wait_s: float) -> ServiceRequest | None:
        """Return the oldest waiting request, or the first to arrive within `wait_s`; None if none arrives."""
        self.check()
        try:
            return self._waiting.get(timeout=wait_s)
        except queue.Empty:
            self.check()
            return None

    def put(self, request: ServiceRequest) -> bool:
        """Put a request into the queue, in any thread; return False if the queue is full."""
        try:
            self._waiting.put_nowait(request)
        except queue.Full:
            return False
        return True

    def check(self) -> None:  # noqa: B027 - some middlewares have no connection
        """Raise `SinkError` if no further requests can arrive."""

    @abstractmethod
    def reply(self, request: ServiceRequest, fields: Fields) -> None:
        """Answer `request`."""

    def offer_action(self, name: str, kind: str, goals: ActionGoals) -> None:  # noqa: B027 - most middlewares cannot
        """Offer an action, if the middleware has operations for actions; otherwise `goals` remains without clients."""

    @abstractmethod
    def announce(self, topic: str, kind: str) -> None:
        """Announce a topic for `publish`."""

    @abstractmethod
    def publish(self, topic: str, kind: str, fields: Fields) -> None:
        """Publish a message on an announced topic without a long wait. The message may be lost."""

    @abstractmethod
    def close(self) -> None:
        """Refuse the waiting requests, and stop offering services."""

    def _accept(self, request: ServiceRequest) -> None:
        """Answer a request at once or put it into the queue; called in a thread of the middleware."""
        immediate = self._immediate.get(request.name)
        if immediate is not None:
            answer = immediate(request)
            if answer is not None:
                self.reply(request, answer)
        elif not self.put(request):
            self._refuse_now(request, f"{WAITING_MAX} requests are already waiting; try again later")

    def _refuse_waiting(self) -> None:
        """Refuse all waiting requests."""
        while True:
            try:
                request = self._waiting.get_nowait()
            except queue.Empty:
                return
            if request.name in self._kinds:  # the goals of actions are ended elsewhere
                self._refuse_now(request, ENDED)

    def _refuse_now(self, request: ServiceRequest, why: str) -> None:
        """Refuse `request` without waiting."""
        self.reply(request, self._refuse(why))

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


def known_fields(kind: str, fields: Fields) -> dict[str, Any]:
    """Return the `fields` that answers of the service type `kind` have."""
    known = {field for field, _ in types_of(2).layout(f"{kind}_Response")}
    return {name: value for name, value in fields.items() if name in known}
