"""Jobs end: by themselves, by being asked, by being ended, by a fault; and nothing of them stays."""

from __future__ import annotations

import asyncio
import logging
import os
import signal
import threading
from collections.abc import Iterator
from pathlib import Path

import pytest

from robochoc.app.jobs.job import EndedError, Job, LateError, end_all, end_jobs_in, event_loop_caller, jobs_alive
from robochoc.app.jobs.process import Command, Finished
from robochoc.app.listeners import Listeners
from robochoc.app.log import ERROR_LOG
from tests.support.limits import HANG_S, wait_until

ENDLESS = """
import os, signal, sys
child = os.fork()
if child == 0:
    signal.pause()
{before}
print("listening", flush=True)
while True:
    signal.pause()
"""


@pytest.fixture(autouse=True)
def nothing_stays() -> Iterator[None]:
    """End what a test has started; all tests look that nothing is left."""
    yield
    end_all(HANG_S)


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder whose modules processes find."""
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join(filter(None, [str(tmp_path), os.environ.get("PYTHONPATH")])))
    return tmp_path


def endless(folder: Path, before: str = "") -> Command:
    (folder / "endless.py").write_text(ENDLESS.format(before=before), encoding="utf-8")
    return Command((), folder, module="endless", out=folder / "out")


def listening(folder: Path) -> None:
    file = folder / "out"
    wait_until(lambda: file.is_file() and b"listening" in file.read_bytes(), "its process does not begin")


def quick_job(told: list[str]) -> Job[Finished]:
    return Job("test", lambda _: Finished(0, b"", ""), on_incomplete=told.append)


class TestProcess:
    def test_that_it_tells_what_it_wrote_and_how_it_ended(self, folder: Path) -> None:
        text = "import sys; print(sys.stdin.read()[::-1]); sys.exit('no\\nway')"
        (folder / "said.py").write_text(text, encoding="utf-8")
        command = Command((), folder, module="said", given=b"abc")
        finished = Job("test", lambda job: job.run(command)).start().future.result(HANG_S)
        assert finished == Finished(1, b"cba\n", "no\nway")
        assert finished.why == "no\nway"
        assert Finished(3, b"", "").why == "exit status 3"
        assert Finished(-9, b"", "").why == "SIGKILL"

    def test_that_all_of_its_group_is_ended_with_it(self, folder: Path) -> None:
        told: list[str] = []
        job = Job("test", lambda job: job.run(endless(folder)), on_incomplete=told.append).start()
        listening(folder)
        pid = job.pid
        assert pid
        assert jobs_alive() == [job]
        job.end()
        with pytest.raises(EndedError):
            job.future.result(HANG_S)
        assert told == [""]
        assert job.pid is None
        job.end()  # its number may be another one's by now
        assert job.join(HANG_S)
        assert jobs_alive() == []
        wait_until(lambda: _is_gone(pid), "its group lives on")

    @pytest.mark.parametrize(
        ("before", "status"),
        [("", -signal.SIGTERM), ("signal.signal(signal.SIGTERM, signal.SIG_IGN)", -signal.SIGKILL)],
    )
    def test_that_it_is_asked_and_then_ended(self, folder: Path, before: str, status: int) -> None:
        stopping = ((0.0, signal.SIGTERM), (0.0, signal.SIGKILL) if before else (HANG_S, signal.SIGKILL))
        job = Job("test", lambda job: job.run(endless(folder, before)), stopping=stopping).start()
        listening(folder)
        job.stop()
        assert job.future.result(HANG_S).status == status

    def test_that_one_that_takes_too_long_is_ended(self, folder: Path) -> None:
        job = Job("test", lambda job: job.run(endless(folder), within_s=0)).start()
        with pytest.raises(LateError):
            job.future.result(HANG_S)

    def test_that_a_fault_in_whoever_looks_ends_it(self, folder: Path, caplog: pytest.LogCaptureFixture) -> None:
        told: list[str] = []

        def look() -> None:
            raise KeyError("unforeseen")

        job = Job("looked at", lambda job: job.run(endless(folder), look), on_incomplete=told.append).start()
        with pytest.raises(KeyError):
            job.future.result(HANG_S)
        assert told == ["That did not work. The team is unchanged."]
        assert "looked at: KeyError" in caplog.text
        assert "Traceback" in caplog.text

    def test_that_one_that_cannot_be_started_says_why(self, tmp_path: Path) -> None:
        told: list[str] = []
        job = Job("test", lambda job: job.run(Command((), tmp_path / "gone")), on_incomplete=told.append).start()
        with pytest.raises(FileNotFoundError):
            job.future.result(HANG_S)
        assert told == ["The data cannot be saved: No such file or directory."]


class TestEnd:
    def test_that_one_that_has_not_begun_does_nothing(self) -> None:
        told: list[str] = []
        job = quick_job(told)
        job.end()
        with pytest.raises(EndedError):
            job.start().future.result(HANG_S)
        assert told == [""]

    def test_that_those_of_a_folder_are_ended_and_no_others(self, tmp_path: Path) -> None:
        release = threading.Event()

        def works(job: Job[None]) -> None:
            release.wait(HANG_S)
            job.check()

        jobs = {name: Job(name, works, folder=tmp_path / name).start() for name in ("a", "a/runs/1", "ab", "b")}
        assert {job.name for job in end_jobs_in(tmp_path / "a")} == {"a", "a/runs/1"}
        release.set()
        assert all(job.join(HANG_S) for job in jobs.values())
        ended = {name for name, job in jobs.items() if isinstance(job.future.exception(HANG_S), EndedError)}
        assert ended == {"a", "a/runs/1"}

    def test_that_all_are_told_in_time_though_one_computes_on(self) -> None:
        told: list[str] = []
        release = threading.Event()
        job = Job("test", lambda _: release.wait(HANG_S), on_incomplete=told.append).start()
        end_all(0)
        assert told == [""]
        release.set()
        assert job.join(HANG_S)
        assert told == [""]  # once

    def test_that_a_failing_over_does_not_keep_it_from_its_end(self, caplog: pytest.LogCaptureFixture) -> None:
        def fails(why: str) -> None:
            raise OSError(why)

        def works(_: Job[None]) -> None:
            raise ZeroDivisionError

        with pytest.raises(ZeroDivisionError):
            Job("test", works, on_incomplete=fails).start().future.result(HANG_S)
        assert [record.getMessage() for record in caplog.records] == ["test: ZeroDivisionError", "test: OSError"]


class TestCalls:
    def test_that_the_loop_is_told_in_its_own_thread(self) -> None:
        async def told() -> threading.Thread:
            heard: asyncio.Future[threading.Thread] = asyncio.get_running_loop().create_future()
            call = event_loop_caller()
            thread = threading.Thread(target=call, args=(lambda: heard.set_result(threading.current_thread()),))
            thread.start()
            return await heard

        assert asyncio.run(told()) is threading.current_thread()

    def test_that_nobody_is_told_after_the_loop_is_closed(self) -> None:
        async def call() -> object:
            return event_loop_caller()

        heard: list[int] = []
        told = asyncio.run(call())
        assert callable(told)
        told(lambda: heard.append(1))
        event_loop_caller()(lambda: heard.append(2))
        assert heard == [2]


def test_a_listener_that_fails_keeps_nobody_from_being_told(caplog: pytest.LogCaptureFixture) -> None:
    heard: list[int] = []
    listeners = Listeners()

    def fails() -> None:
        raise ZeroDivisionError("unforeseen")

    listeners.add(lambda: heard.append(1))
    end = listeners.add(fails)
    listeners.add(lambda: heard.append(2))
    with caplog.at_level(logging.ERROR, ERROR_LOG.name):
        listeners()
    assert heard == [1, 2]
    assert "listener: ZeroDivisionError" in caplog.text
    assert len(listeners) == 3
    end()
    assert len(listeners) == 2


def _is_gone(group: int) -> bool:
    try:
        os.killpg(group, 0)
    except ProcessLookupError:
        return True
    return False
