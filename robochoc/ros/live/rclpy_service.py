"""Services as a ROS 2 node in this process, for clients of any middleware in the installed ROS 2."""

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
from robochoc.ros.live.services import ENDED, ImmediateServices, Refuse, ServiceRequest, Services
from robochoc.ros.live.transport import message_class


class RclpyServices(Services):
    """Offers services as a ROS 2 node. A request's `client` is a queue for its answer.

    A thread spins the node. It reads one request at a time and waits for the answer; further requests wait in the
    middleware. Immediate services have a separate node and thread. Services whose types are not installed are not
    offered; see `lacking`.

    Args:
        place: Must be empty; the domain is set by `ROS_DOMAIN_ID`.
        services: The type of each service, such as `std_srvs/Trigger`.
        refuse: Returns the fields of an answer that refuses a request for a given reason.
        immediate: The services that are answered without a queue.
    """

    where = "rclpy"

    def __init__(
        self, place: str, services: Mapping[str, str], refuse: Refuse, immediate: ImmediateServices | None = None
    ) -> None:
        super().__init__(services, refuse, immediate)
        self._ros = RclpyNode(place, SinkError)
        self._ended = threading.Event()
        self._publishers: dict[str, tuple[Any, Any]] = {}
        nodes = {False: self._ros.node}
        if self._immediate:
            nodes[True] = self._ros.add_node("at_once")
        lacking = []
        for name, kind in services.items():
            package, _, short = kind.partition("/")
            try:
                type_ = getattr(importlib.import_module(f"{package}.srv"), short)
            except (ImportError, AttributeError):
                lacking.append(name)
                continue
            nodes[name in self._immediate].create_service(type_, name, partial(self._answer, name))
        self.lacking = lacking
        self._executors = [self._start_executor(node) for node in nodes.values()]

    def check(self) -> None:
        """Raise `SinkError` if the context was shut down."""
        self._ros.check()

    def reply(self, request: ServiceRequest, fields: Fields) -> None:
        """Answer `request`."""
        request.client.put(fields)

    def announce(self, topic: str, kind: str) -> None:
        """Announce a reliable topic that is not latched."""
        type_ = message_class(kind, SinkError, "rclpy")
        self._publishers[topic] = type_, self._ros.node.create_publisher(type_, topic, self._ros.service_quality())

    def publish(self, topic: str, kind: str, fields: Fields) -> None:  # noqa: ARG002 - it was announced with it
        """Publish a message."""
        type_, publisher = self._publishers[topic]
        with suppress(Exception):  # a lost message is followed by newer ones
            publisher.publish(filled(type_(), fields))

    def close(self) -> None:
        """Refuse the waiting requests, and leave ROS."""
        self._ended.set()
        for executor, thread in self._executors:
            with suppress(Exception):  # it may be shut down already
                executor.wake()
            thread.join(END_S)
            with suppress(Exception):
                executor.shutdown(timeout_sec=END_S)
        self._ros.close()

    def _start_executor(self, node: Any) -> tuple[Any, threading.Thread]:  # noqa: ANN401 - rclpy is untyped
        """Return a new executor for `node`, and the thread that spins the executor."""
        executor = importlib.import_module("rclpy.executors").SingleThreadedExecutor(context=self._ros.context)
        executor.add_node(node)
        thread = threading.Thread(target=self._spin, args=(executor,), daemon=True, name="rclpy serves")
        thread.start()
        return executor, thread

    def _answer(self, name: str, request: Any, response: Any) -> Any:  # noqa: ANN401 - rclpy is untyped
        """Return the answer to a request; called in the spinning thread."""
        asked = ServiceRequest(name, fields_of(request), queue.Queue(1))
        self._accept(asked)
        while not self._ended.is_set():
            try:
                return _filled(response, asked.client.get(timeout=BLOCKED_S))
            except queue.Empty:
                continue
        return _filled(response, self._refuse(ENDED))

    def _spin(self, executor: Any) -> None:  # noqa: ANN401 - rclpy is untyped
        while not self._ended.is_set():
            try:
                executor.spin_once(timeout_sec=BLOCKED_S)
            except Exception:  # noqa: BLE001 - `next` sees that the context has ended
                if not self._ros.context.ok():
                    return


def _filled(response: Any, fields: Fields) -> Any:  # noqa: ANN401 - rclpy is untyped
    known = response.get_fields_and_field_types()
    return filled(response, {name: value for name, value in fields.items() if name in known})
