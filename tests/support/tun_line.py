"""A line between two TUN devices that delays every packet, and drops some: what `tc netem` does where it exists.

    tun_line.py DELAY_S LOSS SEED

Makes the devices `t<pid>a` and `t<pid>b`, says so, and carries packets between them until standard input ends. Devices
that are moved to other namespaces stay connected with whoever has made them.
"""

from __future__ import annotations

import argparse
import fcntl
import heapq
import os
import random
import selectors
import struct
import sys
import time
from contextlib import suppress

_TUNSETIFF = 0x400454CA
_IFF_TUN, _IFF_NO_PI = 0x0001, 0x1000
_LARGEST_PACKET = 65536


def tun(name: str) -> int:
    """The descriptor of a new TUN device, which gives and takes a whole IP packet at a time."""
    descriptor = os.open("/dev/net/tun", os.O_RDWR | os.O_NONBLOCK)
    fcntl.ioctl(descriptor, _TUNSETIFF, struct.pack("16sH22x", name.encode(), _IFF_TUN | _IFF_NO_PI))
    return descriptor


def carry(ends: tuple[int, int], delay_s: float, loss: float, chance: random.Random) -> None:
    """Carry packets from each end to the other until standard input ends."""
    under_way: list[tuple[float, int, int, bytes]] = []
    number = 0
    with selectors.DefaultSelector() as selector:
        for descriptor in (*ends, sys.stdin.fileno()):
            selector.register(descriptor, selectors.EVENT_READ)
        while True:
            patience_s = max(0.0, under_way[0][0] - time.monotonic()) if under_way else None
            for key, _ in selector.select(patience_s):
                if key.fd not in ends:
                    return
                with suppress(OSError):  # the device is down
                    packet = os.read(key.fd, _LARGEST_PACKET)
                    if chance.random() >= loss:
                        number += 1
                        heapq.heappush(under_way, (time.monotonic() + delay_s, number, ends[key.fd == ends[0]], packet))
            while under_way and under_way[0][0] <= time.monotonic():
                _, _, receiver, packet = heapq.heappop(under_way)
                with suppress(OSError):  # the same: what is under way is lost
                    os.write(receiver, packet)


def main() -> None:
    """The program."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("delay_s", type=float, metavar="DELAY_S")
    parser.add_argument("loss", type=float, metavar="LOSS", help="probability that a packet is dropped")
    parser.add_argument("seed", type=int, metavar="SEED")
    asked = parser.parse_args()
    ends = tun(f"t{os.getpid()}a"), tun(f"t{os.getpid()}b")
    sys.stdout.write("ready\n")
    sys.stdout.flush()
    carry(ends, asked.delay_s, asked.loss, random.Random(asked.seed))


if __name__ == "__main__":
    main()
