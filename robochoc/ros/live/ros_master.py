"""The ROS master, as far as it is asked here: whether it answers, and which nodes have subscribed."""

from __future__ import annotations

import http.client
import os
import xmlrpc.client
from typing import Any
from xml.parsers.expat import ExpatError

from robochoc.formats.diagnostics import on_one_line, shortened
from robochoc.robots.sink import SinkError
from robochoc.robots.source import SourceError

MASTER_S = 3.0
"""The longest wait for an answer of the master, in seconds."""
_DEFAULT_MASTER = "http://localhost:11311"
_CALLER = "/robochoc"

Failed = type[SinkError] | type[SourceError]


class _TransportWithTimeout(xmlrpc.client.Transport):
    """A transport that does not wait forever."""

    def make_connection(self, host: Any) -> http.client.HTTPConnection:  # noqa: ANN401 - typeshed's is private
        connection = super().make_connection(host)
        connection.timeout = MASTER_S
        return connection


class RosMaster:
    """The ROS master that `ROS_MASTER_URI` names. Methods raise `failed` if it does not answer."""

    def __init__(self, failed: Failed) -> None:
        self._failed = failed
        self.uri = os.environ.get("ROS_MASTER_URI", _DEFAULT_MASTER)

    def check(self) -> None:
        """Raise `failed` if no master answers."""
        self._ask("getPid")

    def subscribers(self) -> dict[str, set[str]]:
        """Return the nodes that have subscribed to each topic."""
        match self._ask("getSystemState"):
            case [_, list(subscribed), _]:
                return {topic: set(nodes) for topic, nodes in subscribed}
            case answer:
                raise self._failed(
                    f"what answers at {self.uri} is not a ROS master: {shortened(on_one_line(str(answer)))}"
                )

    def _ask(self, what: str) -> object:
        try:
            with xmlrpc.client.ServerProxy(self.uri, transport=_TransportWithTimeout()) as server:
                match getattr(server, what)(_CALLER):
                    case [1, _, answer]:
                        return answer
                    case answer:
                        said = shortened(on_one_line(str(answer)))
                        raise self._failed(f"the ROS master at {self.uri} refuses, it says: {said}; see its log")
        except (OSError, ValueError, http.client.HTTPException, xmlrpc.client.Error, ExpatError) as error:
            why = getattr(error, "strerror", None) or str(error) or type(error).__name__
            message = f"no ROS master answers at {self.uri} ({shortened(on_one_line(why))})"
            raise self._failed(f"{message}; start `roscore`, or set ROS_MASTER_URI") from error
