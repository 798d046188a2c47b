"""`robochoc serve`: others ask over DDS, and teams decide; whatever is asked is answered."""

from __future__ import annotations

import json
import re
import shutil
import signal
import subprocess
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from random import Random
from typing import Any

import pytest
from click.testing import CliRunner

from robochoc.cli.group import cli
from robochoc.formats.result import read_result
from robochoc.model.outcome import Outcome
from robochoc.model.problem import Team
from robochoc.robots.sink import Fields, SinkError
from robochoc.ros.decide_service import CHANGES_CHARACTERS_MAX, DECIDE, TRIGGER, DecideService, refusal
from robochoc.ros.live import dds_service
from robochoc.ros.live.dds_service import DdsServices
from robochoc.ros.live.services import WAITING_MAX
from robochoc.ros.message_types import FieldsError, types_of
from robochoc.run import Options, Runtime, solve
from tests.support.cases import looped
from tests.support.dds import LOOPBACK_ALONE, ServiceClient, free_domain, subscriber
from tests.support.example_teams import example, hangar
from tests.support.limits import HANG_S, wait_until
from tests.support.program import PROGRAM, ROOT
from tests.support.small_teams import pair

EXAMPLES = ROOT / "docs" / "examples"
SIMULATED = Options(runtime=Runtime.SIMULATOR, timeout=HANG_S)
SERVICE = "/robochoc/decide"
GUID = 0x0102030405060708


def service(*teams: Team, options: Options = SIMULATED) -> DecideService:
    return DecideService(teams, solve, options)


def removals(kind: str, *removed: object) -> str:
    """Changes of one kind, as JSON."""
    return json.dumps([{kind: one} for one in removed])


# What is asked, and what is answered


def test_a_team_decides() -> None:
    answer = service(hangar()).decide({"team": "hangar"})
    expected = solve(hangar(), SIMULATED)
    assert (answer["success"], answer["verdict"], answer["message"]) == (True, "solution", "solution, 1 epoch")
    assert dict(zip(answer["variables"], answer["values"], strict=True)) == expected.assignment
    assert read_result(answer["result"].encode()).assignment == expected.assignment
    assert service(hangar()).decide({}) | {"result": ""} == answer | {"result": ""}
    back = types_of(2).decode(f"{DECIDE}_Response", types_of(2).encode(f"{DECIDE}_Response", answer))
    assert back == answer


def test_a_scenario_is_gone_through() -> None:
    answer = service(example("rescue")).decide({})
    epochs = len(solve(example("rescue"), SIMULATED).epochs)
    assert epochs > 1
    assert answer["message"].endswith(f"{epochs} epochs")
    assert len(json.loads(answer["result"])["epochs"]) == epochs


def test_changes_are_made_first() -> None:
    changes = [{"remove_value": {"variable": "port", "value": 3}}, {"remove_agent": {"name": "Nose"}}]
    answer = service(hangar()).decide({"team": "hangar", "changes": json.dumps(changes)})
    values = dict(zip(answer["variables"], answer["values"], strict=True))
    assert "nose" not in values
    assert values["port"] != 3
    more = [*changes, {"add_value": {"variable": "port", "value": 3}}]
    assert service(hangar()).decide({"changes": json.dumps(more)})["success"]
    assert "nose" in service(hangar()).decide({})["variables"], "a request leaves the team as it was"


def test_no_solution_is_an_answer() -> None:
    answer = service(pair(values=1)).decide({})
    assert (answer["success"], answer["verdict"], answer["variables"]) == (False, "no-solution", [])
    assert service(pair(values=1)).trigger("pair")["success"] is False


def test_a_trigger_tells_the_assignment() -> None:
    answer = service(hangar(), example("rescue")).trigger("hangar")
    told = json.loads(answer["message"])
    assert (answer["success"], told["verdict"]) == (True, "solution")
    assert told["assignment"] == solve(hangar(), SIMULATED).assignment


