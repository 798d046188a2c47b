"""DDS: whoever is killed, at once and without a word, leaves nothing behind, and keeps nobody."""

from __future__ import annotations

import os
import signal
import subprocess
from pathlib import Path

import pytest

from tests.support.dds import LOOPBACK_ALONE, ServiceClient, free_domain, subscriber
from tests.support.limits import HANG_S, wait_until
from tests.support.program import PROGRAM, ROOT, robochoc

pytestmark = [pytest.mark.slow, pytest.mark.timeout(300)]

HANGAR = str(ROOT / "docs" / "examples" / "hangar")
TOPICS = {f"/{name}/waypoint": "PoseStamped" for name in ("fin", "nose", "port", "roof", "starboard", "tail")}


@pytest.fixture(autouse=True)
def _loopback(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("CYCLONEDDS_URI", LOOPBACK_ALONE)
    monkeypatch.delenv("ROS_DOMAIN_ID", raising=False)


def members(session: int) -> list[int]:
    """The processes of that session that live."""
    found = []
    for folder in Path("/proc").glob("[0-9]*"):
        try:
            status = (folder / "stat").read_text(encoding="utf-8").rpartition(")")[2].split()
        except OSError:
            continue
        if int(status[3]) == session and status[0] != "Z":
            found.append(int(folder.name))
    return found


def started(*words: str) -> subprocess.Popen[str]:
    """The program, with a session of its own."""
    return subprocess.Popen(
        [PROGRAM, *words], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, start_new_session=True
    )


def has_joined(domain: int) -> bool:
    """Whether somebody has the first port of that domain."""
    port = f"{7410 + 250 * domain:04X}"
    return any(
        line.split()[1].endswith(f":{port}") for line in Path("/proc/net/udp").read_text("utf-8").splitlines()[1:]
    )


def test_a_run_that_is_killed_leaves_nothing() -> None:
    domain = free_domain()
    with started("solve", HANGAR, "--ros", f"dds:{domain}?wait=600") as run:
        wait_until(lambda: has_joined(domain), "it has not joined")
        os.kill(run.pid, signal.SIGKILL)
        wait_until(lambda: not members(run.pid), lambda: f"left are {members(run.pid)}")
        run.communicate(timeout=HANG_S)
    assert not has_joined(domain)
    with subscriber(domain, TOPICS) as peer:
        done = robochoc("solve", HANGAR, "--ros", f"dds:{domain}?wait={HANG_S:g}", "--runtime", "simulator")
        assert done.returncode == 0, done.stderr
        assert len([*peer.rest()]) == len(TOPICS), "the next run is as any other"


def test_a_subscriber_that_is_killed_does_not_keep_a_run() -> None:
    domain = free_domain()
    with subscriber(domain, TOPICS) as peer:
        words = ["--ros", f"dds:{domain}?wait={HANG_S:g}", "--protocol", "dynabt"]
        with started("solve", HANGAR, *words, "--situation", f"dds:{domain}", "--report-timeout", "2") as run:
            peer.heard()
            os.kill(peer.process.pid, signal.SIGKILL)
            _, told = run.communicate(timeout=HANG_S)
        assert "Traceback" not in told
        assert run.returncode == 0 or "has not acknowledged any message for 10 s" in told
        assert not members(run.pid)


def test_a_service_that_is_killed_leaves_nothing_and_a_client_that_is_keeps_none() -> None:
    domain = free_domain()
    services = {"/robochoc/decide": "Decide"}
    with started("serve", HANGAR, "--ros", f"dds:{domain}") as server:
        with ServiceClient(domain, services) as client:
            client.begin("/robochoc/decide", {"team": "hangar"})
            os.kill(client.process.pid, signal.SIGKILL)
        with ServiceClient(domain, services) as client:
            assert client.ask("/robochoc/decide", team="hangar")["verdict"] == "solution"
        os.kill(server.pid, signal.SIGKILL)
        wait_until(lambda: not members(server.pid), lambda: f"left are {members(server.pid)}")
        server.communicate(timeout=HANG_S)
    assert not has_joined(domain)
