"""Robots on machines that only a link joins: network namespaces with cables, and with a bad line, between them."""

from __future__ import annotations

import time
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import pytest

from robochoc.formats import write_team
from robochoc.model.problem import Constraint
from robochoc.run import Options, Runtime, solve
from tests.support.deployments import CROWD, TRIANGLE, Deployment, Program, ended, enrolled
from tests.support.journal_entries import entries_of
from tests.support.namespaces import DELAY_S, LOSS, TUN, Link, bad_line, namespaces, route, veth, why_not
from tests.support.problems import PREDICATES, team_of
from tests.support.program import ROOT
from tests.support.warm_programs import WarmPrograms

WHY_NOT = why_not()
pytestmark = pytest.mark.skipif(bool(WHY_NOT), reason=WHY_NOT or "there are namespaces")
needs_tun = pytest.mark.skipif(not TUN.exists(), reason=f"a line that loses packets needs {TUN}")

FOUR = ROOT / "instances" / "queens3d-4"
PORT = 7447
HILL, FIELD = "10.77.1.1", "10.77.1.2"
OUTAGE_S = 5.0


class Apart(NamedTuple):
    """A master on the hill, robots in the field, and a bad line between them."""

    site: Deployment
    hill: str
    field: str
    line: Link


@pytest.fixture
def apart(tmp_path: Path, warm: WarmPrograms, request: pytest.FixtureRequest) -> Iterator[Apart]:
    loss = getattr(request, "param", LOSS)
    with (
        namespaces(2) as (hill, field),
        bad_line((hill, f"{HILL}/24"), (field, f"{FIELD}/24"), seed=6, loss=loss) as line,
        Deployment(tmp_path, HILL, PORT, warm) as site,
    ):
        yield Apart(site, hill, field, line)


def robots(site: Deployment, files: Path, tokens: dict[str, str], where: str, *words: object) -> list[Program]:
    return [site.robot(files / f"{n}.xml", "--token", t, *words, inside=where) for n, t in tokens.items()]


@pytest.mark.more
def test_three_machines_that_only_cables_join(tmp_path: Path, warm: WarmPrograms) -> None:
    with namespaces(3) as (hill, east, west), Deployment(tmp_path, HILL, PORT, warm) as site:
        veth((hill, f"{HILL}/24"), (east, f"{FIELD}/24"))
        veth((hill, "10.77.2.1/24"), (west, "10.77.2.2/24"))
        route(west, "10.77.1.0/24", "10.77.2.1")
        files, tokens = enrolled(TRIANGLE, site)
        master = site.master("--team", files, "--json", inside=hill)
        crew = {
            name: site.robot(files / f"{name}.xml", "--token", token, inside=where)
            for (name, token), where in zip(tokens.items(), (east, west, east), strict=True)
        }
        assert master.status() == 0, master.errors
        told = master.object
        assert (told["verdict"], told["runtime"]) == ("no-solution", "network")
        assert {"Ok", "Nogood"} <= told["metrics"]["messages_by_type"].keys()
        ended(crew)


@pytest.mark.more
def test_a_master_with_an_address_for_each_cable(tmp_path: Path, warm: WarmPrograms) -> None:
    pair = team_of(dict.fromkeys("AB", range(1, 3)), [Constraint("C", PREDICATES[0], ("A", "B"), ("A", "B"))])
    write_team(pair, tmp_path / "pair")
    everywhere = "0.0.0.0"  # noqa: S104 - of a namespace
    with namespaces(3) as (hill, *fields), Deployment(tmp_path, everywhere, PORT, warm) as site:
        here = {name: f"10.77.{number}.1" for number, name in enumerate(fields)}
        for name, address in here.items():
            veth((hill, f"{address}/24"), (name, f"{address[:-1]}2/24"))
        tokens = site.enrol("RA", "RB")
        hosts = [word for address in here.values() for word in ("--host", address)]
        master = site.master("--json", *hosts, inside=hill)
        crew = {}
        for (robot, token), (name, address) in zip(tokens.items(), here.items(), strict=True):
            words = ("robot", tmp_path / "pair" / f"{robot}.xml", "--token", token, "--master", f"{address}:{PORT}")
            crew[robot] = site.start(robot, *words, inside=name)
        assert master.status() == 0, master.errors
        assert master.object["verdict"] == "solution"
        ended(crew)


