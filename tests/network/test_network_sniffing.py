"""Sniffing a run across machines, with a real router: who may has all of it, who may not nothing, nobody waits."""

from __future__ import annotations

import json
import re
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from random import Random
from typing import Any

import pytest
import zenoh

from robochoc.communication.network import journal_server
from robochoc.communication.network.access import ALL, journal_key
from robochoc.communication.network.control_messages import JournalAnswer, JournalRequest
from robochoc.communication.network.framing import MASTER, Framing
from robochoc.communication.network.inbox import FrameArrived
from robochoc.communication.network.journal_server import MAX_ANSWERS_PER_S, Publication, piece_in, question
from robochoc.communication.network.router import Router
from robochoc.communication.network.settings import NetworkSettings
from robochoc.communication.network.transport import CannotConnectError
from robochoc.journal.blocks import BEGINNING, PREAMBLE, frame_block
from robochoc.model.outcome import Verdict
from robochoc.run.networked.address import Address
from robochoc.run.networked.directory_query import NoAnswerError
from robochoc.sniffer.remote import FollowResult, receive
from tests.support.limits import HANG_S
from tests.support.network_runs import NetworkRun

pytestmark = pytest.mark.more

BLOCK = 1000
FLOOD = 10 * MAX_ANSWERS_PER_S
HUGE = 200 * 60_000
WATCHED = 20
LEASE_MS = 3_600_000
"""Longer than all else: no link is given up because somebody is silent."""
GIVES_UP = "transport/link/tx/queue/congestion_control/block/wait_before_close"
"""How long zenoh waits, in microseconds, for who does not read; then it gives the link up."""
STOPS = """
import json, os, signal, sys, time
import zenoh
from robochoc.authority.identity import Identity, IdentityTexts
from robochoc.communication.network.access import journal_key
from robochoc.communication.network.transport import Transport
from robochoc.communication.network.journal_server import question

texts, endpoint, run = json.loads(sys.stdin.readline())
identity = Identity.from_texts(IdentityTexts(*map(str.encode, texts)))
transport = Transport(endpoint, identity, watch=(), lease_ms=3_600_000)
while not transport.ask(journal_key("Eye"), question(run, 0), 1):
    time.sleep(0.1)
waited_for = {"congestion_control": zenoh.CongestionControl.BLOCK, "priority": zenoh.Priority.REAL_TIME}
for _ in range(1000):
    transport._session.get(journal_key("Eye"), zenoh.handlers.RingChannel(1), payload=question(run, 0), **waited_for)
os.kill(os.getpid(), signal.SIGSTOP)
"""
PATIENCE_S = 2.0
"""The time in seconds after which an answer that does not come is asked for again, or given up."""


def blocks(count: int) -> list[bytes]:
    """The first `count` blocks of a journal; what they hold is nobody's concern here."""
    made, digest = [], BEGINNING
    for number in range(count):
        framing, digest = frame_block(Random(number).randbytes(BLOCK), digest)
        made.append(framing)
    return [PREAMBLE + made[0], *made[1:]]


BLOCKS = blocks(101)


def state_of(process: int) -> str:
    """The state of a process, as proc(5) has it."""
    return Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()[0]


class Ahead:
    """The time, which a test moves on."""

    sleep = staticmethod(time.sleep)

    def __init__(self) -> None:
        self.by_s = 0.0

    def monotonic(self) -> float:
        return time.monotonic() + self.by_s


class Sniffing:
    """Somebody follows `run` as `name`, in a thread."""

    def __init__(self, run: NetworkRun, name: str) -> None:
        self.content = bytearray()
        self.ending: FollowResult | None = None
        self.error: Exception | None = None
        self.granted = threading.Event()
        self._run = run
        self._name = name
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._follow)
        self._thread.start()

    def _follow(self) -> None:
        host, _, port = self._run.endpoint.rpartition(":")
        try:
            self.ending = receive(
                Address(host, int(port)),
                self._run.household.identity(self._name),
                self.content.extend,
                patience_s=HANG_S,
                stopped=self._stop.is_set,
                granted=self.granted.set,
            )
        except (NoAnswerError, CannotConnectError) as error:
            self.error = error

    def ended(self) -> FollowResult | Exception | None:
        """How it ended, as soon as it has."""
        self._run.wait_until(lambda: not self._thread.is_alive(), "it follows on")
        return self.ending or self.error

    def stop(self) -> None:
        self._stop.set()
        self._thread.join()