@looped(
    ("fields", "told"),
    lambda: [
        ({"team": "yard\x1b"}, r"unknown team 'yard\\x1b'; known teams: hangar, rescue"),
        ({}, r"unknown team ''; known teams: hangar, rescue"),
        ({"timeout": -1.0}, "timeout is -1.0: it must be seconds, or 0 for the longest time"),
        ({"timeout": float("nan")}, "it must be seconds"),
        ({"timeout": float("inf")}, "it must be seconds"),
        ({"changes": "{"}, "changes: "),
        ({"changes": "[" * 20_000}, "changes"),
        ({"changes": '"x"'}, "changes: "),
        ({"changes": '[{"remove_value": {"variable": "port"}}]'}, "changes: "),
        ({"changes": '[{"remove_value": {"variable": "port", "value": 1e99}}]'}, "changes: "),
        ({"changes": '[{"explode": {"name": "Fin"}}]'}, "changes: .*explode"),
        ({"changes": "[{}]"}, "change 1 must be one of remove_value, add_value and remove_agent"),
        ({"changes": '[{"remove_agent": {"name": "a"}, "add_value": {"variable": "b", "value": 1}}]'}, "change 1 must"),
        ({"changes": '[{"remove_agent": {"name": "Stern"}}]'}, "Stern"),
        ({"changes": '[{"add_value": {"variable": "port", "value": 3}}]'}, "port"),
        ({"changes": removals("remove_agent", *({"name": robot.name} for robot in hangar().robots))}, "^team hangar: "),
        (
            {"changes": removals("remove_value", *({"variable": "port", "value": value} for value in range(1, 5)))},
            "^robot Port, domain levels: .* has no value",
        ),
        (
            {"changes": " " * CHANGES_CHARACTERS_MAX + "[]"},
            "changes have 65,538 characters: at most 65,536 are accepted",
        ),
        (
            {"changes": json.dumps([{"remove_agent": {"name": "a"}}] * 1001)},
            "there are 1,001 changes: at most 1,000",
        ),
    ],
)
def test_what_is_wrong_with_a_request_is_answered(fields: dict[str, Any], told: str) -> None:
    named = fields if "team" in fields or not fields else {"team": "hangar", **fields}
    answer = service(hangar(), example("rescue")).decide(named)
    assert answer["success"] is False
    assert not {"verdict", "values"} & answer.keys()
    assert "\n" not in answer["message"]
    assert re.search(told, answer["message"]), answer["message"]


def test_whatever_fails_is_answered() -> None:
    def failing(team: Team, options: Options) -> Outcome:
        raise RuntimeError(f"{team.name} {options.timeout}")

    answer = DecideService([hangar()], failing, SIMULATED).decide({"timeout": 3.0})
    assert answer == {"success": False, "message": "RuntimeError: hangar 3.0"}
    longer = DecideService([hangar()], failing, SIMULATED).decide({"timeout": 1e9})
    assert longer["message"] == f"RuntimeError: hangar {HANG_S}"


# Over DDS