def expected() -> dict[str, int]:
    """The messages that the crowd needs."""
    outcome = solve(CROWD, Options(runtime=Runtime.SIMULATOR, protocol="sbt"))
    assert outcome.verdict == "no-solution"
    return dict(outcome.metrics.messages)


def crowd(apart: Apart, *words: object) -> tuple[Program, list[Program], Path]:
    """The crowd on the bad line; all are there."""
    files, journal = apart.site.folder / "crowd", apart.site.folder / "crowd.jsonl"
    write_team(CROWD, files)
    tokens = apart.site.enrol("--team", files)
    watched = ("--protocol", "sbt", "--json", "--journal", journal, "--timeout", 90)
    master = apart.site.master(*watched, *words, inside=apart.hill)
    crew = robots(apart.site, files, tokens, apart.field, "--patience", 60)
    master.wait_to_say(" has registered", len(tokens))
    return master, crew, journal


def nothing_was_lost(master: Program, journal: Path) -> float:
    """Every message that was sent was received, and there were as many as there have to be; how long that took."""
    told = master.object
    messages = expected()
    assert (told["verdict"], told["withdrawn"]) == ("no-solution", [])
    assert told["metrics"]["messages_by_type"] == messages
    events = [entry["event"] for entry in entries_of(journal)]
    assert events.count("Sent") == events.count("Received") == sum(messages.values())
    assert "is lost" not in master.errors
    assert "refused" not in master.errors
    took: float = told["metrics"]["wall_s"]
    assert took > 2 * DELAY_S * sum(messages.values())  # there and back: messages go by the master's router
    return took


@needs_tun
@pytest.mark.slow
def test_a_line_that_delays_and_loses(apart: Apart) -> None:
    master, crew, journal = crowd(apart)
    assert master.status() == 0, master.errors
    ended({str(number): robot for number, robot in enumerate(crew)})
    nothing_was_lost(master, journal)


@needs_tun
@pytest.mark.slow
@pytest.mark.parametrize("apart", [0.1], indirect=True)
@pytest.mark.parametrize("protocol", ["abt", "dpop", "mgm"])
def test_one_packet_in_ten_lost_makes_no_verdict_wrong_and_nobody_wait_for_ever(apart: Apart, protocol: str) -> None:
    files, tokens = enrolled(TRIANGLE, apart.site)
    words = ("--team", files, "--protocol", protocol, "--set", "cycles=10") if protocol == "mgm" else (
        "--team", files, "--protocol", protocol,
    )  # fmt: skip
    master = apart.site.master(*words, "--json", "--timeout", 60, "--patience", 30, inside=apart.hill)
    robots(apart.site, files, tokens, apart.field, "--patience", 60)
    status = master.status(110)
    assert status in {0, 3}, master.errors
    assert master.object["verdict"] in ({"unknown"} if protocol == "mgm" else {"no-solution", "unknown"})


@needs_tun
@pytest.mark.slow
def test_queens_on_a_line_that_delays_and_loses(apart: Apart) -> None:
    tokens = apart.site.enrol("--team", FOUR)
    words = ("--team", FOUR, "--json", "--timeout", 100, "--patience", 30)
    master = apart.site.master(*words, inside=apart.hill)
    crew = robots(apart.site, FOUR, tokens, apart.field, "--patience", 60)
    assert master.status(110) == 0, master.errors
    assert master.object["verdict"] == "no-solution"
    ended({str(number): robot for number, robot in enumerate(crew)})


@needs_tun
@pytest.mark.slow
def test_a_line_that_is_down_for_a_while(apart: Apart) -> None:
    master, crew, journal = crowd(apart, "--patience", 60)
    time.sleep(1)
    apart.line.set("down")
    time.sleep(OUTAGE_S)
    assert master.is_running
    apart.line.set("up")
    assert master.status() == 0, master.errors
    ended({str(number): robot for number, robot in enumerate(crew)})
    assert nothing_was_lost(master, journal) > OUTAGE_S
