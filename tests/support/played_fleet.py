"""A fleet of played vehicles: one thread of the test lets them hear, move and tell, whatever they speak."""

from __future__ import annotations

import selectors
import socket
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from types import TracebackType
from typing import Generic, Protocol, Self, TypeVar

from tests.support.limits import HANG_S, wait_until

TICK_S = 0.02


class PlayedVehicle(Protocol):
    """What tests see of a vehicle."""

    @property
    def is_safe(self) -> bool:
        """Return whether it is on the ground, or needs nobody to stay in the air or to land."""

    @property
    def is_down(self) -> bool:
        """Return whether it has landed, as it should."""

    @property
    def state(self) -> str:
        """Return in words what it does and where it is."""


class Machinery(Protocol):
    """What plays one vehicle."""

    socket: socket.socket

    def hear(self) -> None:
        """Take all that has come to the socket."""

    def live(self, now: float, passed: float) -> None:
        """Let time go by: move, and tell."""

    def come_and_go(self, selector: selectors.BaseSelector) -> None:
        """Leave the port, or take it again."""


V = TypeVar("V", bound=PlayedVehicle)


class PlayedFleet(Generic[V]):
    """Plays `vehicles` while it is a context. `machinery` makes that of the vehicle with a number, from 0."""

    def __init__(self, vehicles: Sequence[V], machinery: Callable[[V, int], Machinery]) -> None:
        self.vehicles = [*vehicles]
        self._machinery = machinery
        self._played: list[Machinery] = []
        self._over = threading.Event()
        self._thread = threading.Thread(target=self._play, name="played vehicles")

    def __enter__(self) -> Self:
        self._played = [self._machinery(vehicle, number) for number, vehicle in enumerate(self.vehicles)]
        self._thread.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._over.set()
        self._thread.join(HANG_S)
        for played in self._played:
            played.socket.close()

    def __iter__(self) -> Iterator[V]:
        return iter(self.vehicles)

    def __getitem__(self, number: int) -> V:
        return self.vehicles[number]

    def wait_until_safe(self) -> None:
        """Wait until no vehicle needs anybody."""
        wait_until(lambda: all(vehicle.is_safe for vehicle in self.vehicles), self.state)

    def wait_until_landed(self) -> None:
        wait_until(lambda: all(vehicle.is_down for vehicle in self.vehicles), self.state)

    def state(self) -> str:
        """Return in words where all are."""
        return "; ".join(vehicle.state for vehicle in self.vehicles)

    def watch(self) -> None:
        """See what has become of all, after each tick."""

    def _play(self) -> None:
        with selectors.DefaultSelector() as selector:
            for played in self._played:
                selector.register(played.socket, selectors.EVENT_READ, played)
            before = time.monotonic()
            while not self._over.is_set():
                for key, _ in selector.select(TICK_S):
                    key.data.hear()
                now = time.monotonic()
                if now - before >= TICK_S:
                    passed, before = now - before, now
                    for played in self._played:
                        played.live(now, passed)
                        played.come_and_go(selector)
                    self.watch()
