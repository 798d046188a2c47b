"""The live viewer: who it serves, and where it listens."""

from __future__ import annotations

import re
import signal
import socket
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from urllib.error import HTTPError
from urllib.request import Request, urlopen

import pytest
import umsgpack

from robochoc.model.outcome import Outcome, Verdict
from robochoc.view.live import serve_scene
from tests.support.flights import scene_of
from tests.support.limits import HANG_S
from tests.support.live_scenes import served_scene

LIVE = """
from robochoc.model.outcome import Outcome, Verdict
from robochoc.view.live import serve_scene
from tests.support.flights import scene_of
run = {"team": "live team", "protocol": "abt", "runtime": "processes", "seed": 0}
outcome = Outcome(Verdict.SOLUTION, assignment={"V1.1": 1}, **run)
serve_scene(scene_of(outcome), ready=lambda url: print(url, flush=True))
print("left")
"""


@contextmanager
def live_viewer() -> Iterator[tuple[subprocess.Popen[str], int, str]]:
    """Its process, its port, and the path that nobody guesses."""
    with subprocess.Popen([sys.executable, "-W", "error", "-c", LIVE], stdout=subprocess.PIPE, text=True) as process:
        try:
            assert process.stdout
            yield process, *port_and_path(process.stdout.readline().removesuffix("\n"))
        finally:
            process.kill()


def first_message(port: int, path: str, host: str, origin: str) -> tuple[int, bytes]:
    """The status of a WebSocket handshake and, if it was accepted, the first message."""
    with (
        socket.create_connection(("127.0.0.1", port), timeout=HANG_S) as connection,
        connection.makefile("rwb") as stream,
    ):
        stream.write(
            f"GET {path}commands HTTP/1.1\r\nHost: {host}\r\nOrigin: http://{origin}\r\nUpgrade: websocket\r\n"
            "Connection: Upgrade\r\nSec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\n"
            "Sec-WebSocket-Version: 13\r\n\r\n".encode()
        )
        stream.flush()
        status = int(stream.readline().split()[1])
        while stream.readline().strip():
            pass
        if status != 101:
            return status, b""
        _, size = stream.read(2)
        if size == 126:
            size = int.from_bytes(stream.read(2))
        return status, stream.read(size)


@pytest.fixture(scope="module")
def live() -> Iterator[tuple[int, str]]:
    """The port of a live viewer, and the path that nobody guesses."""
    one = Outcome(
        Verdict.SOLUTION, team="live team", protocol="abt", runtime="processes", seed=0, assignment={"V1.1": 1}
    )
    with served_scene(scene_of(one)) as url:
        yield port_and_path(url)


def port_and_path(url: str) -> tuple[int, str]:
    parts = re.fullmatch(r"http://127\.0\.0\.1:(\d+)(/[\w-]{24}/)", url)
    assert parts, url
    return int(parts[1]), parts[2]


def test_the_live_viewer_serves_page_and_commands(live: tuple[int, str]) -> None:
    port, path = live
    with urlopen(f"http://127.0.0.1:{port}{path}", timeout=HANG_S) as answer:
        assert b"live team" in answer.read()
    status, message = first_message(port, path, f"localhost:{port}", f"localhost:{port}")
    assert status == 101
    assert umsgpack.unpackb(message)["type"] == "set_transform"


def test_the_live_viewer_answers_this_machine_only(live: tuple[int, str]) -> None:
    port, path = live
    for host in ("evil.example", f"127.0.0.1.evil.example:{port}", "localhost.evil.example"):
        with pytest.raises(HTTPError, match="404") as refused:
            urlopen(Request(f"http://127.0.0.1:{port}{path}", headers={"Host": host}), timeout=HANG_S)
        refused.value.close()
        assert first_message(port, path, host, host)[0] == 404
    assert first_message(port, path, f"127.0.0.1:{port}", "evil.example")[0] == 403


def test_the_live_viewer_answers_those_only_who_know_its_path(live: tuple[int, str]) -> None:
    port, path = live
    here = f"127.0.0.1:{port}"
    for guess in ("/", "//", f"/{'x' * 24}/", path[:-2] + "/", path.upper()):
        with pytest.raises(HTTPError, match="404") as refused:
            urlopen(f"http://{here}{guess}", timeout=HANG_S)
        refused.value.close()
        assert first_message(port, guess, here, here)[0] == 404
    with pytest.raises(HTTPError, match="403") as refused:
        urlopen(Request(f"http://{here}{path}", headers={"Origin": "http://evil.example"}), timeout=HANG_S)
    refused.value.close()


@pytest.mark.skipif(not Path("/proc/net/tcp").exists(), reason="needs Linux's /proc")
def test_the_live_viewer_listens_on_loopback_only_and_leaves_nothing() -> None:
    with live_viewer() as (process, port, path):
        assert listening(process.pid) == {f"0100007F:{port:04X}"}
        children = Path(f"/proc/{process.pid}/task/{process.pid}/children")
        assert children.read_text() == ""
        first_message(port, path, f"127.0.0.1:{port}", f"127.0.0.1:{port}")
        process.send_signal(signal.SIGINT)
        assert process.wait(HANG_S) == 0
        assert process.stdout
        assert process.stdout.read() == "left\n"
        with pytest.raises(ConnectionRefusedError):
            socket.create_connection(("127.0.0.1", port))


def listening(pid: int) -> set[str]:
    """Local addresses (hexadecimal, as in /proc) on which the process accepts TCP connections, IPv6 included."""
    inodes = {link.readlink().name for link in Path(f"/proc/{pid}/fd").iterdir()}
    rows = [
        row.split()
        for table in ("tcp", "tcp6")
        for row in Path(f"/proc/net/{table}").read_text(encoding="ascii").splitlines()[1:]
    ]
    return {row[1] for row in rows if row[3] == "0A" and f"socket:[{row[9]}]" in inodes}


def test_a_port_in_use_is_an_error_that_says_so() -> None:
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = taken.getsockname()[1]
        with pytest.raises(OSError, match=f"Address already in use .*'127.0.0.1', {port}"):
            serve_scene(
                scene_of(
                    Outcome(
                        Verdict.SOLUTION,
                        team="taken",
                        protocol="abt",
                        runtime="processes",
                        seed=0,
                        assignment={"V1.1": 1},
                    )
                ),
                port=port,
            )
