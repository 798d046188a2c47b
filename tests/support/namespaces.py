"""Network namespaces: machines that share nothing but the links between them. Linux, as root, with iproute2."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from secrets import token_hex

TUN = Path("/dev/net/tun")
DELAY_S, LOSS = 0.02, 0.02
_READY = b"ready\n"


def why_not() -> str:
    """Why there can be no namespaces here; empty if there can."""
    if sys.platform != "linux" or os.geteuid() != 0:
        return "network namespaces need Linux, and root"
    if shutil.which("ip") is None:
        return "network namespaces need ip: apt-get install iproute2"
    name = f"rc{token_hex(4)}"
    tried = subprocess.run(["ip", "netns", "add", name], capture_output=True, text=True, check=False)
    if tried.returncode:
        return f"network namespaces cannot be made here: {tried.stderr.strip()}"
    _ip("netns", "del", name)
    return ""


@contextmanager
def namespaces(count: int) -> Iterator[list[str]]:
    """So many new namespaces, each with its loopback. Their devices go with them."""
    names = [f"rc{token_hex(4)}" for _ in range(count)]
    try:
        for name in names:
            _ip("netns", "add", name)
            _ip("-n", name, "link", "set", "lo", "up")
        yield names
    finally:
        for name in names:
            subprocess.run(["ip", "netns", "del", name], capture_output=True, check=False)


def veth(left: tuple[str, str], right: tuple[str, str]) -> None:
    """A cable between two namespaces: each end is a namespace, and the address (`10.0.0.1/24`) of its device."""
    ends = [f"v{token_hex(5)}" for _ in (left, right)]
    _ip("link", "add", ends[0], "type", "veth", "peer", "name", ends[1])
    for device, (namespace, address) in zip(ends, (left, right), strict=True):
        _plug(device, namespace, address)


def route(namespace: str, to: str, via: str) -> None:
    """Let `namespace` reach the network `to` through its neighbour `via`."""
    _ip("-n", namespace, "route", "add", to, "via", via)


class Link:
    """A line between two namespaces that delays and drops packets, and can be down for a while."""

    def __init__(self, left: tuple[str, str], right: tuple[str, str], process: subprocess.Popen[bytes]) -> None:
        self._ends = ((f"t{process.pid}a", left[0]), (f"t{process.pid}b", right[0]))
        for (device, namespace), (_, address) in zip(self._ends, (left, right), strict=True):
            _plug(device, namespace, address)

    def set(self, state: str) -> None:
        """Take it `down`, or `up` again."""
        for device, namespace in self._ends:
            _ip("-n", namespace, "link", "set", device, state)


@contextmanager
def bad_line(left: tuple[str, str], right: tuple[str, str], seed: int, loss: float = LOSS) -> Iterator[Link]:
    """A line with a delay of `DELAY_S` each way, which loses one packet in 1 / `loss`."""
    command = [sys.executable, str(Path(__file__).with_name("tun_line.py")), str(DELAY_S), str(loss), str(seed)]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE) as process:
        try:
            assert process.stdout
            assert process.stdout.readline() == _READY
            yield Link(left, right, process)
        finally:
            process.kill()


def _plug(device: str, namespace: str, address: str) -> None:
    _ip("link", "set", device, "netns", namespace)
    _ip("-n", namespace, "address", "add", address, "dev", device)
    _ip("-n", namespace, "link", "set", device, "up")


def _ip(*words: str) -> None:
    subprocess.run(["ip", *words], check=True, capture_output=True)
