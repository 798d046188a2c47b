"""The guard brings every vehicle to an end, whatever fails in it. Autopilots are played; it runs in this process."""

from __future__ import annotations

import os
import subprocess
import threading
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from types import SimpleNamespace
from typing import Any

import msgspec
import pytest

from robochoc.vehicles import guard_client
from robochoc.vehicles.autopilot import Telemetry
from robochoc.vehicles.fleet import Fence, Fleet, VehicleLink
from robochoc.vehicles.guard import Orders, VehicleGuard, serve_orders
from robochoc.vehicles.guard_client import GuardClient, GuardError
from robochoc.vehicles.messages import Fly, FromGuard, GuardFailed, Permit, ToGuard, VehicleState, VehicleTarget
from tests.support.limits import HANG_S, wait_until
from tests.support.played_autopilot import Played

FLEET = Fleet({name: VehicleLink("udpin://0.0.0.0:1") for name in "AB"}, Fence((-1, -1, 0), (9, 9, 9)), distance_m=2)
PLACES = {"A": (0.0, 0.0, 0.0), "B": (5.0, 0.0, 0.0)}
THERE = Fly(1, {"A": VehicleTarget((0, 4, 2)), "B": VehicleTarget((5, 4, 2))})


class Hanging(Played):
    """Never tells anything again, once it `hangs`. The test lets it go."""

    def __init__(self, place: tuple[float, float, float]) -> None:
        super().__init__()
        self.seen = Telemetry(place, 1.0, "HOLD", healthy=True)
        self.hangs = self.is_closed = False
        self.go = threading.Event()
        self.when_armed: Callable[[], None] = lambda: None

    def arm(self) -> None:
        super().arm()
        self.when_armed()

    def telemetry(self) -> Telemetry:
        if self.hangs:
            self.go.wait(HANG_S)
        return super().telemetry()

    def close(self) -> None:
        self.is_closed = True


@dataclass
class Given(Orders):
    """Orders that a guard is given, in place of standard input. An exception is raised."""

    left: list[ToGuard | Exception]
    ended: bool = False
    quiet: threading.Event = field(default_factory=threading.Event)

    def next(self, wait_s: float) -> ToGuard | None:
        self.quiet.wait(0 if self.left else wait_s)
        found = self.left.pop(0) if self.left else None
        if isinstance(found, Exception):
            raise found
        return found


@dataclass
class Stand:
    """A guard of two vehicles, and what it has told."""

    told: list[FromGuard] = field(default_factory=list)
    autopilots: dict[str, Hanging] = field(default_factory=lambda: {name: Hanging(at) for name, at in PLACES.items()})

    def __post_init__(self) -> None:
        self.guard = VehicleGuard(FLEET, self.autopilots.__getitem__, self.told.append)

    def fly(self) -> None:
        """Let both fly to their places."""
        wait_until(lambda: self.phases() == {"ready"}, lambda: str(self.told))
        self.guard.obey(Permit())
        self.guard.obey(THERE)
        wait_until(lambda: self.phases() == {"arrived"}, lambda: str(self.told))

    def phases(self) -> set[str]:
        newest = {one.vehicle: one.phase.value for one in [*self.told] if isinstance(one, VehicleState)}
        return set(newest.values())

    def landed(self) -> list[str]:
        return [name for name, one in self.autopilots.items() if one.done[-1:] == ["land"]]

    def failures(self) -> list[str]:
        return [one.why for one in self.told if isinstance(one, GuardFailed)]


@pytest.fixture
def stand() -> Iterator[Stand]:
    stand = Stand()
    yield stand
    for one in stand.autopilots.values():
        one.go.set()
    stand.guard.end(FLEET.end, waits=False)
    wait_until(lambda: stand.guard.ended, lambda: str(stand.told))


def broken(*_: object) -> None:
    raise ValueError("nobody foresaw it")


Break = Callable[[Stand, pytest.MonkeyPatch], None]


def an_order_that_is_none(stand: Stand, _: pytest.MonkeyPatch) -> None:
    serve_orders(stand.guard, Given([msgspec.DecodeError("nobody foresaw it")]), threading.Event())


def an_order_that_fails(stand: Stand, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(stand.guard, "_fly", broken)
    serve_orders(stand.guard, Given([THERE]), threading.Event())


def an_end_that_cannot_be_planned(stand: Stand, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(stand.guard, "_fly", broken)
    monkeypatch.setattr("robochoc.vehicles.traffic.RoutePlanner.descents", broken)
    monkeypatch.setattr("robochoc.vehicles.pilot.TURN_S", 0.0)
    serve_orders(stand.guard, Given([THERE]), threading.Event())


@pytest.mark.parametrize("breaks", [an_order_that_is_none, an_order_that_fails, an_end_that_cannot_be_planned])
def test_a_guard_that_fails_lands_all_and_says_so(stand: Stand, monkeypatch: pytest.MonkeyPatch, breaks: Break) -> None:
    stand.fly()
    breaks(stand, monkeypatch)
    assert stand.landed() == ["A", "B"]
    assert len(stand.failures()) == 1
    assert stand.failures()[0].endswith("Error: nobody foresaw it")


def test_a_pilot_that_hangs_keeps_the_guard_from_ending_only_for_a_while(stand: Stand) -> None:
    stand.fly()
    stand.autopilots["A"].hangs = True
    stand.guard.end_s = 0.5
    with pytest.raises(TimeoutError, match=r"^A: the flight has not ended within 0\.5 s$"):
        serve_orders(stand.guard, Given([], ended=True), threading.Event())
    assert stand.landed() == ["B"]


def test_what_cannot_be_told_keeps_nobody_in_the_air(stand: Stand) -> None:
    stand.fly()
    for flight in stand.guard._flights.values():  # noqa: SLF001 - the pipe may fail for one alone
        flight._send = broken  # noqa: SLF001 - as it might
    serve_orders(stand.guard, Given([], ended=True), threading.Event())
    assert stand.landed() == ["A", "B"]
    assert all(one.is_closed for one in stand.autopilots.values())


def test_who_is_being_armed_when_the_end_comes_does_not_take_off(stand: Stand) -> None:
    wait_until(lambda: stand.phases() == {"ready"}, lambda: str(stand.told))
    stand.autopilots["A"].when_armed = lambda: stand.guard.end(FLEET.end, waits=False)
    stand.guard.obey(Permit())
    stand.guard.obey(THERE)
    wait_until(lambda: stand.guard.ended, lambda: str(stand.told))
    assert stand.autopilots["A"].done == ["arm", "land"]


def test_a_guard_process_that_cannot_be_set_up_is_not_left_behind(monkeypatch: pytest.MonkeyPatch) -> None:
    def gone(*_: object) -> None:
        raise BrokenPipeError

    started: list[subprocess.Popen[bytes]] = []

    class Started(subprocess.Popen[bytes]):
        def __init__(self, *words: Any, **settings: Any) -> None:  # noqa: ANN401 - whatever it takes
            super().__init__(*words, **settings)
            started.append(self)

    monkeypatch.setattr(guard_client, "os", SimpleNamespace(write=gone, environ=os.environ))
    monkeypatch.setattr(subprocess, "Popen", Started)
    with pytest.raises(GuardError, match="the guard process has ended"):
        GuardClient(FLEET)
    assert [one.returncode for one in started] == [0]
    assert not any(thread.name == "hears the guard" for thread in threading.enumerate())
