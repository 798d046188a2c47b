"""`kill -USR1`: a search stops as if its time was over, and tells the best so far."""

from __future__ import annotations

import itertools
import json
import signal
from pathlib import Path
from typing import Any

import pytest

from robochoc.app.sketch.building import model_of
from robochoc.journal.events import Heard
from robochoc.journal.reader import Follower
from robochoc.system.stopping import STOP, stop_handled, stop_requested
from tests.support.faults import PROGRAM, running
from tests.support.limits import HANG_S, wait_until
from tests.support.program import ROOT, robochoc_within
from tests.support.slot_sketches import slots


@pytest.mark.more
@pytest.mark.parametrize("runtime", ["simulator", "processes"])
def test_that_it_tells_the_best_so_far(tmp_path: Path, runtime: str) -> None:
    team, journal = tmp_path / "team", tmp_path / "run.journal"
    model_of(slots(14, 14)).save(team)
    command = [PROGRAM, "solve", str(team), "--protocol", "syncbb", "--runtime", runtime, "--json"]
    with running([*command, "--journal", str(journal)], tmp_path) as run:
        wait_until(journal.is_file, "it never began")
        with journal.open("rb") as file:
            follower = Follower(file)
            wait_until(lambda: any(isinstance(line, Heard) for line in follower.read()), "nothing was found")
        run.strike(STOP)
        run.end()
        assert run.status() == 3, run.errors()
        assert "somebody has asked to stop" in run.errors()
        assert run.left_behind() == []
    told_best_so_far(json.loads((tmp_path / "stdout").read_bytes()))


@pytest.mark.parametrize(
    ("signum", "status"),
    [
        (STOP, 0),
        *(
            pytest.param(signum, status, marks=pytest.mark.more)
            for signum, status in ((signal.SIGTERM, 143), (signal.SIGINT, 130), (signal.SIGKILL, -9))
        ),
    ],
)
def test_while_better_answers_are_searched_for(tmp_path: Path, signum: signal.Signals, status: int) -> None:
    """Whatever ends the run then, no process and no half-written file is left."""
    team, place = ROOT / "docs" / "examples" / "patrol", tmp_path / "run.mcap"
    words = ["--protocol", "dsa", "--set", "cycles=1000000", "--deadline", "0.3", "--improve", "600"]
    with running([PROGRAM, "solve", str(team), *words, "--ros", f"mcap:{place}"], tmp_path) as run:
        wait_until(lambda: "a solution of cost" in run.errors(), "nothing was published")
        run.strike(signum)
        run.end()
        assert run.status() == status, run.errors()
        assert run.left_behind() == []
    assert place.exists() == (signum is STOP)
    if signum is STOP:
        assert "by the deadline of 0.3 s" in (tmp_path / "stdout").read_text()


def test_a_search_in_the_simulator_stops_with_the_best_so_far(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The signal comes at the 20th look whether somebody has asked to stop."""
    model_of(slots(14, 14)).save(tmp_path / "team")
    looks = itertools.count()

    def asked() -> bool:
        if next(looks) == 20:
            signal.raise_signal(STOP)
        return stop_requested()

    monkeypatch.setattr("robochoc.communication.simulator.simulator.stop_requested", asked)
    words = ("--protocol", "syncbb", "--runtime", "simulator", "--timeout", HANG_S, "--json")
    done = robochoc_within("solve", tmp_path / "team", *words)
    assert (done.returncode, "somebody has asked to stop" in done.stderr) == (3, True)
    told_best_so_far(json.loads(done.stdout))


def told_best_so_far(result: dict[str, Any]) -> None:
    assert result["verdict"] == "unknown"
    assert result["reason"] == "somebody has asked to stop"
    assert result["cost"] == sum(range(1, 15))
    assert len(result["assignment"]) == 14


def test_that_it_is_heard_meanwhile_only() -> None:
    before = signal.getsignal(STOP)
    with stop_handled():
        assert not stop_requested()
        signal.raise_signal(STOP)
        assert stop_requested()
    assert not stop_requested()
    assert signal.getsignal(STOP) is before
