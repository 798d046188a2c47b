"""`robochoc serve --ros rmw_zenoh`: clients that are not ours ask by zenoh, and each is answered."""

from __future__ import annotations

import json
import signal
import subprocess
from collections.abc import Iterator
from contextlib import ExitStack
from pathlib import Path

import pytest
import zenoh
from click.testing import CliRunner

from robochoc.app.sketch.building import model_of
from robochoc.cli.group import cli
from robochoc.communication.network.zenoh_config import config
from robochoc.robots.sink import SinkError
from robochoc.ros.decide_service import DECIDE, TRIGGER, refusal
from robochoc.ros.live import rmw_zenoh_session
from robochoc.ros.live.rmw_zenoh import MESSAGE_BYTES_MAX
from robochoc.ros.live.rmw_zenoh_keys import RosNode, ZenohTopic, attachment, sender
from robochoc.ros.live.rmw_zenoh_service import RmwZenohServices
from robochoc.ros.live.services import WAITING_MAX
from robochoc.ros.message_types import UnknownTypeError, types_of
from robochoc.ros.type_hashes import service_hash, type_hash
from tests.support.cases import looped
from tests.support.faults import running
from tests.support.limits import HANG_S, wait_until
from tests.support.program import PROGRAM, ROOT
from tests.support.slot_sketches import slots
from tests.support.zenoh_ros2 import FarEnd, Router

HANGAR = str(ROOT / "docs" / "examples" / "hangar")
SERVICE, CANCEL = "/robochoc/decide", "/robochoc/cancel"
SERVICES = {SERVICE: DECIDE, "/robochoc/hangar/decide": TRIGGER}
TRIGGER_HASH = "RIHS01_eeff2cd6fa5ad9d27cdf4dec64818317839b62f212a91e6b5304b634b2062c5f"
DECIDE_HASH = "RIHS01_5ed2d7a6bc492a40099e97f702a96a64693731dc44e8dc29ecd1fd53a3b2c74b"
DECIDE_KEY = f"0/robochoc/decide/robochoc_msgs::srv::dds_::Decide_/{DECIDE_HASH}"
DECIDE_SEEN = "@ros2_lv/0/*/*/*/SS/*/*/*/%robochoc%decide/**"
NOTHING = {"structure_needs_at_least_one_member": 0}
GID = bytes(range(16))

pytestmark = pytest.mark.usefixtures("no_ros_here")


@pytest.fixture
def offered(router: Router) -> Iterator[RmwZenohServices]:
    with RmwZenohServices(router.place, SERVICES, refusal) as offered:
        yield offered


@pytest.fixture
def session(router: Router) -> Iterator[zenoh.Session]:
    with zenoh.open(config({"mode": "client", "connect/endpoints": [f"tcp/{router.place}"]})) as session:
        yield session


class Asked:
    """A request of another session, and what comes of it."""

    def __init__(self, session: zenoh.Session, content: bytes | None, attached: bytes | None = None) -> None:
        self.answers: list[zenoh.Reply] = []
        self.is_over = False
        wait_until(lambda: bool([*session.liveliness().get(DECIDE_SEEN)]), "the router does not know the service")
        handler = zenoh.handlers.Callback(self.answers.append, drop=self._end, indirect=False)
        session.get(
            DECIDE_KEY,
            handler,
            target=zenoh.QueryTarget.ALL_COMPLETE,
            consolidation=zenoh.ConsolidationMode.NONE,
            timeout=HANG_S,
            payload=content,
            attachment=attached,
        )

    def _end(self) -> None:
        self.is_over = True

    def only_answer(self) -> zenoh.Reply:
        """Return the answer, when no other will come."""
        wait_until(lambda: self.is_over, "the query does not end")
        (answer,) = self.answers
        return answer

    def fields(self) -> tuple[dict[str, object], bytes]:
        """Return what was answered, and what went with it."""
        sample = self.only_answer().ok
        assert sample is not None
        assert sample.attachment is not None
        return types_of(2).decode(f"{DECIDE}_Response", sample.payload.to_bytes()), sample.attachment.to_bytes()


def request(team: str = "hangar") -> bytes:
    return types_of(2).encode(f"{DECIDE}_Request", {"team": team})


# Hashes, keys, tokens


def test_hashes_are_those_of_ros() -> None:
    """Both stand in the files that rosidl of Jazzy makes, for `std_srvs` and for `robochoc_msgs` in docs/ros2."""
    assert service_hash(TRIGGER) == TRIGGER_HASH
    assert service_hash(DECIDE) == DECIDE_HASH
    with pytest.raises(UnknownTypeError):
        service_hash("std_srvs/Explode")


