"""Runs are started, watched, stopped, and found again."""

from __future__ import annotations

import errno
import os
import shutil
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from random import Random

import msgspec
import pytest

from robochoc.app.jobs.job import Job, end_all
from robochoc.app.runs.options import RunOptions
from robochoc.app.runs.prepared_team import TeamFiles
from robochoc.app.runs.result import RunResult, decoded
from robochoc.app.runs.run import RECORD, Record, Run, RunState
from robochoc.app.runs.runs import Runs
from robochoc.app.sketch.sketch import Cell, Decision, DecisionKind, Sketch, SketchRobot, SketchRule
from robochoc.formats import read_team, write_team
from robochoc.formats.result import read_result, result_json
from robochoc.model.outcome import Outcome, Verdict
from robochoc.model.problem import RemoveAgent
from tests.support.kept_runs import kept_run
from tests.support.limits import HANG_S, wait_until
from tests.support.random_outcomes import random_outcome
from tests.support.slot_sketches import slots
from tests.support.small_teams import triangle


@dataclass(eq=False)
class Team:
    """A team that is no project."""

    sketch: Sketch
    folder: Path


@pytest.fixture(autouse=True)
def nothing_runs_on() -> Iterator[None]:
    """End what a test has started."""
    yield
    end_all()


def until(run: Run, holds: Callable[[], bool]) -> None:
    """Wait for news until `holds`."""
    news = threading.Event()
    end = run.on_change(news.set)
    limit = time.monotonic() + HANG_S
    while not holds() and time.monotonic() < limit:
        news.wait(1)
        news.clear()
    end()
    assert holds()


def ended(run: Run) -> Run:
    until(run, lambda: run.state is not RunState.RUNNING)
    return run


