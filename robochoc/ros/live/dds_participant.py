"""A participant in a DDS domain. Only this module and `dds_types` use Cyclone DDS (cyclonedds).

A process opens each domain once. Sinks and sources in the same domain share it; the last one to leave closes the
domain.
"""

from __future__ import annotations

import os
import secrets
import threading
import time
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from typing import Any

from cyclonedds.core import (
    DDSException,
    GuardCondition,
    InstanceState,
    Policy,
    Qos,
    ReadCondition,
    SampleState,
    ViewState,
    WaitSet,
)
from cyclonedds.domain import Domain, DomainParticipant
from cyclonedds.internal import load_cyclonedds
from cyclonedds.pub import DataWriter, Publisher
from cyclonedds.sub import DataReader, Subscriber
from cyclonedds.topic import Topic

from robochoc.ros.live.dds_place import DdsPlace, Quality
from robochoc.ros.live.dds_types import RawMessage, raw_service_type, raw_type, topic_name
from robochoc.ros.live.transport import ErrorClass
from robochoc.ros.message_types import UnknownTypeError
from robochoc.ros.type_hashes import type_hash

END_S = 5.0
"""The longest wait for the end of a subscription's thread, in seconds."""
_TAKEN = 100
"""The maximum number of messages read from a topic at a time."""
_WAIT_NS = 1_000_000_000
_ANY = SampleState.Any | ViewState.Any | InstanceState.Any
CONFIGURATION_VARIABLE = "CYCLONEDDS_URI"
MESSAGE_BYTES_MAX = 256 * 1024
"""Longer messages are neither sent nor received: waypoints and reports are short."""
BLOCKED_S = 0.2
"""The maximum duration of a blocking call, in seconds, so that signals are handled."""
REQUESTS_MAX = 256
"""The number of unread requests, and the number of unread answers, that DDS stores per service."""
_TOPIC_PREFIX = {"Request": "rq", "Reply": "rr"}
"""The beginnings of the names of the two topics of a service, by their endings."""
_SECOND_NS = 1_000_000_000
_LIMIT = (
    "<CycloneDDS><Domain><Internal>"
    f"<MaxSampleSize>{MESSAGE_BYTES_MAX} B</MaxSampleSize>"
    "</Internal></Domain></CycloneDDS>"
)


