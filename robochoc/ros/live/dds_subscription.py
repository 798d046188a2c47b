"""A subscription to topics in DDS. A thread of its own takes messages as they come, so that few wait in DDS."""

from __future__ import annotations

import threading
from collections.abc import Callable, Sequence
from contextlib import suppress
from typing import Any

from cyclonedds.core import DDSException, GuardCondition, InstanceState, ReadCondition, SampleState, ViewState, WaitSet
from cyclonedds.domain import DomainParticipant
from cyclonedds.sub import DataReader

END_S = 5.0
"""The longest wait for the thread, in seconds."""
_TAKEN = 100
"""Messages taken of a topic at a time."""
_WAIT_NS = 1_000_000_000
_ANY = SampleState.Any | ViewState.Any | InstanceState.Any


class Subscription:
    """Takes messages from `readers`, each with its topic and its type, and hands over their bytes, until it is closed.

    Raises:
        DDSException: The participant cannot wait for messages.
    """

    def __init__(
        self,
        participant: DomainParticipant,
        readers: Sequence[tuple[DataReader[Any], str, str]],
        take: Callable[[str, str, bytes], None],
    ) -> None:
        self._take = take
        self._over = threading.Event()
        self._wakes: Any = GuardCondition(participant)
        self._waits: Any = WaitSet(participant)
        self._waits.attach(self._wakes)
        self._readers = [*readers]
        for reader, _, _ in readers:
            self._waits.attach(ReadCondition(reader, _ANY))
        self._thread = threading.Thread(target=self._run, daemon=True, name="DDS subscription")
        self._thread.start()

    def _run(self) -> None:
        while not self._over.is_set():
            with suppress(DDSException):
                self._waits.wait(_WAIT_NS)
            for reader, topic, kind in self._readers:
                if self._over.is_set():
                    return
                self._take_from(reader, topic, kind)

    def _take_from(self, reader: DataReader[Any], topic: str, kind: str) -> None:
        while not self._over.is_set():
            try:
                found = reader.take(_TAKEN)
            except DDSException:
                return
            for message in found:
                if message.sample_info.valid_data:
                    self._take(topic, kind, message.content)
            if len(found) < _TAKEN:
                return

    def close(self) -> None:
        """End the thread and the subscription."""
        self._over.set()
        with suppress(DDSException):
            self._wakes.set(True)
        self._thread.join(END_S)
        self._waits = self._wakes = None
        self._readers.clear()