def test_a_service_has_the_key_and_the_token_of_rmw_zenoh() -> None:
    service = ZenohTopic.for_topic("/robochoc/hangar/decide", TRIGGER, "RIHS01_10f3")
    assert service.key(7) == "7/robochoc/hangar/decide/std_srvs::srv::dds_::Trigger_/RIHS01_10f3"
    assert RosNode(7, "aac3178e146ba6f1fc6e6a4085e77f21").entity_token(3, "SS", service) == (
        "@ros2_lv/7/aac3178e146ba6f1fc6e6a4085e77f21/0/3/SS/%/%/robochoc_aac3178e/%robochoc%hangar%decide/"
        "std_srvs::srv::dds_::Trigger_/RIHS01_10f3/1:2:1,10:,:,:,,"
    )


@looped(
    ("attached", "known"),
    [
        (attachment(2, 5, GID), (2, GID)),
        (attachment(2, 5, GID)[:-1], None),
        (attachment(2, 5, GID) + b"x", None),
        (attachment(-1, 5, GID), None),
        (attachment(2, 5, GID)[:16] + b"\x0f" + GID, None),
        (b"", None),
    ],
)
def test_the_client_of_a_request(attached: bytes, known: object) -> None:
    assert sender(attached) == known


# An end that is not ours


def test_a_client_of_another_library_is_answered(offered: RmwZenohServices, end: FarEnd) -> None:
    end.begin(
        "call",
        service=SERVICE,
        kind="robochoc_msgs/srv/Decide",
        fields={"team": "hangar", "changes": "ü", "timeout": 2.5},
        timeout=HANG_S,
    )
    request = offered.next(HANG_S)
    assert request is not None
    assert (request.name, request.fields) == (SERVICE, {"team": "hangar", "changes": "ü", "timeout": 2.5})
    offered.reply(request, {"success": True, "message": "a", "variables": ["x"], "values": [-(1 << 40)]})
    name, answer = end.answer()
    assert (name, answer["success"], answer["variables"], answer["values"]) == (SERVICE, True, ["x"], [-(1 << 40)])
    end.begin("call", service="/robochoc/hangar/decide", kind="std_srvs/srv/Trigger", fields=NOTHING, timeout=HANG_S)
    request = offered.next(HANG_S)
    assert request is not None
    offered.reply(request, {"success": False, "message": "b", "verdict": "left out"})
    assert end.answer() == ["/robochoc/hangar/decide", {"success": False, "message": "b"}]


def test_others_see_the_services(offered: RmwZenohServices, end: FarEnd) -> None:
    assert offered.where.startswith("zenoh router at 127.0.0.1:")
    wanted = {SERVICE: ["robochoc_msgs/srv/Decide"], "/robochoc/hangar/decide": ["std_srvs/srv/Trigger"]}
    wait_until(lambda: dict(end.ask("services")) == wanted, "the services are not seen")
    offered.close()
    wait_until(lambda: not end.ask("services"), "the services are still there")


@pytest.mark.slow
def test_the_command_answers(router: Router, end: FarEnd) -> None:
    """The client asks before the service is there, again and again, as nodes do until they find it."""
    with ExitStack() as stack:
        words = [PROGRAM, "serve", HANGAR, "--ros", f"rmw_zenoh://{router.place}", "--requests", "2"]
        server = stack.enter_context(subprocess.Popen(words, stderr=subprocess.PIPE, text=True))
        stack.callback(server.kill)
        assert server.stderr is not None
        first = server.stderr.readline()
        wait_until(lambda: SERVICE in dict(end.ask("services")), "the service is not seen")
        wrong = {"team": "yard", "changes": "", "timeout": 0.0}
        end.begin("call", service=SERVICE, kind="robochoc_msgs/srv/Decide", fields=wrong, timeout=HANG_S)
        assert end.answer()[1]["message"] == "unknown team 'yard'; known teams: hangar"
        end.begin("call", service=CANCEL, kind="std_srvs/srv/Trigger", fields=NOTHING, timeout=HANG_S)
        assert end.answer() == [CANCEL, {"success": False, "message": "no team is deciding"}]
        name = "/robochoc/hangar/decide"
        end.begin("call", service=name, kind="std_srvs/srv/Trigger", fields=NOTHING, timeout=HANG_S)
        assert json.loads(end.answer()[1]["message"])["verdict"] == "solution"
        server.communicate(timeout=HANG_S)
        assert server.returncode == 0
    assert first == f"zenoh router at {router.place}: /robochoc/decide (robochoc_msgs/srv/Decide)\n"


# What goes wrong


def test_the_answer_names_the_request(offered: RmwZenohServices, session: zenoh.Session) -> None:
    asked = [Asked(session, request(), attachment(number, 5, GID)) for number in (7, 8)]
    taken = [offered.next(HANG_S) for _ in asked]
    for one in taken:
        assert one is not None
        offered.reply(one, {"success": True, "message": "a"})
    for number, client in zip((7, 8), asked, strict=True):
        fields, attached = client.fields()
        assert fields["success"] is True
        assert sender(attached) == (number, GID)


