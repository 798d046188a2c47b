"""Services of ROS 2 by rclpy, where it can be imported: for clients of whatever middleware that ROS 2 has."""

from __future__ import annotations

import importlib
import queue
import threading
from collections.abc import Callable, Mapping
from contextlib import suppress
from functools import partial
from typing import Any, NamedTuple, Self

from robochoc.ros.live.rclpy_messages import fields_of, filled
from robochoc.ros.live.rclpy_node import BLOCKED_S, END_S, RclpyNode
from robochoc.ros.sink import Fields, SinkError

Refuse = Callable[[str], Fields]


class _Request(NamedTuple):
    """A request to the service `name`, and where its answer goes."""

    name: str
    fields: Fields
    answer: queue.Queue[Fields]


class RclpyServices:
    """Offers services, by their names, as a node of ROS 2. Raises `SinkError`, as its methods do.

    A thread spins the node. It takes one request at a time, and waits for the answer; the middleware keeps the others.
    A service whose type is not built here is left out, see `lacking`.

    Args:
        place: Must be empty: the domain is `ROS_DOMAIN_ID`'s.
        services: The type of each service, such as `std_srvs/Trigger`.
        refuse: Makes the fields of an answer that refuses, for a reason in words.
    """

    lacking: list[str]
    """The names of services that are not offered, as their types cannot be imported."""

    where = "rclpy"

    def __init__(self, place: str, services: Mapping[str, str], refuse: Refuse) -> None:
        self._ros = RclpyNode(place, SinkError)
        self._refuse = refuse
        self._waiting: queue.Queue[_Request] = queue.Queue()
        self._over = threading.Event()
        self.lacking = []
        for name, kind in services.items():
            package, _, short = kind.partition("/")
            try:
                type_ = getattr(importlib.import_module(f"{package}.srv"), short)
            except (ImportError, AttributeError):
                self.lacking.append(name)
                continue
            self._ros.node.create_service(type_, name, partial(self._called, name))
        executors = importlib.import_module("rclpy.executors")
        self._executor: Any = executors.SingleThreadedExecutor(context=self._ros.context)
        self._executor.add_node(self._ros.node)
        self._thread = threading.Thread(target=self._spin, daemon=True, name="rclpy serves")
        self._thread.start()

    def next(self, wait_s: float) -> _Request | None:
        """Return the request that waits, or that comes within `wait_s`; None if none does."""
        try:
            return self._waiting.get(timeout=wait_s)
        except queue.Empty:
            self._ros.check()
            return None

    def reply(self, request: _Request, fields: Fields) -> None:
        """Answer `request`."""
        request.answer.put(fields)

    def close(self) -> None:
        """Refuse what still waits, and leave ROS."""
        self._over.set()
        with suppress(Exception):  # it may be shut down already
            self._executor.wake()
        self._thread.join(END_S)
        with suppress(Exception):
            self._executor.shutdown(timeout_sec=END_S)
        self._ros.close()

    def _called(self, name: str, request: Any, response: Any) -> Any:  # noqa: ANN401 - rclpy is untyped
        """Return the answer to a request, in the thread that spins."""
        asked = _Request(name, fields_of(request), queue.Queue(1))
        self._waiting.put(asked)
        while not self._over.is_set():
            try:
                return _filled(response, asked.answer.get(timeout=BLOCKED_S))
            except queue.Empty:
                continue
        return _filled(response, self._refuse("the service has ended"))

    def _spin(self) -> None:
        while not self._over.is_set():
            try:
                self._executor.spin_once(timeout_sec=BLOCKED_S)
            except Exception:  # noqa: BLE001 - `next` sees that the context has ended
                if not self._ros.context.ok():
                    return

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


def _filled(response: Any, fields: Fields) -> Any:  # noqa: ANN401 - rclpy is untyped
    known = response.get_fields_and_field_types()
    return filled(response, {name: value for name, value in fields.items() if name in known})
