"""What the router's log tells of refusals. The lines are a real router's; identifiers are shortened."""

from __future__ import annotations

import os
import signal
import socket
from collections.abc import Iterator
from contextlib import closing
from itertools import pairwise
from typing import IO

import pytest
from hypothesis import given
from hypothesis import strategies as st

from robochoc.authority.admission import InMemoryAuthority
from robochoc.communication.network import router
from robochoc.communication.network.router import Log, Refusal, Router
from tests.support.cases import looped
from tests.support.examples import examples
from tests.support.limits import wait_until
from tests.support.ports import free_endpoint

NO_RULE = "no rule of the Authority allows it"
ACCESS = "rx-0 ThreadId(07) zenoh::net::routing::interceptor::access_control:"
TLS = "acc-0 ThreadId(04) zenoh_link_tls::unicast:"
HINT = "Hint: increase the system open file limit."
WHO = "70be on Interface(lo)+CertCommonName(A)+Transport(Tls)+70be"
LINES = [
    f"2026-11-22T01:07:52.349264Z TRACE {ACCESS} ACL (ingress): caching permissions for `rc/msg/A` ...",
    f"2026-11-22T01:07:52.349305Z TRACE {ACCESS} {WHO} is unauthorized to Put (ingress) on rc/msg/A",
    f"2026-11-22T01:07:52.349307Z TRACE {ACCESS} {WHO} is unauthorized to Delete (ingress) on rc/msg/A",
    f"2026-11-22T01:07:52.349317Z TRACE {ACCESS} {WHO} is unauthorized to Declare/Undeclare Queryable (ingress) on rc",
    f"2026-11-22T01:07:52.349347Z TRACE {ACCESS} {WHO} is unauthorized to Put (egress) on rc/msg/A",
    f"2026-11-22T01:07:52.349708Z TRACE {ACCESS} {WHO} is authorized to Declare Subscriber (ingress) on rc/msg/A/*",
    f"2026-11-22T01:07:52.351244Z TRACE {ACCESS} {WHO} is unauthorized to Put (ingress) on rc/msg/MASTER/B",
    "2026-11-22T01:07:52.351246Z TRACE rx-0 ThreadId(07) zenoh::net::routing::interceptor: Msg intercepted!",
    f"2026-11-22T01:07:52.351709Z TRACE {ACCESS} {WHO} is unauthorized to Declare Subscriber (ingress) on rc/msg/B/*",
    "2026-11-22T01:07:52.351711Z TRACE rx-0 ThreadId(07) zenoh::net::routing::interceptor: Msg intercepted!",
    f"2026-11-22T01:07:53.352165Z TRACE {ACCESS} {WHO} is unauthorized to Query (ingress) on rc/msg/B/MASTER/@adv/**",
    "2026-11-22T01:07:53.352170Z TRACE rx-0 ThreadId(07) zenoh::net::routing::interceptor: Msg intercepted!",
    f"2026-11-22T01:07:53.352180Z TRACE {ACCESS} {WHO} is unauthorized to Liveliness Token (egress) on rc/live/B",
    "2026-11-22T01:07:53.352181Z TRACE rx-0 ThreadId(07) zenoh::net::routing::interceptor: Msg intercepted!",
    f"2026-11-22T01:07:55.860152Z  WARN {TLS} received corrupt message of type InvalidContentType. {HINT}",
    f"2026-11-22T01:07:56.000001Z  WARN {TLS} received fatal alert: UnknownCA. {HINT}",
    f"2026-11-22T01:25:44.147756Z  WARN {TLS} invalid peer certificate: UnknownIssuer. {HINT}",
    f"2026-11-22T01:25:44.739202Z  WARN {TLS} peer sent no certificates. {HINT}",
]
LOG = "".join(f"{line}\n" for line in LINES).encode()
TOLD = [
    Refusal("A", "put rc/msg/MASTER/B", NO_RULE),
    Refusal("A", "declare subscriber rc/msg/B/*", NO_RULE),
    Refusal("A", "query rc/msg/B/MASTER/@adv/**", NO_RULE),
    Refusal("somebody", "connect", "it does not speak TLS"),
    Refusal("somebody", "connect", "it does not trust the master, which its Authority has not certified"),
    Refusal("somebody", "connect", "its certificate was not issued by this Authority"),
    Refusal("somebody", "connect", "it has sent no certificate"),
]
ALONE = dict(zip(range(14, 18), TOLD[3:], strict=True))
"""What lines tell that need no other."""
IDENTITY = InMemoryAuthority([]).master_identity(("127.0.0.1",))


def refusals(log: bytes) -> Iterator[Refusal]:
    return Log({"A", "MASTER"}).refusals(log)


def read_in(pieces: list[bytes]) -> list[Refusal]:
    """What is told of a log that comes in these pieces, each at once."""
    told: list[Refusal] = []
    inward, outward = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    with inward, outward, os.fdopen(os.dup(inward.fileno()), "rb") as output:
        for piece in pieces:
            outward.send(piece)
        outward.shutdown(socket.SHUT_WR)
        Router("127.0.0.1:1", IDENTITY, told.append, 1000)._read(output, Log({"A": ()}), b"")  # noqa: SLF001 - without a process
    return told


def test_refusals_are_what_was_intercepted_coming_in() -> None:
    assert list(refusals(LOG)) == TOLD


