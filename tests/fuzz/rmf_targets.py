"""What users, fleets and dispatchers of Open-RMF send, and the file of a fleet that bids."""

from __future__ import annotations

import json
from collections.abc import Sequence

from robochoc.formats import InvalidInputError
from robochoc.ros.message_types import types_of
from robochoc.ros.rmf.allocation import cheapest_first
from robochoc.ros.rmf.bidder import Bidder
from robochoc.ros.rmf.dispatcher import Dispatcher
from robochoc.ros.rmf.fleet_file import RmfFleet, RobotSpec, read_rmf_fleet
from robochoc.ros.rmf.messages import (
    TOPICS,
    ApiRequest,
    BidNotice,
    BidProposal,
    BidResponse,
    DispatchAck,
    DispatchCommand,
    Message,
    fields_of,
    message_of,
)
from tests.fuzz.file_targets import folder
from tests.fuzz.harness import Target, assert_clear
from tests.fuzz.mutations import one_of, spoilt_bytes, spoilt_json, spoilt_text
from tests.support.ros_recordings import NOW

FLEET = b"""fleet: carts
distance: streets
robots: {one: {at: [0, 0.5], speed: 0.7}, two: {at: [3, 4]}}
places: {pantry: [1, 2], coe: [-3, 7]}
"""


def check_fleet(content: bytes) -> bool:
    """A fleet file is read or refused; the fleet that is read bids."""
    with folder() as place:
        file = place / "fleet.yaml"
        file.write_bytes(content)
        try:
            fleet = read_rmf_fleet(file)
        except InvalidInputError as invalid:
            assert_clear(str(invalid))
            return False
    bidder = Bidder(fleet)
    task = {"category": "patrol", "description": {"places": [*fleet.places][:3]}}
    bidder.receive(BidNotice(json.dumps(task), "t", 1), 0)
    (answer,) = bidder.drain()
    assert isinstance(answer, BidResponse)
    assert answer.has_proposal
    return True


def conversations() -> Sequence[bytes]:
    """Messages on RMF's topics, with their fields in JSON."""
    task = {"category": "patrol", "description": {"places": ["pantry", "coe"], "rounds": 2}, "fleet_name": "carts"}
    delivery = {"category": "delivery", "description": {"pickup": {"place": "coe"}, "dropoff": {"place": "pantry"}}}
    asked = [{"type": "dispatch_task_request", "request": one} for one in (task, delivery)]
    cancel = {"type": "cancel_task_request", "task_id": "patrol.dispatch-1"}
    sent: list[Message] = [
        *(ApiRequest(json.dumps(one), str(number)) for number, one in enumerate([*asked, cancel])),
        BidNotice(json.dumps(task), "t", 10**9),
        BidResponse("patrol.dispatch-1", has_proposal=True, proposal=BidProposal("f", "r", 1.0, 2.0, NOW)),
        DispatchCommand("carts", "t", 3, NOW, 1),
        DispatchAck(3, success=True),
    ]
    words = [[TOPICS[type(one)][0], fields_of(one, as_json=True)] for one in sent]
    return [json.dumps(words).encode(), *(json.dumps([word]).encode() for word in words)]


def check_messages(content: bytes) -> bool:
    """Messages are handled or ignored, and what is answered can be sent."""
    try:
        conversation = json.loads(content)
    except (ValueError, RecursionError):
        return False
    fleet = RmfFleet("carts", {"one": RobotSpec((0, 0), 1.0)}, {"pantry": (18, 3), "coe": (7, 3)})
    cores = Dispatcher("", lambda costs, _: cheapest_first(costs)), Bidder(fleet)
    accepted, now_s = False, 0.0
    for one in conversation if isinstance(conversation, list) else [conversation]:
        match one:
            case [str(topic), dict(fields)]:
                message = message_of(topic, fields)
            case _:
                continue
        now_s += 1
        accepted |= message is not None
        for core in cores:
            if message is not None:
                core.receive(message, now_s)
            core.tick(now_s)
            for answer in core.drain():
                topic, kind = TOPICS[type(answer)]
                types_of(2).encode(kind, fields_of(answer))
    return accepted


TARGETS = (
    Target("rmf-fleet", lambda: [FLEET], one_of(spoilt_text, spoilt_text, spoilt_bytes), check_fleet),
    Target(
        "rmf-messages",
        conversations,
        one_of(spoilt_json, spoilt_json, spoilt_json, spoilt_text, spoilt_bytes),
        check_messages,
    ),
)