@pytest.mark.parametrize(
    ("content", "told"),
    [
        (b"", f"the request cannot be read as one of {DECIDE}"),
        (b"\xff" * 3, f"the request cannot be read as one of {DECIDE}"),
        (request()[:-2], f"the request cannot be read as one of {DECIDE}"),
        (b"\0\1\0\0\xff\xff\xff\xff", f"the request cannot be read as one of {DECIDE}"),
        (bytes(MESSAGE_BYTES_MAX + 1), "the request has 262,145 bytes; at most 262,144 are accepted"),
    ],
)
def test_what_is_no_request_is_refused(
    offered: RmwZenohServices, session: zenoh.Session, content: bytes, told: str
) -> None:
    fields, _ = Asked(session, content, attachment(1, 5, GID)).fields()
    assert (fields["success"], fields["message"]) == (False, told)
    assert offered.next(0.001) is None


@pytest.mark.parametrize(("content", "attached"), [(request(), None), (request(), b"x"), (None, attachment(1, 5, GID))])
def test_whoever_does_not_say_who_asks_gets_an_error(
    offered: RmwZenohServices, session: zenoh.Session, content: bytes | None, attached: bytes | None
) -> None:
    answer = Asked(session, content, attached).only_answer()
    assert answer.err is not None
    assert b"attachment" in answer.err.payload.to_bytes()
    assert offered.next(0.001) is None


def test_too_many_at_once_are_refused_and_the_end_is_told(offered: RmwZenohServices, session: zenoh.Session) -> None:
    asked = [Asked(session, request(), attachment(number, 5, GID)) for number in range(WAITING_MAX + 3)]
    wait_until(lambda: sum(one.is_over for one in asked) == 3, "they were not refused")
    offered.close()
    told = [str(one.fields()[0]["message"]) for one in asked]
    assert told.count("the service has ended") == WAITING_MAX
    assert told.count(f"{WAITING_MAX} requests are already waiting; try again later") == 3


def test_a_client_that_is_gone_does_no_harm(offered: RmwZenohServices, router: Router) -> None:
    with zenoh.open(config({"mode": "client", "connect/endpoints": [f"tcp/{router.place}"]})) as gone:
        Asked(gone, request(), attachment(1, 5, GID))
        taken = offered.next(HANG_S)
    assert taken is not None
    offered.reply(taken, {"success": True, "message": "nobody hears it"})
    assert offered.next(0.001) is None


def test_without_a_router() -> None:
    done = CliRunner().invoke(cli, ["serve", HANGAR, "--ros", "rmw_zenoh://127.0.0.1:1"], catch_exceptions=False)
    assert done.exit_code == 1
    assert "no zenoh router listens at 127.0.0.1:1" in done.stderr
    assert done.stderr.count("\n") == 1


def test_a_router_that_goes_away_ends_it(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(rmw_zenoh_session, "GONE_S", 0.0)
    with Router() as lost, RmwZenohServices(lost.place, SERVICES, refusal) as offered:
        lost.kill()
        told: list[str] = []

        def is_told() -> bool:
            try:
                offered.next(0.01)
            except SinkError as gone:
                told.append(str(gone))
            return bool(told)

        wait_until(is_told, "nobody says that the router is gone")
        assert "is lost" in told[0]


@pytest.mark.slow
@pytest.mark.parametrize("how", [signal.SIGKILL, signal.SIGTERM])
def test_nothing_is_left_of_a_server_that_is_killed(
    tmp_path: Path, session: zenoh.Session, router: Router, how: signal.Signals
) -> None:
    """It is killed while robots search, each in a process of its own; the client learns that no answer comes."""
    model_of(slots(14, 14)).save(tmp_path / "slots")
    place = f"rmw_zenoh://{router.place}"
    words = [
        PROGRAM,
        "serve",
        str(tmp_path / "slots"),
        "--protocol",
        "syncbb",
        "--runtime",
        "processes",
        "--ros",
        place,
    ]
    heard: list[str] = []
    key = f"0/robochoc/feedback/std_msgs::msg::dds_::String_/{type_hash('std_msgs/String')}"
    subscriber = session.declare_subscriber(key, lambda sample: heard.append(str(sample.key_expr)))
    with running([*words, "--feedback"], tmp_path) as run:
        wait_until(lambda: "/robochoc/cancel" in run.errors(), "it does not serve")
        asked = Asked(session, request(""), attachment(1, 5, GID))
        wait_until(lambda: bool(heard), "nobody decides")
        run.strike(how)
        run.end()
        assert run.left_behind() == []
        wait_until(lambda: asked.is_over, "the client still waits")
    subscriber.undeclare()  # type: ignore[no-untyped-call]  # zenoh's stubs