@given(first=st.lists(st.booleans(), min_size=2 * len(LINES), max_size=2 * len(LINES)))
def test_the_lines_of_two_threads_come_mixed(first: list[bool]) -> None:
    """What another thread writes between the two lines of a refusal takes nothing away from it."""
    one, other = list(LINES), [line.replace("ThreadId(07)", "ThreadId(08)") for line in LINES]
    mixed = [(one if (ours and one) or not other else other).pop(0) for ours in first]
    told = list(refusals("".join(f"{line}\n" for line in mixed).encode()))
    assert sorted(told) == sorted(TOLD * 2)


@looped("line", range(len(LINES)))
def test_a_line_alone_says_no_more_than_it_can(line: int) -> None:
    told = list(refusals(f"{LINES[line]}\n".encode()))
    assert told == ([ALONE[line]] if line in ALONE else [])


def test_what_the_router_looks_up_again_is_told_of_those_who_have_rules() -> None:
    log = Log({"A"})
    intercepted = LINES[7]

    def told(*lines: str) -> list[Refusal]:
        return list(log.refusals("".join(f"{line}\n" for line in lines).encode()))

    assert told(LINES[6], intercepted) == TOLD[:1]
    cached = (
        f"{LINES[6][:28]}TRACE {ACCESS} Using cached result: 70be is unauthorized to Put (ingress) on rc/msg/MASTER/B"
    )
    assert told(cached, intercepted) == TOLD[:1]
    assert told(cached.replace("70be", "cd34"), intercepted) == []


def test_who_connects_without_rules_is_told() -> None:
    accepted = "DEBUG acc-0 zenoh_link_tls::unicast: Accepted TLS connection on 1: 2. Common Name: {}.\n"
    log = "".join(accepted.format(name) for name in ("A", "MASTER", "B")).encode()
    assert [refusal.who for refusal in refusals(log)] == ["B"]


def test_a_large_log_is_read() -> None:
    assert sum(1 for _ in refusals(LOG * 3_000)) == 3_000 * len(TOLD)


def test_colours_do_not_matter() -> None:
    coloured = (
        LOG.replace(b"TRACE", b"\x1b[35mTRACE\x1b[0m")
        .replace(b" zenoh", b" \x1b[2mzenoh")
        .replace(b"r: ", b"r\x1b[0m: ")
    )
    assert list(refusals(coloured.replace(b"\x1b[2mzenoh_link", b"zenoh_link"))) == TOLD


@given(content=st.binary(max_size=300) | st.lists(st.sampled_from(LINES)).map(lambda lines: "\n".join(lines).encode()))
@examples(60)
def test_any_bytes_can_be_looked_at(content: bytes) -> None:
    assert all(refusal.what for refusal in refusals(content))


def test_names_that_are_no_text_are_shown_all_the_same() -> None:
    log = "\n".join(LINES[6:8]).encode() + b"\n"
    (told,) = refusals(log.replace(b"Name(A)", b"Name(\xff)").replace(b"MASTER/B", b"\xfe\xff"))
    assert told == Refusal("\ufffd", "put rc/msg/\ufffd\ufffd", NO_RULE)


def test_the_log_in_one_piece() -> None:
    assert sorted(read_in([LOG])) == sorted(TOLD)


@given(cuts=st.lists(st.integers(1, len(LOG) - 1), max_size=12))
@examples(60)
def test_any_split_tells_the_same(cuts: list[int]) -> None:
    places = [0, *sorted(set(cuts)), len(LOG)]
    pieces = [LOG[start:end] for start, end in pairwise(places)]
    assert sorted(read_in(pieces)) == sorted(TOLD)


def test_every_single_cut_tells_the_same() -> None:
    short = "".join(f"{line}\n" for line in LINES[5:9]).encode()
    expected = list(refusals(short))
    assert len(expected) == 1
    for cut in range(1, len(short)):
        assert read_in([short[:cut], short[cut:]]) == expected


def test_line_by_line_tells_the_same() -> None:
    assert read_in(LOG.splitlines(keepends=True)) == TOLD


def test_a_router_that_no_longer_responds_is_killed() -> None:
    """It would be waited for otherwise, by robots and master."""
    stopped = Router(free_endpoint(), IDENTITY, None, 1000, patience_s=0.5)
    with closing(stopped):
        stopped.open({"A": ()})
        process = stopped._process  # noqa: SLF001 - as another program would stop it
        assert process
        process.send_signal(signal.SIGSTOP)
        wait_until(lambda: stopped.failure != "", "it is not noticed")
        assert stopped.failure == "did not respond for 0.5 s"


def test_a_router_is_replaced_without_an_interruption(monkeypatch: pytest.MonkeyPatch) -> None:
    """A master that ends without a router could not announce its end."""
    changing = Router(free_endpoint(), IDENTITY, None, 1000)
    found = []
    wait_until_ready = changing._wait_until_ready  # noqa: SLF001 - while it is opened

    def noted(output: IO[bytes]) -> bytes:
        found.append(signal.SIGTERM in signal.pthread_sigmask(signal.SIG_BLOCK, ()))
        return wait_until_ready(output)

    monkeypatch.setattr(changing, "_wait_until_ready", noted)
    with closing(changing):
        changing.open({"A": ()})
        changing.open({"A": (), "B": ()})
    assert found == [False, True]


def test_a_router_that_does_not_come_is_given_up_and_said_to_be_late(monkeypatch: pytest.MonkeyPatch) -> None:
    """As on a machine that is far too busy. That is another thing than one that cannot listen."""
    monkeypatch.setattr(router, "_PROCESS", "json.tool")  # it waits for the end of what it reads, and says nothing
    monkeypatch.setattr(router, "START_S", 0.0)
    late = Router(free_endpoint(), IDENTITY, None, 1000)
    with closing(late), pytest.raises(router.RouterError, match="it was not ready after 0 s"):
        late.open({"A": ()})
