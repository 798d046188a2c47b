"""A stranger who has the address sends thousands of events that no page sends: the application goes on."""

from __future__ import annotations

import asyncio
import signal
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from pathlib import Path
from random import Random

import pytest

from robochoc.app.sketch.example_sketches import examples
from robochoc.app.store import TeamStore
from tests.support.app_server import AppServer
from tests.support.examples import count
from tests.support.hostile_client import HostileClient, faults_of_ours
from tests.support.limits import HANG_S

SEED = 22
MOST_GROWN_KB = 400_000
"""Memory that the events may take, whatever they say. A hundredth of what they would with a text of 1 MB each."""
AREAS = ("model", "decide", "whatif", "fly", "compare", "play")
PAGES = ("", *(f"team/{{team}}/{area}" for area in AREAS), "lessons", "lessons/1")


def _memory_kb(server: AppServer) -> int:
    status = Path(f"/proc/{server.process.pid}/status")
    lines = status.read_text().splitlines() if status.exists() else ()
    return next((int(line.split()[1]) for line in lines if line.startswith("VmRSS")), 0)


@pytest.fixture
def server(tmp_path: Path) -> Iterator[AppServer]:
    """An application of the test's own, as what goes wrong in it is looked at."""
    server = AppServer(tmp_path / "teams")
    try:
        yield server
    finally:
        server.end(signal.SIGKILL)


async def _attack(server: AppServer, teams: TeamStore, chance: Random, events: int) -> None:
    aiohttp = pytest.importorskip("aiohttp")
    sketches = [*examples().values()]
    async with aiohttp.ClientSession(timeout=aiohttp.ClientTimeout(HANG_S)) as session:
        for page in PAGES:
            url = server.url + page.format(team=teams.add(chance.choice(sketches)))
            client = HostileClient(url, server.url, session)
            await client.open()
            await client.send(chance, events)
            async with session.get(url) as answer:
                assert answer.status == 200, (page, SEED)
            await client.close()


@count("events", 100, 3_000)
def test_events_that_no_page_sends_break_nothing(server: AppServer, tmp_path: Path, events: int) -> None:
    before = _memory_kb(server)
    attack = partial(_attack, server, TeamStore(tmp_path / "teams"), Random(SEED), events)
    with ThreadPoolExecutor(1) as thread:  # Playwright keeps the loop of this one, after tests with a browser
        thread.submit(lambda: asyncio.run(attack())).result()
    assert _memory_kb(server) - before < MOST_GROWN_KB
    server.process.send_signal(signal.SIGINT)
    assert server.process.wait(HANG_S) == 0
    assert server.process.stderr is not None
    assert server.process.stderr.read().count("\n") <= 1, "only where errors are kept is told in the terminal"
    log = tmp_path / "teams" / "errors.log"
    assert [*faults_of_ours(log.read_text(encoding="utf-8"))] == [], SEED
