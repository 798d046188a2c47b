"""Fleet files: what they say, and what is wrong with them, in one line with its place."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from robochoc.formats.settings_file import BYTES_MAX
from robochoc.vehicles.fleet import AtEnd, Fence, Fleet, FleetError, VehicleLink, read_fleet
from robochoc.vehicles.frames import GpsPlace
from robochoc.vehicles.kinds import VehicleKind
from tests.support.cases import looped
from tests.support.program import ROOT

LINK = "udpin://0.0.0.0:14540"
FENCE = "fence: [[0, 0, 0], [6, 6, 6]]"
BOX = Fence((0, 0, 0), (6, 6, 6))


def read(folder: Path, text: str) -> Fleet:
    file = folder / "fleet.yaml"
    file.write_text(text)
    return read_fleet(file)


def test_a_fleet_file_and_what_it_leaves_out(tmp_path: Path) -> None:
    found = read(tmp_path, f"vehicles:\n  Nose: {LINK}\n{FENCE}\n")
    assert found == Fleet({"Nose": VehicleLink(LINK)}, BOX)
    assert (found.takeoff_m, found.near_m, found.end, found.patience_s, found.time_s) == (
        (2.5, 0.5, AtEnd.LAND, 10, 120)
    )
    assert (found.distance_m, found.downwash, found.tolerance_m) == (1, 1, 0.25)


def test_a_fleet_file_that_says_all(tmp_path: Path) -> None:
    text = (
        "vehicles:\n  Nose: {link: udpout://10.0.0.7:14550, at: [1, -2.5, 0]}\n"
        "  3: serial:///dev/ttyUSB0:57600\n  Fin: tcpout://[::1]:5760\n"
        "fence: [[6, 0, 9], [0, 6.5, -1]]\ntakeoff: 3\nnear: 0.25\nend: hold\npatience: 4\ntime: 60\n"
        "distance: 1.5\ndownwash: 2\n"
    )
    links = {
        "Nose": VehicleLink("udpout://10.0.0.7:14550", (1, -2.5, 0)),
        "3": VehicleLink("serial:///dev/ttyUSB0:57600"),
        "Fin": VehicleLink("tcpout://[::1]:5760"),
    }
    expected = Fleet(
        links, Fence((0, 0, -1), (6, 6.5, 9)), None, 3, 0.25, AtEnd.HOLD, 4, 60, distance_m=1.5, downwash=2
    )
    assert read(tmp_path, text) == expected


def test_the_origin_on_the_earth(tmp_path: Path) -> None:
    found = read(tmp_path, f"vehicles: {{Nose: {LINK}}}\n{FENCE}\norigin: [47.397742, 8.545594, 488]\n")
    assert found.origin == GpsPlace(47.397742, 8.545594, 488)


def test_the_fleet_file_of_the_guide(tmp_path: Path) -> None:
    page = (ROOT / "docs" / "guides" / "autopilots.md").read_text()
    found = read(tmp_path, page.partition("```yaml\n")[2].partition("```")[0])
    assert sorted(found.vehicles) == sorted(file.stem for file in (ROOT / "docs" / "examples" / "hangar").glob("*.xml"))


GOOD = f"vehicles:\n  Nose: {LINK}\n{FENCE}\n"


@looped(
    ("text", "told"),
    [
        ("", "is empty; see the page Autopilots of the documentation for the entries of a fleet file"),
        ("[1]", "fleet.yaml:1: a fleet file is not a mapping"),
        ("a: {", "is not YAML"),
        ("a: !!python/object:os.system x", "the tag .* is not allowed"),
        (FENCE, "has no vehicles"),
        (f"vehicles: {{Nose: {LINK}}}", "has no fence"),
        (f"{GOOD}fence: [[0, 0, 0], [60, 60, 60]]", "fleet.yaml:4: duplicate key 'fence'"),
        (f"vehicles:\n  A: {LINK}\n  A: {LINK}0\n{FENCE}", "fleet.yaml:3: duplicate key 'A'"),
        (
            f"{GOOD}fance: 3",
            r"fleet.yaml:4: unknown key 'fance'; did you mean 'fence'",
        ),
        (f"vehicles: [Nose]\n{FENCE}", "'vehicles' is not a mapping"),
        (f"vehicles: {{}}\n{FENCE}", "0 vehicles; a fleet has 1 to 64"),
        (f"vehicles: {{Nose: 3}}\n{FENCE}", r"the link of Nose, '3', is not valid; expected udpin://0.0.0.0:14540"),
        (f"vehicles: {{Nose: 'udpin://0.0.0.0:70000'}}\n{FENCE}", "is not valid"),
        (f"vehicles: {{Nose: 'udpin://0.0.0.0:1 x'}}\n{FENCE}", "is not valid"),
        (f"vehicles: {{Nose: 'serial:///etc/passwd:57600'}}\n{FENCE}", "is not valid"),
        (f"vehicles: {{Nose: 'serial:///dev/../etc/passwd:57600'}}\n{FENCE}", "is not valid"),
        (f"vehicles:\n  A: {LINK}\n  B: {LINK}\n{FENCE}", "fleet.yaml:3: B and A have the same link"),
        (f"vehicles: {{A: {{at: [0, 0, 0]}}}}\n{FENCE}", "vehicle A has no link"),
        (f"vehicles: {{A: {{link: '{LINK}', at: [0, 0]}}}}\n{FENCE}", r"'at' is not a place; expected \[x, y, z\]"),
        (f"vehicles: {{A: {{link: '{LINK}', by: 1}}}}\n{FENCE}", "unknown key 'by' in vehicles.A"),
        (
            f"vehicles: {{A: {{link: '{LINK}', at: [0, 0, 0]}}}}\n{FENCE}\norigin: [1, 2, 3]",
            "'at' is for vehicles with",
        ),
        (f"vehicles: {{A: {LINK}}}\nfence: [[0, 0, 0]]", "'fence' is not a box; expected two corners"),
        (f"vehicles: {{A: {LINK}}}\nfence: [[0, 0, 0], [1, 1, 9e99]]", "a corner of the fence is not a place"),
        (f"vehicles: {{A: {LINK}}}\nfence: [[0, 0, 0], [1, 1, true]]", "a corner of the fence is not a place"),
        (
            f"vehicles: {{A: {LINK}}}\nfence: [[0, 0, 0], [9, 9, 2]]",
            "a take-off to 2.5 m would leave the fence, which is 2 m high",
        ),
        (f"{GOOD}origin: [47, 8]", "'origin' is not a place"),
        (f"{GOOD}origin: [80, 8, 0]", "'origin' is outside the limits; expected latitudes within 75"),
        (f"{GOOD}takeoff: 0", "'takeoff' is '0'; expected 0.5 to 100"),
        (f"{GOOD}takeoff: high", "'takeoff' is 'high'"),
        (f"{GOOD}distance: 0", "'distance' is '0'; expected 0.1 to 100"),
        (f"{GOOD}downwash: 0.5", "'downwash' is '0.5'; expected 1 to 10"),
        (f"{GOOD}patience: .inf", "'patience' is 'inf'"),
        (f"{GOOD}end: fly", "'end' is 'fly'; expected land or hold"),
        ("#" * (BYTES_MAX + 1), "has at most 65,536 bytes"),
    ],
)
def test_what_is_wrong_is_said_in_one_line(tmp_path: Path, text: str, told: str) -> None:
    with pytest.raises(FleetError, match=told) as caught:
        read(tmp_path, text)
    assert "\n" not in str(caught.value)


def test_the_fleet_file_of_the_guide_for_crazyflies(tmp_path: Path) -> None:
    page = (ROOT / "docs" / "guides" / "autopilots.md").read_text().partition("## Crazyflies")[2]
    found = read_crazyflies(tmp_path, page.partition("```yaml\n")[2].partition("```")[0])
    assert sorted(found.vehicles) == sorted(file.stem for file in (ROOT / "docs" / "examples" / "hangar").glob("*.xml"))


@looped(
    ("first", "second"),
    [
        ("udpin://0.0.0.0:14540", "udpin://127.0.0.1:14540"),
        ("udpin://localhost:14540", "udpin://127.0.0.1:14540"),
        ("tcpin://[::]:5760", "tcpin://10.0.0.7:5760"),
    ],
)
def test_two_links_that_receive_at_one_port(tmp_path: Path, first: str, second: str) -> None:
    told = r"fleet\.yaml:3: Fin and Nose both receive at port \d+ of this machine; only one of them would get messages"
    with pytest.raises(FleetError, match=told):
        read(tmp_path, f"vehicles:\n  Nose: {first}\n  Fin: {second}\n{FENCE}\n")


@looped(
    ("first", "second"),
    [
        ("udpin://127.0.0.1:14540", "udpin://10.0.0.7:14540"),
        ("udpin://0.0.0.0:14540", "tcpin://0.0.0.0:14540"),
        ("udpout://10.0.0.7:14540", "udpout://10.0.0.8:14540"),
    ],
)
def test_links_at_ports_of_their_own(tmp_path: Path, first: str, second: str) -> None:
    found = read(tmp_path, f"vehicles:\n  Nose: {first}\n  Fin: {second}\n{FENCE}\n")
    assert [link.url for link in found.vehicles.values()] == [first, second]


URI = "radio://0/80/2M/E7E7E7E701"


def read_crazyflies(folder: Path, text: str) -> Fleet:
    file = folder / "fleet.yaml"
    file.write_text(text)
    return read_fleet(file, VehicleKind.CRAZYFLIE)


def test_a_fleet_of_crazyflies_and_what_its_file_leaves_out(tmp_path: Path) -> None:
    found = read_crazyflies(tmp_path, f"vehicles:\n  Nose: {URI}\n{FENCE}\n")
    assert found == Fleet(
        {"Nose": VehicleLink(URI)}, BOX, takeoff_m=0.5, near_m=0.1, kind=VehicleKind.CRAZYFLIE, distance_m=0.4
    )
    assert (found.speed_ms, found.patience_s, found.connect_s) == (1, 10, 60)


@looped("uri", [URI, "radio://12/125/250K/e7e7e7e7e7", "radio://0123456789/0/1M/0000000000", "udp://127.0.0.1:19850"])
def test_links_to_crazyflies(tmp_path: Path, uri: str) -> None:
    found = read_crazyflies(tmp_path, f"vehicles: {{Nose: {{link: '{uri}', at: [1, 2, 0]}}}}\n{FENCE}\nspeed: 0.5\n")
    assert found.vehicles == {"Nose": VehicleLink(uri, (1, 2, 0))}
    assert found.speed_ms == 0.5


@looped(
    ("text", "told"),
    [
        *(
            (f"vehicles: {{Nose: '{uri}'}}\n{FENCE}", "is not valid; expected radio://0/80/2M/E7E7E7E701")
            for uri in (
                *("radio://0/126/2M/E7E7E7E701", "radio://0/80/3M/E7E7E7E701", "radio://0/80/2M/E7E7E7E7"),
                *("radio://0/80/2M", "udp://127.0.0.1:0", "tcp://127.0.0.1:5000", "usb://0", LINK),
                *("radio://0/80/2M/E7E7E7E701?rate_limit=1", "udp://127.0.0.1:19850/x"),
            )
        ),
        (f"vehicles: {{A: {{at: [0, 0, 0]}}}}\n{FENCE}", "vehicle A has no link; as in link: radio://0/80"),
        *(
            (f"vehicles:\n  A: {URI}\n  B: {other}\n{FENCE}", "fleet.yaml:3: B and A have the same link")
            for other in (URI, URI.replace("//0", "//1"), URI.replace("E7", "e7"))
        ),
        (
            f"vehicles: {{A: {URI}}}\n{FENCE}\norigin: [1, 2, 3]",
            "unknown key 'origin'",
        ),
        (f"vehicles: {{A: {URI}}}\n{FENCE}\nspeed: 6", "'speed' is '6'; expected 0.1 to 5"),
        (f"vehicles: {{A: {URI}}}\n{FENCE}\ntakeoff: 0.1", "'takeoff' is '0.1'; expected 0.2 to 100"),
    ],
)
def test_what_is_wrong_with_a_fleet_of_crazyflies(tmp_path: Path, text: str, told: str) -> None:
    with pytest.raises(FleetError, match=told) as caught:
        read_crazyflies(tmp_path, text)
    assert "\n" not in str(caught.value)


def test_speed_is_no_entry_for_vehicles_that_have_their_own(tmp_path: Path) -> None:
    with pytest.raises(FleetError, match="unknown key 'speed'"):
        read(tmp_path, f"{GOOD}speed: 1\n")


def test_files_that_are_none(tmp_path: Path) -> None:
    with pytest.raises(FleetError, match="No such file or directory; name a fleet file"):
        read_fleet(tmp_path / "nowhere.yaml")
    (tmp_path / "bytes").write_bytes(b"\xff\xfe\0")
    with pytest.raises(FleetError, match="is not UTF-8 text"):
        read_fleet(tmp_path / "bytes")


def test_the_fence_holds_what_is_in_it_and_the_ground_below() -> None:
    fence = Fence((0, 0, 1), (6, 6, 6))
    assert fence.contains((0, 6, 1))
    assert not fence.contains((3, 3, 0.5))
    assert fence.covers((3, 3, 0.5))
    assert not fence.covers((3, 3, 6.5))
    assert not fence.covers((-0.1, 3, 0))
    assert fence.contains((-0.5, 6.5, 6.5), margin_m=0.5)


def test_a_pipe_is_refused_at_once(tmp_path: Path) -> None:
    """To open it would be to wait for a writer."""
    os.mkfifo(tmp_path / "fleet.yaml")
    with pytest.raises(FleetError, match=r"fleet\.yaml: is not a file; name a fleet file"):
        read_fleet(tmp_path / "fleet.yaml")
