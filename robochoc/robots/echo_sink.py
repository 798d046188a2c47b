"""The sink `echo`: prints messages instead of publishing them."""

from __future__ import annotations

import json
import sys

from robochoc.formats.diagnostics import on_one_line
from robochoc.robots.sink import Fields, Sink, SinkError

ECHO = "echo"


class EchoSink(Sink):
    """Prints a line for each message on standard error: the topic, its ROS type, and the fields as JSON.

    Reports and poses are not printed, since there may be thousands of them for a few decisions.
    """

    live = False
    wants_reports = False

    def __init__(self, place: str) -> None:
        if place:
            raise SinkError(on_one_line(f"{ECHO} prints messages, and has no place such as {place!r}: write {ECHO}"))
        super().__init__(ECHO)

    def publish(self, topic: str, kind: str, fields: Fields, at_ns: int) -> None:  # noqa: ARG002 - the header has the time
        """Print the message."""
        print(topic, kind, json.dumps(fields, default=str), file=sys.stderr)  # noqa: T201 - the purpose of this sink

    def close(self) -> None:
        """Do nothing, since every message has been printed."""
