"""What zenoh does by default, or without a word, and must not do to us."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections.abc import Iterator
from functools import partial
from pathlib import Path
from typing import NamedTuple

import pytest
import zenoh

from robochoc.authority.admission import InMemoryAuthority
from robochoc.communication.control import RobotFailed
from robochoc.communication.network.access import ALL, access_control
from robochoc.communication.network.framing import LARGEST_FRAME, MASTER, Framing, MessageTooLargeError
from robochoc.communication.network.inbox import FrameArrived, Item
from robochoc.communication.network.local import LocalNetwork
from robochoc.communication.network.members import NetworkMembers, RegistrationRefusedError
from robochoc.communication.network.profile import profile_of
from robochoc.communication.network.router import Router
from robochoc.communication.network.settings import LEASE_MS
from robochoc.communication.network.transport import Transport
from robochoc.communication.network.zenoh_config import RX_BYTES, config
from robochoc.generators.random_csp import random_csp
from robochoc.protocols.satisfaction.abt import ABT
from tests.support.cases import looped
from tests.support.leftovers import shared_by_tests
from tests.support.limits import HANG_S
from tests.support.ports import free_endpoint
from tests.support.program import ROOT

REACH = {"A": (ALL,), "B": (ALL,)}
LISTENS = "0A"
LOOPBACK = "0100007F"


@pytest.fixture(scope="module")
def household() -> InMemoryAuthority:
    return InMemoryAuthority(("A", "B"))


@pytest.fixture(scope="module")
def router(household: InMemoryAuthority) -> Iterator[Router]:
    opened = Router(free_endpoint(), household.master_identity(("127.0.0.1",)), None, LEASE_MS)
    opened.open(REACH)
    yield opened
    opened.close()


@pytest.fixture
def posts(household: InMemoryAuthority, router: Router) -> Iterator[tuple[Transport, Transport]]:
    join = partial(Transport, router.endpoint, watch=(), patience_s=HANG_S)
    with join(household.identity("A")) as a, join(household.identity("B")) as b:
        yield a, b


class DeadSession(NamedTuple):
    """A session with a dead link: its end is not confirmed, and zenoh says so after a while."""

    session: zenoh.Session

    def close(self) -> None:
        self.session.close()  # type: ignore[no-untyped-call]  # zenoh's stubs
        raise zenoh.ZError("close operation timed out!")


def test_a_dead_link_makes_no_end_of_a_session_fail(
    household: InMemoryAuthority, router: Router, monkeypatch: pytest.MonkeyPatch
) -> None:
    with Transport(router.endpoint, household.identity("A"), watch=(), patience_s=HANG_S) as transport:
        session = transport._session  # noqa: SLF001 - no link is dead at a time that a test could choose
        monkeypatch.setattr(transport, "_session", DeadSession(session))
    assert session.is_closed()


def frame(of: Transport) -> Item:
    return of.inbox.get(timeout=HANG_S)


# What is open


def open_sockets(process: int) -> tuple[set[str], set[str]]:
    """The addresses that a process listens on, and those of its sockets that take datagrams, from /proc."""
    links = []
    for descriptor in Path(f"/proc/{process}/fd").iterdir():
        try:
            links.append(str(descriptor.readlink()))
        except FileNotFoundError:
            continue
    own = {link[8:-1] for link in links if link.startswith("socket:[")}

    def rows(table: str) -> list[list[str]]:
        lines = Path(f"/proc/{process}/net/{table}").read_text().splitlines()[1:]
        return [row for row in map(str.split, lines) if row[9] in own]

    listening = {row[1] for table in ("tcp", "tcp6") for row in rows(table) if row[3] == LISTENS}
    return listening, {row[1] for table in ("udp", "udp6") for row in rows(table)}


@pytest.mark.skipif(sys.platform != "linux", reason="looks into /proc")
def test_nothing_listens_but_the_router_and_nothing_looks_for_others() -> None:
    with LocalNetwork(random_csp(3, 2, 1.0, 0.3, 1, connected=True), ABT) as session:
        session.search(HANG_S)
        port = int(session.master.endpoint.rpartition(":")[2])
        robots = [process.pid for process in session.processes.values()]
        process = session.master._policy._router._process  # noqa: SLF001
        assert process
        before = open_sockets(os.getpid())
        assert open_sockets(process.pid) == ({f"{LOOPBACK}:{port:04X}"}, set())
        assert len(robots) == 3
        for robot in robots:
            assert robot
            assert open_sockets(robot) == (set(), set())
    assert open_sockets(os.getpid()) == before, "the master's own session listens nowhere"


def test_the_router_is_ours_whatever_is_in_the_working_directory(
    household: InMemoryAuthority, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """It is given the master's key."""
    (tmp_path / "zenoh.py").write_text("raise SystemExit('not ours')")
    monkeypatch.chdir(tmp_path)
    opened = Router(free_endpoint(), household.master_identity(("127.0.0.1",)), None, LEASE_MS)
    opened.open(REACH)
    opened.close()