class TestRun:
    def test_that_the_answer_is_that_of_the_command_line(self, tmp_path: Path) -> None:
        runs = Runs(Team(slots(3, 3), tmp_path))
        run = ended(runs.start(RunOptions(protocol="syncbb")))
        assert run.state is RunState.ENDED
        assert run.result is not None
        assert (run.result.verdict, run.result.cost, run.result.protocol) == ("optimal", 6, "syncbb")
        assert {run.result.value(f"Drone{number}", "slot") for number in (1, 2, 3)} == {1, 2, 3}
        assert run.live.messages == run.result.messages > 0
        assert run.command.startswith("robochoc solve Berths --json --journal run.journal --protocol syncbb")
        assert run.artefact("run.journal") == run.folder / "run.journal"
        assert run.artefact("../run.journal") == run.folder / "run.journal"
        assert run.artefact("nothing.html") is None
        again = Runs(Team(Sketch(), tmp_path)).latest
        assert again is not None
        assert (again.state, again.result, again.sketch) == (run.state, run.result, run.sketch)

    def test_that_who_is_above_decides_first(self, tmp_path: Path) -> None:
        robots = SketchRobot("A", Cell(0, 0)), SketchRobot("B", Cell(0, 0), rank=1)
        slot, rule = Decision("slot", DecisionKind.SLOT, (1, 2)), SketchRule("R1", "different", "slot")
        run = ended(Runs(Team(Sketch("pair", robots=robots, decisions=(slot,), rules=(rule,)), tmp_path)).start())
        assert run.result is not None
        assert run.result.value("B", "slot") == 1
        assert "--order given" in run.command

    def test_that_files_decide_as_they_are_and_then_as_what_happens_leaves_them(self, tmp_path: Path) -> None:
        folder, team = tmp_path / "triangle", tmp_path / "kept"
        write_team(triangle(3), folder)
        team.mkdir()
        runs = Runs(Team(Sketch("triangle"), team))
        run = ended(runs.start(files=TeamFiles(folder, flies=False)))
        assert run.result is not None
        assert (run.result.verdict, run.record.flies) == ("solution", False)
        assert read_team(run.team) == read_team(folder)
        last = triangle(3).order[-1]
        again = ended(runs.start(files=TeamFiles(folder, then=(RemoveAgent(last),))))
        assert again.result is not None
        assert [len(epoch.robots) for epoch in again.result.epochs] == [4, 3]

    def test_that_one_that_is_stopped_tells_its_best_so_far(self, tmp_path: Path) -> None:
        runs = Runs(Team(slots(14, 14), tmp_path))
        run = runs.start(RunOptions(protocol="syncbb"))
        until(run, lambda: bool(run.live.costs))
        run.stop()
        ended(run)
        assert run.state is RunState.STOPPED
        assert run.result is not None
        assert (run.result.verdict, run.result.reason) == ("unknown", "somebody has asked to stop")
        assert run.result.cost == sum(range(1, 15))
        assert len(run.result.assignment) == 14

    def test_that_what_stepping_aside_is_charged_is_no_cost(self, tmp_path: Path) -> None:
        run = ended(Runs(Team(slots(4, 3), tmp_path)).start(RunOptions(protocol="syncbb", withdraw=True)))
        assert run.result is not None
        assert (run.result.cost, len(run.result.withdrawn)) == (6, 1)
        assert run.live.messages > 0
        assert (run.live.costs, run.live.bound) == ([], None)

    def test_that_what_cannot_be_fails_with_one_clear_message(self, tmp_path: Path) -> None:
        runs = Runs(Team(slots(3, 3), tmp_path))
        run = ended(runs.start(RunOptions(protocol="abt")))
        assert run.state is RunState.FAILED
        assert "abt" in run.message
        assert "\n" not in run.message
        wrong = msgspec.structs.replace(
            slots(2, 2), rules=(SketchRule("R1", "never", "slot", settings={"value": "x"}),)
        )
        run = ended(runs.start(sketch=wrong))
        assert run.state is RunState.FAILED
        assert run.message

    def test_that_values_are_told_as_the_user_says_them_and_a_hostile_name_stays_in_its_folder(
        self, tmp_path: Path
    ) -> None:
        decision = Decision("task", DecisionKind.TASK, ("two words", "<b>it's</b>"))
        rule = SketchRule("R1", "different", "task")
        sketch = slots(2, 2, name="../../--help")
        sketch = msgspec.structs.replace(sketch, decisions=(decision,), rules=(rule,))
        home = tmp_path / "deep" / "in"
        home.mkdir(parents=True)
        runs = Runs(Team(sketch, home))
        run = ended(runs.start())
        assert run.result is not None
        assert {*run.result.values.values()} == {*decision.values}
        assert {value for values in run.live.values.values() for value in values.values()} == {*decision.values}
        again = Runs(Team(sketch, home)).latest
        assert again is not None
        assert again.result == run.result
        assert [one.name for one in tmp_path.iterdir()] == ["deep"]

    def test_that_a_new_one_takes_the_place_of_one_that_still_runs(self, tmp_path: Path) -> None:
        runs = Runs(Team(slots(14, 14), tmp_path))
        first = runs.start(RunOptions(protocol="syncbb"))
        other = runs.start(RunOptions(protocol="syncbb"), purpose="compare")
        second = runs.start(sketch=slots(2, 2))
        assert ended(first).state is RunState.STOPPED
        assert ended(second).state is RunState.ENDED
        assert other.state is RunState.RUNNING

    def test_that_a_fault_nobody_foresaw_ends_it(
        self, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
    ) -> None:
        def fails(_: object) -> None:
            raise ZeroDivisionError("unforeseen")

        monkeypatch.setattr("robochoc.app.runs.live.LiveReader.advance", fails)
        run = ended(Runs(Team(slots(3, 3), tmp_path)).start())
        assert run.state is RunState.FAILED
        assert run.message == "That did not work. The team is unchanged."
        assert "ZeroDivisionError" in caplog.text

    def test_that_a_journal_without_end_does_not_keep_it_running(
        self, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        monkeypatch.setattr("robochoc.app.runs.live.LiveReader.advance", lambda _: True)
        monkeypatch.setattr("robochoc.app.runs.runs.READ_ON_S", 0)
        run = ended(Runs(Team(slots(3, 3), tmp_path)).start())
        assert run.state is RunState.ENDED
        assert run.live.is_cut


class TestWhatIsRemoved:
    def test_that_an_old_run_goes_once_nobody_writes_to_it_any_more(
        self, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        monkeypatch.setattr("robochoc.app.runs.runs.MAX_RUNS", 2)
        old = kept_run(tmp_path, slots(2, 2)).folder
        shutil.copytree(old, old.with_name("00002"))
        was_there: list[bool] = []

        def write(job: Job[None]) -> None:
            wait_until(lambda: job.is_ended and not (old / RECORD).exists(), "the old run is kept")
            was_there.append(old.is_dir())
            old.mkdir(exist_ok=True)
            (old / "late").write_bytes(b"of a thread that computes")

        writing = Job("writes", write, folder=old).start()
        runs = Runs(Team(slots(2, 2), tmp_path))
        run = ended(runs.start())
        assert writing.join(HANG_S)
        _are_left(tmp_path, "00002", run.id)
        assert was_there == [True]
        assert sorted(one.id for one in runs.all()) == ["00002", run.id]

    def test_that_a_full_disk_leaves_nothing(self, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
        def full(*_: object) -> int:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

        runs = Runs(Team(slots(2, 2), tmp_path))
        with monkeypatch.context() as patch:
            patch.setattr(Path, "write_bytes", full)
            with pytest.raises(OSError, match="No space left"):
                runs.start()
        assert [*(tmp_path / "runs").iterdir()] == []
        assert runs.all() == []
        assert ended(runs.start()).state is RunState.ENDED

    def test_that_what_is_no_run_goes_when_a_team_is_opened_again(self, tmp_path: Path) -> None:
        kept = kept_run(tmp_path, slots(2, 2)).folder
        for name in ("00002", "00003", "of somebody"):
            (kept.parent / name / "team").mkdir(parents=True)
            (kept.parent / name / "sketch.json").write_bytes(b"{")
        may_end = threading.Event()
        job = Job("writes", lambda _: may_end.wait(HANG_S), folder=kept.parent / "00003").start()
        try:
            assert [run.folder for run in Runs(Team(slots(2, 2), tmp_path)).all()] == [kept]
            _are_left(tmp_path, "00001", "00003", "of somebody")
        finally:
            may_end.set()
            assert job.join(HANG_S)
        Runs(Team(slots(2, 2), tmp_path))
        _are_left(tmp_path, "00001", "of somebody")


def _are_left(folder: Path, *names: str) -> None:
    """Wait until there are these runs, and no other files beside them."""

    def found() -> list[str]:
        return sorted(one.name for one in (folder / "runs").iterdir())

    wait_until(lambda: found() == [*names], lambda: f"there are {found()}")


class TestAfterTheServersDeath:
    def test_that_broken_runs_are_told_as_such(self, tmp_path: Path) -> None:
        for number, record in enumerate((b"{", msgspec.json.encode(Record(RunOptions())))):
            folder = tmp_path / "runs" / f"{number:05}"
            folder.mkdir(parents=True)
            (folder / RECORD).write_bytes(record)
        second, first = Runs(Team(slots(2, 2), tmp_path)).all()
        assert (first.state, first.message) == (RunState.FAILED, "broken")
        assert (second.state, second.message) == (RunState.FAILED, "lost")

    @pytest.mark.slow
    @pytest.mark.skipif(sys.platform != "linux", reason="the kernel tells of a parent's death there")
    def test_that_no_process_is_left_by_kill_9(self, tmp_path: Path) -> None:
        program = (
            "import sys, time\n"
            "from pathlib import Path\n"
            "from robochoc.app.runs.options import RunOptions\n"
            "from robochoc.app.runs.runs import Runs\n"
            "from tests.support.slot_sketches import slots\n"
            "class Team: sketch = slots(14, 14); folder = Path(sys.argv[1])\n"
            "run = Runs(Team()).start(RunOptions(protocol='syncbb', runtime='processes'))\n"
            "while run.live.messages == 0: time.sleep(0.05)\n"
            "print(run.pid, flush=True)\n"
            "time.sleep(600)\n"
        )
        with subprocess.Popen([sys.executable, "-c", program, str(tmp_path)], stdout=subprocess.PIPE) as server:
            assert server.stdout
            group = int(server.stdout.readline())
            os.killpg(group, 0)
            server.send_signal(signal.SIGKILL)
        ended_by = threading.Event()
        for _ in range(int(HANG_S) * 10):
            try:
                os.killpg(group, 0)
            except ProcessLookupError:
                return
            ended_by.wait(0.1)
        pytest.fail("there are processes left")


# Results


def test_no_field_is_dropped() -> None:
    chance = Random(2)
    for _ in range(100):
        content = result_json(random_outcome(chance))
        found = decoded(content + b"\n")
        assert found is not None
        assert found.parts(Outcome) == read_result(content).parts(Outcome)


def test_a_result_with_many_missing_fields_is_read() -> None:
    least = b'{"team":"t","protocol":"abt","runtime":"simulator","seed":1,"verdict":"solution"}\n'
    assert decoded(least) == RunResult(Verdict.SOLUTION, team="t", protocol="abt", runtime="simulator", seed=1)
    assert decoded(b'{"verdict":"solution"}\n') is None
    assert decoded(b'{"verdict":"none"}\n') is None