@pytest.fixture
def publication() -> Iterator[Publication]:
    with tempfile.TemporaryFile() as file:
        yield Publication(file.fileno())


@pytest.fixture(name="run")
def running(tmp_path: Path, publication: Publication, monkeypatch: pytest.MonkeyPatch) -> Iterator[NetworkRun]:
    """A team in the middle of its search, whose master gives its journal out; it comes to its right verdict.

    Its router never gives up who does not read: who waits for that, waits for ever.
    """
    given = Router._settings  # noqa: SLF001

    def for_ever(router: Router, *rules: Any) -> dict[str, object]:  # noqa: ANN401 - passed on
        return {**given(router, *rules), GIVES_UP: 1000 * LEASE_MS}

    monkeypatch.setattr(Router, "_settings", for_ever)
    settings = NetworkSettings(patience_s=HANG_S, lease_ms=LEASE_MS)
    with NetworkRun(tmp_path, settings=settings, publication=publication) as run:
        run.wait_for_progress()
        yield run
        if run.result is None:
            publication.close()
            assert run.let_go().verdict is Verdict.SOLUTION
    assert not run.losses
    assert all(not ending.failed for ending in run.endings.values()), run.endings


@pytest.fixture
def sniffing(run: NetworkRun) -> Iterator[Callable[[str], Sniffing]]:
    there: list[Sniffing] = []

    def begin(name: str) -> Sniffing:
        there.append(Sniffing(run, name))
        return there[-1]

    yield begin
    for one in there:
        one.stop()


def test_who_may_has_all_of_it_whenever_it_comes_and_who_may_not_nothing(
    run: NetworkRun, publication: Publication, sniffing: Callable[[str], Sniffing]
) -> None:
    run.household.enrol("Eye", sniffs=True)
    run.household.enrol("Spy")
    early = sniffing("Eye")
    assert early.granted.wait(HANG_S)
    whole, last = b"".join(BLOCKS[:-1]), BLOCKS[-1]
    for each in BLOCKS[:-1]:
        publication.write(each)
    run.wait_until(lambda: early.content == whole, "it has not got all")
    spy = sniffing("Spy").ended()
    assert re.search(r"does not allow Spy to sniff: .* by robochoc authority enrol Spy --may sniff", str(spy)), spy
    run.wait_for_refusal("Spy", "sniff", "it does not have the right")

    run.household.enrol("Late", sniffs=True)  # after a hundred blocks
    late = sniffing("Late")
    assert late.granted.wait(HANG_S)
    publication.write(last[:600])
    run.wait_until(lambda: late.content == whole, "it has not got all")
    publication.write(last[600:])
    publication.end()
    assert run.let_go().verdict is Verdict.SOLUTION
    for one in (early, late):
        assert one.ended() == FollowResult(over=True, why="the run is over")
        assert bytes(one.content) == whole + last


def test_the_router_lets_nobody_ask_who_may_not_or_in_anothers_name(run: NetworkRun, publication: Publication) -> None:
    publication.write(BLOCKS[0])
    run.household.enrol("Eye", sniffs=True)
    asked = question(run.master.run, 0)
    with run.transport("Eye") as eye:
        run.wait_until(lambda: bool(eye.ask(journal_key("Eye"), asked, PATIENCE_S)), "it gets no answer")
    with run.transport("RX0") as robot:
        for key in map(journal_key, ("RX0", "Eye", ALL)):

            def is_refused(key: str = key) -> bool:
                """A question yields to all that robots say, and may get lost; none is answered."""
                assert robot.ask(key, asked, PATIENCE_S) is None
                return ("RX0", f"query {key}") in {(one.who, one.what) for one in run.refusals}

            run.wait_until(is_refused, f"the question {key} is not refused")
        assert all(one.why.startswith("no rule of the Authority allows it") for one in run.refusals)
        # Nor does it get far by posing as the master.
        robot.answer(journal_key("Eye"), lambda _name, _content: b"forged")
        run.wait_for_refusal("RX0", "declare queryable rc/journal/Eye", "no rule")
    run.wait_for_progress()