# What is dropped without a word


def test_frames_wait_for_a_receiver_that_does_not_look(posts: tuple[Transport, Transport]) -> None:
    sender, receiver = posts
    sent = [FrameArrived("A", number.to_bytes(2) * 200) for number in range(5_000)]
    sender.send("B", b"first")
    assert frame(receiver) == FrameArrived("A", b"first"), "from now on the router knows that B hears A"
    for each in sent:
        sender.send("B", each.content)
    assert [frame(receiver) for _ in sent] == sent


def test_the_largest_frame_arrives(posts: tuple[Transport, Transport]) -> None:
    sender, receiver = posts
    content = os.urandom(LARGEST_FRAME)
    sender.send("B", content)
    assert frame(receiver) == FrameArrived("A", content)


def test_a_larger_one_is_refused_before_it_is_sent() -> None:
    assert RX_BYTES > LARGEST_FRAME
    framing = Framing("A", "run")
    with pytest.raises(
        MessageTooLargeError, match=r"a message of A to MASTER has 8,388,\d+ bytes, more than 8,388,608"
    ):
        framing.write(MASTER, RobotFailed("x" * LARGEST_FRAME))
    assert framing.next_number(MASTER) == 1, "what was not sent leaves no gap"


def test_what_was_sent_in_an_outage_arrives_without_a_heartbeat(
    router: Router, posts: tuple[Transport, Transport], monkeypatch: pytest.MonkeyPatch
) -> None:
    """The receiver asks for it as it sees the sender again. So heartbeats, which cost much, can be rare."""
    monkeypatch.setattr("robochoc.communication.network.transport.HEARTBEAT_S", 3600)
    sender, receiver = posts
    sender.send("B", b"before")
    assert frame(receiver) == FrameArrived("A", b"before")
    router.close()
    sent = [FrameArrived("A", number.to_bytes(2)) for number in range(50)]
    for each in sent:
        sender.send("B", each.content)
    with shared_by_tests():
        router.open(REACH)
    assert [frame(receiver) for _ in sent] == sent


# What hangs


@pytest.mark.more
def test_a_program_forks_after_a_network_run_runs_another_and_ends() -> None:
    command = [sys.executable, "-m", "tests.support.zenoh_program"]
    with subprocess.Popen(command, cwd=ROOT, stdout=subprocess.PIPE, text=True) as program:
        assert program.stdout
        said = [program.stdout.readline().strip() for _ in range(4)]
        assert program.wait(HANG_S) == 0
    assert said == ["solution"] * 3 + ["closed"]


def test_sessions_open_and_close_at_once(household: InMemoryAuthority, router: Router) -> None:
    for _ in range(5):
        with Transport(router.endpoint, household.identity("A"), watch=(), patience_s=HANG_S) as one:
            one.send("B", b"hello")


def test_a_router_that_may_not_look_for_others_does_not_wait_for_them() -> None:
    """By default it waits for half a second, and all robots with it."""
    delay = json.loads(config({"mode": "router"}).get_json("scouting/delay"))
    assert delay == 0


# What is more than a name


@looped("name", ["*", "**", "A*", "A/B", "$*", "@adv", "A#", "A?b", "", "MASTER"])
def test_what_is_no_part_of_a_key_is_no_name(name: str) -> None:
    with pytest.raises(ValueError, match="is not a valid name of a robot on a network"):
        access_control({"A": (), name: ()})


def test_a_profile_names_nobody_who_is_no_part_of_a_key() -> None:
    profile = profile_of(random_csp(3, 2, 1.0, 0.3, 1, connected=True).robots[0])
    bad = type(profile)(
        profile.name, profile.kind, ("*",), (), profile.variables, {}, profile.weight, profile.max_cost, ()
    )
    with pytest.raises(RegistrationRefusedError, match=r"'\*' is not a valid name"):
        NetworkMembers().register(profile.name, bad, "incarnation")
