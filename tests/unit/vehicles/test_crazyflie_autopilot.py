"""One Crazyflie, as its pilot sees it: what is told, what is refused, and what no command may do to it."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager

import pytest

pytest.importorskip("cflib")

from cflib.crtp.crtpstack import CRTPPacket, CRTPPort

from robochoc.vehicles import cflib_autopilot
from robochoc.vehicles.autopilot import OFFBOARD, RefusedError, Telemetry
from robochoc.vehicles.cflib_autopilot import PEAK, CflibAutopilot
from robochoc.vehicles.fleet import VehicleLink
from robochoc.vehicles.supervisor import (
    ARMS_ITSELF,
    CAN_ARM,
    CAN_FLY,
    COMMANDS,
    CRASHED,
    DECK_FAULT,
    FLIES,
    IS_ARMED,
    LOCKED,
    TUMBLED,
    Supervisor,
)
from tests.support.cases import looped
from tests.support.crazyflie_firmware import Crazyfly, Place
from tests.support.crazyflies import Crazyflies
from tests.support.limits import HANG_S, wait_until
from tests.support.mavlink_teams import udp_ports

SPEED_MS = 2.0


@pytest.fixture(autouse=True)
def patient(monkeypatch: pytest.MonkeyPatch) -> None:
    """Commands are given again, and telemetry counts as fresh, for as long as a busy machine may take."""
    monkeypatch.setattr(cflib_autopilot, "_TRIES", round(HANG_S / cflib_autopilot._ANSWER_S))  # noqa: SLF001
    monkeypatch.setattr(cflib_autopilot, "SPIN_UP_S", HANG_S)
    monkeypatch.setattr(cflib_autopilot, "STALE_S", HANG_S)


@contextmanager
def linked(at: Place = (0.0, 0.0, 0.0), **what: object) -> Iterator[tuple[Crazyfly, CflibAutopilot]]:
    """A Crazyflie, and an autopilot that hears it."""
    (port,) = udp_ports(1)
    vehicle = Crazyfly(port)
    for name, value in what.items():
        setattr(vehicle, name, value)
    before = {*threading.enumerate()}
    with Crazyflies([vehicle]) as vehicles:
        autopilot = CflibAutopilot(VehicleLink(f"udp://127.0.0.1:{port}", at), SPEED_MS)
        try:
            wait_until(autopilot.connect, "it is not heard")
            yield vehicle, autopilot
        finally:
            autopilot.close()
        assert "fell" not in vehicle.log, vehicles.state()
    wait_until(lambda: {*threading.enumerate()} <= before, "threads are left")


def seen(autopilot: CflibAutopilot, condition: Callable[[Telemetry], bool]) -> None:
    wait_until(lambda: condition(autopilot.telemetry()), lambda: str(autopilot.telemetry()))


def fly(vehicle: Crazyfly, autopilot: CflibAutopilot, height_m: float = 1.0) -> None:
    """Take off, and wait until that is done."""
    autopilot.arm()
    autopilot.take_off(height_m)
    seen(autopilot, lambda told: told.place is not None and told.place[2] == pytest.approx(height_m))
    wait_until(lambda: vehicle.at[2] == pytest.approx(height_m), "it does not rise")


def going(autopilot: CflibAutopilot, to: Place) -> Callable[[], bool]:
    def went() -> bool:
        try:
            autopilot.go_to(to)
        except RefusedError:
            return False
        return True

    return went


def test_what_is_told_is_in_the_frame_of_the_team() -> None:
    with linked(at=(3.0, 1.0, 0.5), battery=0.42) as (_, autopilot):
        told = autopilot.telemetry()
        assert told.place == pytest.approx((3, 1, 0.5))
        assert told.battery == pytest.approx(0.42)
        assert told.healthy
        assert not told.armed
        assert not told.in_air


@pytest.mark.more
def test_on_its_way_it_is_sent_elsewhere_in_a_straight_line() -> None:
    with linked() as (vehicle, autopilot):
        fly(vehicle, autopilot)
        vehicle.haste = 1.0  # it is on its way for some seconds
        wait_until(going(autopilot, (4, 0, 1)), vehicle.log.__str__)
        _, lasts, straight = vehicle.paths[-1]
        assert lasts == pytest.approx(PEAK * 4 / SPEED_MS, rel=0.01)
        assert not straight
        seen(autopilot, lambda told: told.place is not None and told.place[0] > 0.01)
        autopilot.go_to((0, 0, 1))
        to, lasts, straight = vehicle.paths[-1]
        assert (to, straight) == ((0, 0, 1), True)
        assert lasts < PEAK * 4 / SPEED_MS / 2
        autopilot.hold()
        assert vehicle.log[-1] == "hold"
        assert autopilot.telemetry().mode == OFFBOARD


def test_in_the_air_it_is_never_disarmed() -> None:
    with linked() as (vehicle, autopilot):
        autopilot.arm()
        autopilot.take_off(1)
        with pytest.raises(RefusedError, match="it may be in the air"):
            autopilot.disarm()  # though what it has told is from before the take-off
        wait_until(lambda: vehicle.flies, "it does not rise")
        with pytest.raises(RefusedError, match="it may be in the air"):
            autopilot.disarm()
        assert vehicle.armed


def test_closing_the_link_in_the_air_lets_it_hover() -> None:
    with linked() as (vehicle, autopilot):
        fly(vehicle, autopilot)
        autopilot.close()
        assert vehicle.flies
        assert vehicle.planner == "flying"
        assert "low-level set point" not in vehicle.log


def test_closing_the_link_ends_a_thread_that_was_woken_too_early() -> None:
    with linked() as (_, autopilot):
        requests = autopilot._crazyflie.param.param_updater.request_queue  # noqa: SLF001 - cflib's
        put, get, begun = requests.put, requests.get, []

        def counted(*how: object, **more: object) -> object:
            begun.append(how)
            return get(*how, **more)

        def woken(request: object) -> None:
            before = len(begun)
            requests.put = put
            put(request)
            wait_until(lambda: len(begun) > before, "the thread does not wait for more")

        requests.get, requests.put = counted, woken


def test_an_error_of_the_link_that_passes_is_none_of_ours() -> None:
    with linked() as (vehicle, autopilot):
        fly(vehicle, autopilot)
        autopilot._crazyflie.link.link_error_callback("could not send")  # noqa: SLF001 - as its driver does
        autopilot.hold()
        assert vehicle.log[-1] == "hold"


def test_packets_that_are_cut_off_are_none() -> None:
    with linked() as (vehicle, autopilot):
        telling = {(13, 1), (15, 1)}  # by these it would be another Crazyflie, of another version
        places = [(port, channel) for port in range(16) for channel in range(4) if (port, channel) not in telling]
        vehicle.noise = [
            bytes([port << 4 | 3 << 2 | channel, *range(length)]) for port, channel in places for length in range(5)
        ]
        wait_until(lambda: not vehicle.noise, "it is quiet")
        fly(vehicle, autopilot)
        autopilot.hold()
        assert vehicle.log[-1] == "hold"


def test_on_the_ground_it_is_disarmed_and_does_not_land() -> None:
    with linked() as (vehicle, autopilot):
        autopilot.arm()
        vehicle.refuses = {"takeoff"}
        with pytest.raises(RefusedError, match=r"it did not take off \(command denied\)"):
            autopilot.take_off(1)
        with pytest.raises(RefusedError, match="it is on the ground"):
            autopilot.land()
        autopilot.disarm()
        assert vehicle.log == ["armed", "refused takeoff", "disarmed"]


@pytest.mark.more
def test_a_take_off_whose_answer_is_lost_is_none_that_was_refused() -> None:
    with linked(deaf={"takeoff"}) as (vehicle, autopilot):
        autopilot.arm()
        autopilot.take_off(1)
        autopilot.land()
        assert "land" in vehicle.log


@pytest.mark.slow
def test_who_is_not_heard_gets_no_command(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(cflib_autopilot, "STALE_S", 1.0)
    with linked() as (vehicle, autopilot):
        vehicle.silent = True
        seen(autopilot, lambda told: told.silent_s > 1)
        with pytest.raises(RefusedError, match="it cannot arm: no recent message from it"):
            autopilot.arm()


def test_blocks_of_the_log_are_no_answer_to_a_new_link() -> None:
    autopilot = object.__new__(CflibAutopilot)
    autopilot._received_at = 0.0
    autopilot._packet_received(CRTPPacket(CRTPPort.LOGGING << 4 | 2))
    assert autopilot._received_at == 0
    autopilot._packet_received(CRTPPacket(CRTPPort.LOGGING << 4 | 1))
    assert autopilot._received_at > 0


@pytest.mark.more
def test_a_link_that_was_opened_in_vain_is_opened_anew(monkeypatch: pytest.MonkeyPatch) -> None:
    """Its questions are lost. Once it is heard again it goes on with its log, as if that were an answer."""
    for name in ("_REOPEN_S", "_ATTEMPT_S"):
        monkeypatch.setattr(cflib_autopilot, name, 0.5)
    with linked() as (vehicle, autopilot):
        first = autopilot._crazyflie  # noqa: SLF001 - the link
        vehicle.silent = True
        seen(autopilot, lambda _: autopilot._crazyflie not in {first, None})  # noqa: SLF001
        missed = vehicle.missed
        seen(autopilot, lambda _: vehicle.missed > missed)
        silent_s = autopilot.telemetry().silent_s
        vehicle.silent = False
        seen(autopilot, lambda told: told.silent_s < silent_s)
        autopilot.arm()
        assert vehicle.log == ["armed"]


def test_a_landing_that_is_under_way_is_no_refusal() -> None:
    with linked() as (vehicle, autopilot):
        fly(vehicle, autopilot)
        vehicle.haste = 0.1  # it does not get there
        autopilot.land()
        autopilot.land()
        assert vehicle.log.count("land") == 1


@looped(
    ("bits", "armed", "mode", "problem"),
    [
        (CAN_ARM, False, "STANDBY", ""),
        (IS_ARMED | CAN_FLY, True, "STANDBY", ""),
        (IS_ARMED | ARMS_ITSELF | CAN_FLY, False, "STANDBY", ""),
        (IS_ARMED | ARMS_ITSELF | CAN_FLY | COMMANDS, True, OFFBOARD, ""),
        (IS_ARMED | CAN_FLY | FLIES | COMMANDS, True, OFFBOARD, ""),
        (IS_ARMED | CAN_FLY | FLIES, True, "MANUAL", ""),
        (CAN_ARM | LOCKED, False, "STANDBY", "it is locked: restart it"),
        (CRASHED, False, "STANDBY", "it has crashed: set it upright and restart it"),
        (TUMBLED, False, "STANDBY", "it does not stand upright"),
        (CAN_ARM | DECK_FAULT, False, "STANDBY", "one of its decks has a fault"),
        (0, False, "STANDBY", "its autopilot is not ready to arm"),
    ],
)
def test_what_the_bits_of_the_supervisor_mean(bits: int, armed: bool, mode: str, problem: str) -> None:  # noqa: FBT001
    told = Supervisor(bits)
    assert (told.armed, told.mode, told.problem) == (armed, mode, problem)
