"""Services of ROS 2 by rclpy, where it can be imported: for clients of whatever middleware that ROS 2 has."""

from __future__ import annotations

import importlib
import queue
import threading
from collections.abc import Mapping
from contextlib import suppress
from functools import partial
from typing import Any

from robochoc.robots.sink import Fields, SinkError
from robochoc.ros.live.rclpy_node import BLOCKED_S, END_S, RclpyNode, fields_of, filled
from robochoc.ros.live.services import ENDED, AtOnce, Refuse, Request, Services
from robochoc.ros.live.transport import message_class


class RclpyServices(Services):
    """Offers services as a node of ROS 2. The client of a request is a queue for its answer.

    A thread spins the node. It takes one request at a time, and waits for the answer; the middleware keeps the others.
    Services that do not wait for their turn have a node and a thread of their own. A service whose type is not built
    here is left out, see `lacking`.

    Args:
        place: Must be empty: the domain is `ROS_DOMAIN_ID`'s.
        services: The type of each service, such as `std_srvs/Trigger`.
        refuse: Makes the fields of an answer that refuses, for a reason in words.
        at_once: Those of the services that do not wait for their turn.
    """

    where = "rclpy"

    def __init__(self, place: str, services: Mapping[str, str], refuse: Refuse, at_once: AtOnce | None = None) -> None:
        super().__init__(services, refuse, at_once)
        self._ros = RclpyNode(place, SinkError)
        self._over = threading.Event()
        self._publishers: dict[str, tuple[Any, Any]] = {}
        nodes = {False: self._ros.node}
        if self._at_once:
            nodes[True] = self._ros.another_node("at_once")
        lacking = []
        for name, kind in services.items():
            package, _, short = kind.partition("/")
            try:
                type_ = getattr(importlib.import_module(f"{package}.srv"), short)
            except (ImportError, AttributeError):
                lacking.append(name)
                continue
            nodes[name in self._at_once].create_service(type_, name, partial(self._called, name))
        self.lacking = lacking
        self._executors = [self._spun(node) for node in nodes.values()]

    def check(self) -> None:
        """Raise `SinkError` if the context was shut down."""
        self._ros.check()

    def reply(self, request: Request, fields: Fields) -> None:
        """Answer `request`."""
        request.client.put(fields)

    def announce(self, topic: str, kind: str) -> None:
        """Announce a topic, reliable and not latched."""
        type_ = message_class(kind, SinkError, "rclpy")
        self._publishers[topic] = type_, self._ros.node.create_publisher(type_, topic, self._ros.for_services())

    def publish(self, topic: str, kind: str, fields: Fields) -> None:  # noqa: ARG002 - it was announced with it
        """Publish a message."""
        type_, publisher = self._publishers[topic]
        with suppress(Exception):  # what is lost is told again
            publisher.publish(filled(type_(), fields))

    def close(self) -> None:
        """Refuse what still waits, and leave ROS."""
        self._over.set()
        for executor, thread in self._executors:
            with suppress(Exception):  # it may be shut down already
                executor.wake()
            thread.join(END_S)
            with suppress(Exception):
                executor.shutdown(timeout_sec=END_S)
        self._ros.close()

    def _spun(self, node: Any) -> tuple[Any, threading.Thread]:  # noqa: ANN401 - rclpy is untyped
        """Return an executor of `node`, and the thread that spins it."""
        executor = importlib.import_module("rclpy.executors").SingleThreadedExecutor(context=self._ros.context)
        executor.add_node(node)
        thread = threading.Thread(target=self._spin, args=(executor,), daemon=True, name="rclpy serves")
        thread.start()
        return executor, thread

    def _called(self, name: str, request: Any, response: Any) -> Any:  # noqa: ANN401 - rclpy is untyped
        """Return the answer to a request, in the thread that spins."""
        asked = Request(name, fields_of(request), queue.Queue(1))
        self._take(asked)
        while not self._over.is_set():
            try:
                return _filled(response, asked.client.get(timeout=BLOCKED_S))
            except queue.Empty:
                continue
        return _filled(response, self._refuse(ENDED))

    def _spin(self, executor: Any) -> None:  # noqa: ANN401 - rclpy is untyped
        while not self._over.is_set():
            try:
                executor.spin_once(timeout_sec=BLOCKED_S)
            except Exception:  # noqa: BLE001 - `next` sees that the context has ended
                if not self._ros.context.ok():
                    return


def _filled(response: Any, fields: Fields) -> Any:  # noqa: ANN401 - rclpy is untyped
    known = response.get_fields_and_field_types()
    return filled(response, {name: value for name, value in fields.items() if name in known})
