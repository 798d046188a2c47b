"""The application ends in time whatever it does, and says of each run how it ended. It runs in a process of its own."""

from __future__ import annotations

import signal
import subprocess
import sys
from pathlib import Path

import msgspec
import pytest

pytest.importorskip("nicegui")

from robochoc.app.projects import Projects
from robochoc.app.runs.run import Record, RunState
from robochoc.app.runs.runs import runs_of
from robochoc.app.store import TeamStore
from tests.support.limits import HANG_S

SERVER = """
import asyncio, itertools, sys, threading
from pathlib import Path
from nicegui import app, run
from robochoc.app import server
from robochoc.app.runs.options import RunOptions
from robochoc.app.runs.runs import runs_of
from tests.support.slot_sketches import slots

really, phase, kept = server.routes.install, sys.argv[1], []

def busy(*_):
    print("ready", flush=True)
    for _ in itertools.count():
        pass

async def begin(projects):
    project = projects.add(slots(14, 14))
    loop = asyncio.get_running_loop()
    if phase == "decides":
        decides = runs_of(project).start(RunOptions(protocol="syncbb", runtime=sys.argv[3]))
        kept.append(decides.on_change(lambda: decides.live.messages and print("ready", flush=True)))
    elif phase == "prepares":
        runs_of(project).start(model=busy)
    elif phase == "looks":
        kept.append(asyncio.ensure_future(run.io_bound(busy)))
    else:
        loop.call_later(0.1, busy)

def install(projects):
    really(projects)
    app.on_startup(lambda: begin(projects))

server.routes.install = install
try:
    server.serve_app(Path(sys.argv[2]))
except KeyboardInterrupt:
    pass
"""


def _ended(folder: Path, phase: str, by: int, runtime: str = "simulator") -> int:
    command = [sys.executable, "-c", SERVER, phase, str(folder), runtime]
    with subprocess.Popen(command, stdout=subprocess.PIPE) as server:
        assert server.stdout
        try:
            assert server.stdout.readline() == b"ready\n"
            server.send_signal(by)
            return server.wait(HANG_S)
        finally:
            server.kill()


def _states(folder: Path) -> list[RunState]:
    return [msgspec.json.decode(one.read_bytes(), type=Record).state for one in folder.glob("*/runs/*/run.json")]


@pytest.mark.slow
@pytest.mark.parametrize(("phase", "by"), [("decides", signal.SIGINT), ("prepares", signal.SIGTERM)])
def test_a_run_is_stopped_with_the_application(tmp_path: Path, phase: str, by: int) -> None:
    _ended(tmp_path, phase, by)
    assert _states(tmp_path) == [RunState.STOPPED]
    assert not (tmp_path / "errors.log").exists()


@pytest.mark.slow
@pytest.mark.parametrize("phase", ["looks", "blocks"])
def test_who_computes_does_not_keep_it_from_its_end(tmp_path: Path, phase: str) -> None:
    assert _ended(tmp_path, phase, signal.SIGINT) == 0


@pytest.mark.slow
@pytest.mark.parametrize("runtime", ["simulator", "processes"])
def test_after_kill_9_no_run_goes_on(tmp_path: Path, runtime: str) -> None:
    assert _ended(tmp_path, "decides", signal.SIGKILL, runtime) == -signal.SIGKILL
    assert _states(tmp_path) == [RunState.RUNNING]
    projects = Projects(TeamStore(tmp_path))
    (run,) = runs_of(projects.open(projects.store.ids()[0])).all()
    assert (run.state, run.message) == (RunState.FAILED, "lost")
    assert _states(tmp_path) == [RunState.FAILED]