@pytest.fixture(autouse=True)
def _loopback(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("CYCLONEDDS_URI", LOOPBACK_ALONE)
    monkeypatch.delenv("ROS_DOMAIN_ID", raising=False)
    for name in ("MATCH_S", "END_S"):  # a busy machine takes its time
        monkeypatch.setattr(dds_service, name, HANG_S)


@pytest.fixture
def offered(monkeypatch: pytest.MonkeyPatch) -> Iterator[DdsServices]:
    monkeypatch.setattr(dds_service, "END_S", 0.0)  # clients are killed
    kinds = {SERVICE: DECIDE, "/robochoc/hangar/decide": TRIGGER}
    with DdsServices(str(free_domain()), kinds, refusal) as offered:
        yield offered


def test_a_client_is_answered_with_its_own_number(offered: DdsServices) -> None:
    with ServiceClient(offered.domain, {SERVICE: "Decide", "/robochoc/hangar/decide": "Trigger"}) as client:
        for number in (1, 2):
            client.begin(SERVICE, {"team": "hangar", "changes": "ü", "timeout": 2.5})
            request = offered.next(HANG_S)
            assert request is not None
            assert (request.name, request.fields) == (SERVICE, {"team": "hangar", "changes": "ü", "timeout": 2.5})
            offered.reply(
                request, {"success": True, "message": "a", "variables": ["x", "y"], "values": [1, -(1 << 40)]}
            )
            answer = client.heard()
            assert (answer["guid"], answer["seq"]) == (GUID, number)
            assert (answer["variables"], answer["values"], answer["verdict"]) == (["x", "y"], [1, -(1 << 40)], "")
        client.begin("/robochoc/hangar/decide", {})
        request = offered.next(HANG_S)
        assert request is not None
        offered.reply(request, {"success": False, "message": "b"})
        assert client.heard() == {"guid": GUID, "seq": 1, "success": False, "message": "b"}


@pytest.mark.more
def test_a_service_at_once_does_not_wait_for_its_turn(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(dds_service, "END_S", 0.0)  # clients are killed
    kinds = {SERVICE: DECIDE, "/robochoc/cancel": TRIGGER}
    at_once = {"/robochoc/cancel": lambda _: refusal("nothing")}
    with (
        DdsServices(str(free_domain()), kinds, refusal, at_once) as offered,
        ServiceClient(offered.domain, {SERVICE: "Decide", "/robochoc/cancel": "Trigger"}) as client,
    ):
        client.begin(SERVICE, {"team": "hangar"})
        request = offered.next(HANG_S)
        assert request is not None
        client.begin("/robochoc/cancel", {})
        offered.reply(request, {"success": True, "message": "a"})
        assert client.heard()["message"] == "a", "the client waits for one answer after the other"
        assert client.heard()["message"] == "nothing"
        assert offered.next(0.001) is None


@pytest.mark.more
def test_feedback_is_published(offered: DdsServices) -> None:
    with subscriber(offered.domain, {"/robochoc/feedback": "String"}) as peer:
        offered.announce("/robochoc/feedback", "std_msgs/String")
        wait_until(lambda: offered._participant.subscribers(["/robochoc/feedback"]) == [1], "nobody listens")  # noqa: SLF001
        offered.publish("/robochoc/feedback", "std_msgs/String", {"data": "{}"})
        assert "{}" in str(peer.heard())


@pytest.mark.parametrize("raw", ["", "ff", "ffffffff61626364", "00000000" * 5, "05000000616200"])
def test_bytes_that_are_no_request_are_answered(
    offered: DdsServices, monkeypatch: pytest.MonkeyPatch, raw: str
) -> None:
    """Cyclone DDS does not let most of them pass; whoever it lets pass is told."""
    told: list[bytes] = []
    monkeypatch.setattr(offered._ends[SERVICE], "write", told.append)  # noqa: SLF001 - what would be sent
    header = bytes(range(16))
    offered._receive(SERVICE, DECIDE, b"\0\1\0\0" + header + bytes.fromhex(raw))  # noqa: SLF001 - called by a thread of its own
    assert offered.next(0.001) is None
    (content,) = told
    assert content[4:20] == header
    fields = types_of(2).decode(f"{DECIDE}_Response", content[:4] + content[20:])
    assert (fields["success"], fields["message"]) == (False, f"the request cannot be read as one of {DECIDE}")


@pytest.mark.parametrize(
    "content", [b"", b"\0\1", b"\0\1\0\0" + b"x" * 15, b"\7\7\0\0" + b"x" * 40, b"\0\1\0\0" * 70_000]
)
def test_bytes_without_a_client_are_passed_over(
    offered: DdsServices, monkeypatch: pytest.MonkeyPatch, content: bytes
) -> None:
    told: list[bytes] = []
    monkeypatch.setattr(offered._ends[SERVICE], "write", told.append)  # noqa: SLF001 - what would be sent
    offered._receive(SERVICE, DECIDE, content)  # noqa: SLF001 - called by a thread of its own
    assert (offered.next(0.001), told) == (None, [])


def test_too_many_at_once_are_refused_and_the_end_is_told(
    offered: DdsServices, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Nobody takes a request: so many wait, the others are refused at once, and those that wait when it ends."""
    asked = WAITING_MAX + 3
    told: list[str] = []
    with ServiceClient(offered.domain, {SERVICE: "Decide"}) as client:
        write = offered._write  # noqa: SLF001 - what is sent is counted

        def counted(name: str, header: bytes, fields: Fields) -> None:
            told.append(str(fields["message"]))
            write(name, header, fields)

        offered._write = counted  # type: ignore[method-assign]  # noqa: SLF001 - see above
        client.begin("", asked)
        wait_until(lambda: len(told) == asked - WAITING_MAX, "they were not refused")
        monkeypatch.setattr(dds_service, "END_S", HANG_S)
        offered.close()
        answers = client.heard()
    assert sorted(answer["seq"] for answer in answers) == [*range(1, asked + 1)]
    assert sorted(answer["message"] for answer in answers) == sorted(told)
    assert told.count("the service has ended") == WAITING_MAX
    assert told.count(f"{WAITING_MAX} requests are already waiting; try again later") == 3


@looped("place", ["x", "233", "5?wait=1", "5?reliability=reliable", "5?partition="])
def test_places_that_are_none(place: str) -> None:
    with pytest.raises(SinkError):
        DdsServices(place, {SERVICE: DECIDE}, refusal)


# The command


def served(domain: int, *words: str) -> subprocess.Popen[str]:
    return subprocess.Popen(
        [PROGRAM, "serve", str(EXAMPLES / "hangar"), "--ros", f"dds:{domain}", *words],
        stderr=subprocess.PIPE,
        text=True,
    )


@pytest.mark.more
def test_the_command_answers() -> None:
    domain = free_domain()
    with _asks_at_once(domain) as client:
        words = ["serve", str(EXAMPLES / "hangar"), "--ros", f"dds:{domain}", "--requests", "1"]
        done = CliRunner().invoke(cli, words, catch_exceptions=False)
        assert (done.exit_code, done.stderr.splitlines()[-1]) == (0, "/robochoc/decide: solution, 1 epoch")
        assert client.heard() == "ready"
        assert client.heard()["verdict"] == "solution"


@contextmanager
def _asks_at_once(domain: int) -> Iterator[ServiceClient]:
    """A client that asks as soon as it has found the service."""
    client = ServiceClient(domain, {SERVICE: "Decide"})
    client.begin(SERVICE, {"team": "hangar"})
    try:
        yield client
    finally:
        client.__exit__(None, None, None)


@pytest.mark.slow
def test_the_command_answers_whoever_asks() -> None:
    domain = free_domain()
    expected = solve(hangar(), SIMULATED).assignment
    with (
        served(domain, "--requests", "3") as server,
        ServiceClient(domain, {SERVICE: "Decide", "/robochoc/hangar/decide": "Trigger"}) as client,
    ):
        first = client.ask(SERVICE, team="hangar")
        assert dict(zip(first["variables"], first["values"], strict=True)) == expected
        assert client.ask(SERVICE, team="yard")["message"] == "unknown team 'yard'; known teams: hangar"
        assert json.loads(client.ask("/robochoc/hangar/decide")["message"])["assignment"] == expected
        _, told = server.communicate(timeout=HANG_S)
        assert server.returncode == 0
    lines = told.splitlines()
    assert lines[0] == f"domain {domain} of DDS: /robochoc/decide (robochoc_msgs/srv/Decide)"
    assert lines[1] == f"domain {domain} of DDS: /robochoc/hangar/decide (std_srvs/srv/Trigger)"
    assert lines[2] == f"domain {domain} of DDS: /robochoc/cancel (std_srvs/srv/Trigger)"
    assert lines[3] == "/robochoc/decide: solution, 1 epoch"
    assert len(lines) == 6


@pytest.mark.slow
@pytest.mark.parametrize(("how", "status"), [(signal.SIGINT, 130), (signal.SIGTERM, 143)])
def test_a_signal_ends_it(how: signal.Signals, status: int) -> None:
    with served(free_domain()) as server:
        assert server.stderr is not None
        assert "/robochoc/decide" in server.stderr.readline()
        assert "/robochoc/hangar/decide" in server.stderr.readline()
        server.send_signal(how)
        _, told = server.communicate(timeout=HANG_S)
    assert "Traceback" not in told
    assert server.returncode in {status, -how}


@looped(
    ("words", "told"),
    [
        (["--ros", "rospy"], "--ros rospy: unknown middleware; use dds, "),
        (["--ros", "dds:x"], "'x' is not a DDS domain"),
        (["--timeout", "0"], "--timeout"),
    ],
)
def test_wrong_usage_is_told(words: list[str], told: str) -> None:
    done = CliRunner().invoke(cli, ["serve", str(EXAMPLES / "hangar"), *words], catch_exceptions=False)
    assert done.exit_code != 0
    assert told in done.stderr


def test_two_teams_of_one_name_are_refused(tmp_path: Path) -> None:
    shutil.copytree(EXAMPLES / "hangar", tmp_path / "hangar")
    words = ["serve", str(EXAMPLES / "hangar"), str(tmp_path / "hangar")]
    done = CliRunner().invoke(cli, words, catch_exceptions=False)
    assert done.exit_code == 2
    assert "two teams have the name 'hangar': rename the folder of one of them" in done.stderr


def test_whatever_bytes_a_request_has_it_is_answered() -> None:
    """Bytes of whole requests, spoiled: whatever can be decoded is answered, and whatever is answered can be sent."""
    chance = Random(7)
    changes = '[{"remove_value": {"variable": "port", "value": 3}}, {"remove_agent": {"name": "Nose"}}]'
    whole = types_of(2).encode(f"{DECIDE}_Request", {"team": "hangar", "changes": changes, "timeout": 5.0})
    decided = solve(pair(values=3), SIMULATED)
    decider = DecideService([hangar()], lambda *_: decided, SIMULATED)
    answered = 0
    for _ in range(2_000):
        content = bytearray(whole)
        for _ in range(chance.randint(1, 4)):
            content[chance.randrange(4, len(content))] = chance.randrange(256)
        try:
            fields = types_of(2).decode(f"{DECIDE}_Request", bytes(content))
        except FieldsError:
            continue
        assert types_of(2).encode(f"{DECIDE}_Response", decider.decide(fields))
        answered += 1
    assert answered > 300