class _Domains:
    """Counts the users of the open domains in this process."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._open: dict[int, tuple[Domain, int]] = {}

    def enter(self, number: int) -> None:
        """Open the domain, or count one more user. Raises `DDSException`, `UnicodeEncodeError`."""
        with self._lock:
            domain, users = self._open.get(number, (None, 0))
            if domain is None:
                given = os.environ.get(CONFIGURATION_VARIABLE, "")
                domain = Domain(number, f"{given},{_LIMIT}" if given else _LIMIT)
                # Otherwise DDS writes a line to standard error for each invalid message from an unknown participant.
                load_cyclonedds().dds_set_log_mask(0)
            self._open[number] = domain, users + 1

    def leave(self, number: int) -> None:
        """Count one user less; close the domain after the last user."""
        with self._lock:
            domain, users = self._open.pop(number)
            if users > 1:
                self._open[number] = domain, users - 1


_domains = _Domains()


class Participant:
    """A participant in the domain of `place`. The constructor and the methods raise `failed`."""

    def __init__(self, place: DdsPlace, failed: ErrorClass) -> None:
        self.domain, self._quality, self._failed = place.domain, place.quality, failed
        self._writers: dict[str, Any] = {}
        self._publisher: Any = None
        self._participant: Any = None
        joins = f"domain {self.domain} of DDS cannot be joined"
        hint = f"; see {CONFIGURATION_VARIABLE}, and whether this machine has a network"
        with self._reported(joins, hint):
            _domains.enter(self.domain)
        self._is_open = True
        try:
            with self._reported(joins, hint):
                self._participant = DomainParticipant(self.domain)
        except failed:
            self.close()
            raise

    def announce(self, topic: str, kind: str) -> None:
        """Create a writer for `topic`."""
        with self._reported(f"{topic} cannot be announced in DDS"):
            if self._publisher is None:
                self._publisher = Publisher(self._participant, qos=_partitions(self._quality))
            self._writers[topic] = DataWriter(
                self._publisher, self._topic(topic, kind), qos=_of_writer(self._quality, kind)
            )

    def subscribe(self, topics: Mapping[str, str], receive: Callable[[str, str, bytes], None]) -> Subscription:
        """Subscribe to `topics` (name to type). Each message is passed to `receive`, in a thread."""
        with self._reported("the topics cannot be subscribed to in DDS"):
            subscriber = Subscriber(self._participant, qos=_partitions(self._quality))
            readers = [
                (DataReader(subscriber, self._topic(topic, kind), qos=_of_reader(self._quality, kind)), topic, kind)
                for topic, kind in topics.items()
            ]
            return Subscription(self._participant, readers, receive)

    def serve(self, name: str, kind: str) -> ServiceEnd:
        """Return the server's end of a service with the type `kind`, such as `std_srvs/Trigger`."""
        with self._reported(f"the service {name} cannot be offered in DDS"):
            return self._service_end(name, kind, "serviceid", ("Reply", "Response"), ("Request", "Request"))

    def call(self, name: str, kind: str) -> ServiceEnd:
        """Return the client's end of a service with the type `kind`."""
        with self._reported(f"the service {name} cannot be called in DDS"):
            return self._service_end(name, kind, "clientid", ("Request", "Request"), ("Reply", "Response"))

    def _service_end(
        self, name: str, kind: str, role: str, written: tuple[str, str], read: tuple[str, str]
    ) -> ServiceEnd:
        """Return one end of a service. `written` and `read` are the endings of a topic and of its type."""
        # The other end matches the two topics of this one by this common identifier.
        mark = ".".join(f"{byte:x}" for byte in secrets.token_bytes(16))
        quality = Qos(
            Policy.Reliability.Reliable(round(BLOCKED_S * _SECOND_NS)),
            Policy.Durability.Volatile,
            Policy.History.KeepLast(REQUESTS_MAX),
            Policy.DataRepresentation(use_cdrv0_representation=True),
            Policy.Userdata(f"{role}= {mark};".encode()),
        )
        sent_type: Any = raw_service_type(f"{kind}_{written[1]}")
        sent: Any = Topic(self._participant, f"{_TOPIC_PREFIX[written[0]]}{name}{written[0]}", sent_type)
        received_type: Any = raw_service_type(f"{kind}_{read[1]}")
        received: Any = Topic(self._participant, f"{_TOPIC_PREFIX[read[0]]}{name}{read[0]}", received_type)
        partitions = _partitions(self._quality)
        writer = DataWriter(Publisher(self._participant, qos=partitions), sent, qos=quality)
        # A later request never replaces an earlier one: its writer waits until there is room.
        others = Qos(
            Policy.History.KeepAll,
            Policy.ResourceLimits(REQUESTS_MAX, REQUESTS_MAX, REQUESTS_MAX),
            Policy.TypeConsistency.AllowTypeCoercion(ignore_member_names=True),
            base=quality,
        )
        reader = DataReader(Subscriber(self._participant, qos=partitions), received, qos=others)
        return ServiceEnd(name, sent_type, reader, writer)

    def listen(self, ends: Sequence[ServiceEnd], receive: Callable[[str, str, bytes], None]) -> Subscription:
        """Call `receive` in a separate thread with the name of the service, "", and the bytes of each message."""
        return Subscription(self._participant, [(end.reader, end.name, "") for end in ends], receive)

    def _topic(self, topic: str, kind: str) -> Any:  # noqa: ANN401 - types are made at run time
        return Topic(self._participant, topic_name(topic), raw_type(kind))

    def write(self, topic: str, kind: str, content: bytes, patience_s: float) -> bool:
        """Publish a message; return False if a subscriber cannot accept it within `patience_s` seconds."""
        message = raw_type(kind)(content)
        until = time.monotonic() + patience_s
        while True:
            try:
                with self._reported(f"{len(content):,} bytes cannot be published on {topic} in DDS"):
                    self._writers[topic].write(message)
            except TimeoutError:
                if time.monotonic() > until:
                    return False
            else:
                return True

    def subscribers(self, topics: Iterable[str]) -> list[int]:
        """Return the present number of subscribers to each of `topics`."""
        with self._reported("the subscribers in DDS cannot be counted"):
            return [int(self._writers[topic].get_publication_matched_status().current_count) for topic in topics]

    def is_acknowledged(self, topic: str) -> bool:
        """Return whether all reliable subscribers acknowledge the messages of `topic` within `BLOCKED_S`."""
        with self._reported("DDS cannot report which messages were acknowledged"):
            try:
                return bool(self._writers[topic].wait_for_acks(round(BLOCKED_S * _SECOND_NS)))
            except AttributeError:  # cyclonedds 11.0.1 does not find its own constant when the time is over
                return False

    def close(self) -> None:
        """Leave the domain. A second call does nothing."""
        self._writers.clear()
        self._publisher = self._participant = None
        if self._is_open:
            self._is_open = False
            _domains.leave(self.domain)

    @contextmanager
    def _reported(self, what: str, hint: str = "") -> Iterator[None]:
        """Convert errors of DDS to `failed`, and its timeouts to `TimeoutError`."""
        try:
            yield
        except DDSException as error:
            if error.code == DDSException.DDS_RETCODE_TIMEOUT:
                raise TimeoutError(what) from error
            known = DDSException.error_message_mapping.get(error.code, ("", "unknown error"))
            raise self._failed(f"{what} ({known[1].lower()}){hint}") from error
        except UnicodeEncodeError as error:
            raise self._failed(f"{what} (its configuration must be ASCII){hint}") from error
        except UnknownTypeError as error:
            raise self._failed(f"{what}: {error}") from error