def test_revoked_in_mid_run(
    run: NetworkRun, publication: Publication, sniffing: Callable[[str], Sniffing], monkeypatch: pytest.MonkeyPatch
) -> None:
    clock = Ahead()
    monkeypatch.setattr("robochoc.sniffer.remote.time", clock)
    run.household.enrol("Eye", sniffs=True)
    run.household.enrol("Ear", sniffs=True)
    eye, ear = sniffing("Eye"), sniffing("Ear")
    publication.write(BLOCKS[0])
    run.wait_until(lambda: eye.content == ear.content == BLOCKS[0], "they do not follow")
    run.household.revoke("Eye")
    run.household.enrol("Ear")  # which keeps its certificate, and loses the right
    for name in ("Eye", "Ear"):
        run.wait_for_refusal(name, "sniff|query|connect", "have the right|no rule|not registered")
    clock.by_s = 2 * HANG_S
    for one in (eye, ear):
        ending = one.ended()
        assert isinstance(ending, FollowResult)
        assert (ending.over, "to sniff any more" in ending.why) == (False, True), ending
        assert bytes(one.content) == BLOCKS[0]
    publication.write(BLOCKS[1])
    run.wait_for_progress()


def test_who_asks_without_end_and_reads_nothing(
    run: NetworkRun, publication: Publication, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(journal_server, "MAX_ANSWERS_PER_S", MAX_ANSWERS_PER_S // 10)  # a busy master answers slowly
    for each in BLOCKS:
        publication.write(each)
    run.household.enrol("Eye", sniffs=True)
    asked = question(run.master.run, 0)
    with run.transport("Eye") as eye:
        run.wait_until(lambda: bool(eye.ask(journal_key("Eye"), asked, PATIENCE_S)), "it gets no answer")
        for _ in range(FLOOD):
            eye._session.get(  # noqa: SLF001 - as no transport of ours would
                journal_key("Eye"), zenoh.handlers.RingChannel(1), payload=asked, timeout=PATIENCE_S
            )
        run.wait_for_refusal("Eye", "sniff", "questions a second")
        run.wait_for_progress()
        answers: list[bytes] = []

        def asked_again() -> bool:
            answers.append(eye.ask(journal_key("Eye"), question(run.master.run, len(BLOCKS[0])), PATIENCE_S) or b"")
            return bool(answers[-1])

        run.wait_until(asked_again, "it gets no answer any more")
        assert piece_in(answers[-1]).content.startswith(BLOCKS[1])


def test_one_that_asks_for_answers_that_are_waited_for_and_stops(run: NetworkRun, publication: Publication) -> None:
    """Otherwise the router would wait for it, and all robots for the router, until its connection is given up."""
    publication.write(bytes(HUGE))
    run.household.enrol("Eye", sniffs=True)
    texts = [text.decode() for text in run.household.identity("Eye").texts]
    with subprocess.Popen([sys.executable, "-c", STOPS], stdin=subprocess.PIPE) as eye:
        assert eye.stdin
        eye.stdin.write(json.dumps([texts, run.endpoint, run.master.run]).encode() + b"\n")
        eye.stdin.flush()
        try:
            run.wait_until(lambda: state_of(eye.pid) == "T", "it never stops")
            for _ in range(WATCHED):
                run.wait_for_progress()
            assert run.let_go().verdict is Verdict.SOLUTION  # and the master does not wait for it for long
        finally:
            eye.kill()


def test_a_master_that_gives_nothing_out(tmp_path: Path) -> None:
    with NetworkRun(tmp_path) as run:
        run.household.enrol("Eye", sniffs=True)
        eye = Sniffing(run, "Eye")
        assert "--sniffable" in str(eye.ended())
        run.wait_for_refusal("Eye", "sniff", "--sniffable")
        with run.transport("Eye") as transport:
            assert transport.ask(journal_key("Eye"), question(run.master.run, 0), PATIENCE_S) is None
            framing = Framing("Eye")
            for number in range(50):
                transport.send(MASTER, framing.write(MASTER, JournalRequest(number)))
            run.wait_for_refusal("Eye", "ask", "more than 20 requests a second")
            first = transport.inbox.get(timeout=HANG_S)
            assert isinstance(first, FrameArrived)
            assert isinstance(framing.read(MASTER, first.content).message, JournalAnswer)
        assert run.let_go().verdict is Verdict.SOLUTION
