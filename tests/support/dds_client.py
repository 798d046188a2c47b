"""A client of services in DDS: a program of cyclonedds alone, with types written by hand, as rmw_cyclonedds has them.

Run as `dds_client.py DOMAIN SERVICES`; services are JSON, the kind of each by its name. It says "ready" when they are
there. For each line of its input, the name and the fields of a request, it says the answer; a request of `raw` bytes
goes out as it is, with the header before it. A line `["", N]` has it ask the first service N times before it listens.
"""

import argparse
import json
import struct
import sys
import time
from dataclasses import asdict, dataclass, field
from typing import Any

from cyclonedds.core import Policy, Qos
from cyclonedds.domain import DomainParticipant
from cyclonedds.idl import IdlStruct
from cyclonedds.idl.types import float64, int64, sequence, uint8, uint64
from cyclonedds.pub import DataWriter
from cyclonedds.sub import DataReader
from cyclonedds.topic import Topic

HANG_S = 120.0


@dataclass
class TriggerRequest(IdlStruct, typename="std_srvs.srv.dds_.Trigger_Request_"):
    guid: uint64 = 0
    seq: int64 = 0
    structure_needs_at_least_one_member: uint8 = 0


@dataclass
class TriggerResponse(IdlStruct, typename="std_srvs.srv.dds_.Trigger_Response_"):
    guid: uint64 = 0
    seq: int64 = 0
    success: bool = False
    message: str = ""


@dataclass
class DecideRequest(IdlStruct, typename="robochoc_msgs.srv.dds_.Decide_Request_"):
    guid: uint64 = 0
    seq: int64 = 0
    team: str = ""
    changes: str = ""
    timeout: float64 = 0.0


@dataclass
class DecideResponse(IdlStruct, typename="robochoc_msgs.srv.dds_.Decide_Response_"):
    guid: uint64 = 0
    seq: int64 = 0
    success: bool = False
    message: str = ""
    verdict: str = ""
    cost: str = ""
    variables: sequence[str] = field(default_factory=list)  # type: ignore[type-arg, assignment]  # none to mypy
    values: sequence[int64] = field(default_factory=list)  # type: ignore[type-arg, assignment]  # none to mypy
    withdrawn: sequence[str] = field(default_factory=list)  # type: ignore[type-arg, assignment]  # none to mypy
    result: str = ""


TYPES: dict[str, tuple[Any, Any]] = {
    "Trigger": (TriggerRequest, TriggerResponse),
    "Decide": (DecideRequest, DecideResponse),
}
GUID = 0x0102030405060708
QUALITY = Qos(
    Policy.Reliability.Reliable(1_000_000_000),
    Policy.Durability.Volatile,
    Policy.History.KeepLast(100),
    Policy.TypeConsistency.AllowTypeCoercion(ignore_member_names=True),
)


class Client:
    """This end of one service."""

    def __init__(self, participant: DomainParticipant, name: str, kind: str) -> None:
        self.asks, tells = TYPES[kind]
        self.writer: Any = DataWriter(participant, Topic(participant, f"rq{name}Request", self.asks), qos=QUALITY)
        self.reader: Any = DataReader(participant, Topic(participant, f"rr{name}Reply", tells), qos=QUALITY)
        self.asked = 0

    def is_there(self) -> bool:
        matched = self.writer.get_publication_matched_status(), self.reader.get_subscription_matched_status()
        return all(one.current_count for one in matched)

    def ask(self, fields: dict[str, Any]) -> None:
        self.asked += 1
        raw = fields.pop("raw", None)
        request = self.asks(guid=GUID, seq=self.asked, **fields)
        if raw is not None:
            content = b"\0\1\0\0" + struct.pack("<Qq", GUID, self.asked) + bytes.fromhex(raw)
            request.serialize = lambda *_, **__: content
        self.writer.write(request)

    def answer(self) -> Any:  # noqa: ANN401 - JSON
        until = time.monotonic() + HANG_S
        while time.monotonic() < until:
            for one in self.reader.take(1):
                if one.sample_info.valid_data:
                    return asdict(one)
            time.sleep(0.005)
        raise TimeoutError("no answer has come")


def say(what: object) -> None:
    sys.stdout.write(json.dumps(what) + "\n")
    sys.stdout.flush()


def run(domain: int, services: dict[str, str]) -> None:
    participant = DomainParticipant(domain)
    clients = {name: Client(participant, name, kind) for name, kind in services.items()}
    while not all(client.is_there() for client in clients.values()):
        time.sleep(0.02)
    say("ready")
    for line in sys.stdin:
        name, fields = json.loads(line)
        if name:
            clients[name].ask(fields)
            say(clients[name].answer())
            continue
        first = next(iter(clients.values()))
        for _ in range(fields):
            first.ask({})
        say([first.answer() for _ in range(fields)])


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("domain", type=int, metavar="DOMAIN")
    parser.add_argument("services", type=json.loads, metavar="SERVICES", help="a JSON object")
    asked = parser.parse_args()
    run(asked.domain, asked.services)