class ServiceEnd:
    """One end of a service: the server's, which reads requests and writes answers, or the client's.

    Args:
        name: The name of the service.
        sent: The DDS type of the messages that this end writes.
        reader: The library's reader.
        writer: The library's writer.
    """

    def __init__(self, name: str, sent: type[RawMessage], reader: Any, writer: Any) -> None:  # noqa: ANN401 - the library's
        self.name, self.reader = name, reader
        self._sent, self._writer = sent, writer

    def write(self, content: bytes) -> None:
        """Send a message. It is lost if nobody reads it."""
        with suppress(DDSException):
            self._writer.write(self._sent(content))

    def has_readers(self) -> bool:
        """Return whether the other end, or one of them, reads what this end writes."""
        return bool(self._writer.get_publication_matched_status().current_count)

    def has_writers(self) -> bool:
        """Return whether this end reads what the other end, or one of them, writes."""
        return bool(self.reader.get_subscription_matched_status().current_count)

    def is_acknowledged(self) -> bool:
        """Return whether all readers acknowledge the messages within `BLOCKED_S`."""
        try:
            return bool(self._writer.wait_for_acks(round(BLOCKED_S * _SECOND_NS)))
        except (AttributeError, DDSException):  # cyclonedds 11.0.1 does not find its own constant when the time is over
            return False


class Subscription:
    """Reads messages in a separate thread, so that few messages wait in DDS, and passes their bytes to `receive`.

    `readers` are given with their topics and types.

    Raises:
        DDSException: The participant cannot wait for messages.
    """

    def __init__(
        self,
        participant: DomainParticipant,
        readers: Sequence[tuple[DataReader[Any], str, str]],
        receive: Callable[[str, str, bytes], None],
    ) -> None:
        self._receive = receive
        self._ended = threading.Event()
        self._wakes: Any = GuardCondition(participant)
        self._waits: Any = WaitSet(participant)
        self._waits.attach(self._wakes)
        self._readers = [*readers]
        for reader, _, _ in readers:
            self._waits.attach(ReadCondition(reader, _ANY))
        self._thread = threading.Thread(target=self._run, daemon=True, name="DDS subscription")
        self._thread.start()

    def _run(self) -> None:
        while not self._ended.is_set():
            with suppress(DDSException):
                self._waits.wait(_WAIT_NS)
            for reader, topic, kind in self._readers:
                if self._ended.is_set():
                    return
                self._read(reader, topic, kind)

    def _read(self, reader: DataReader[Any], topic: str, kind: str) -> None:
        while not self._ended.is_set():
            try:
                found = reader.take(_TAKEN)
            except DDSException:
                return
            for message in found:
                if message.sample_info.valid_data:
                    self._receive(topic, kind, message.content)
            if len(found) < _TAKEN:
                return

    def close(self) -> None:
        """End the thread and the subscription."""
        self._ended.set()
        with suppress(DDSException):
            self._wakes.set(True)
        self._thread.join(END_S)
        self._waits = self._wakes = None
        self._readers.clear()


def _partitions(quality: Quality) -> Any:  # noqa: ANN401 - the library's
    return Qos(Policy.Partition([*quality.partitions])) if quality.partitions else Qos()


def _of_writer(quality: Quality, kind: str) -> Any:  # noqa: ANN401 - the library's
    """Return the quality of service for writers, which store unacknowledged messages, and `depth` for late joiners."""
    return Qos(
        *_common(quality, kind),
        Policy.History.KeepAll,
        Policy.DurabilityService(0, Policy.History.KeepLast(quality.depth), -1, -1, -1),
        Policy.WriterDataLifecycle(autodispose=False),
    )


def _of_reader(quality: Quality, kind: str) -> Any:  # noqa: ANN401 - the library's
    """Return the quality of service for readers. Field names are not compared: some definitions write `x_` for `x`."""
    return Qos(
        *_common(quality, kind),
        Policy.History.KeepLast(quality.depth),
        Policy.TypeConsistency.AllowTypeCoercion(ignore_member_names=True),
    )


def _common(quality: Quality, kind: str) -> Iterator[Any]:
    """Yield the common policies of readers and writers. The type hash is in the user data, as in ROS 2."""
    blocked = Policy.Reliability.Reliable(round(BLOCKED_S * _SECOND_NS))
    yield blocked if quality.reliable else Policy.Reliability.BestEffort
    yield Policy.Durability.TransientLocal if quality.latched else Policy.Durability.Volatile
    yield Policy.DataRepresentation(use_cdrv0_representation=True)
    yield Policy.Userdata(f"typehash={type_hash(kind)};".encode())
