"""Temporary files: in the folder that the user chose, without a name, and without the trial that `tempfile` makes."""

from __future__ import annotations

import os
import re
import subprocess
import sys
import tempfile
import threading
from pathlib import Path

import pytest

from robochoc.system import temporary_files
from robochoc.system.temporary_files import PrivateFolder, temporary_folder, unnamed_file
from tests.support.limits import HANG_S

SOURCE = Path(temporary_files.__file__).parents[1]


@pytest.fixture(autouse=True)
def _never_tried(monkeypatch: pytest.MonkeyPatch) -> None:
    def trial(*_: object) -> None:
        raise AssertionError("a killed process would leave this file")

    monkeypatch.setattr(tempfile, "tempdir", None)
    monkeypatch.setattr(tempfile, "_get_default_tempdir", trial)


def test_an_unnamed_file_is_written_and_read_and_no_folder_shows_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("TMPDIR", str(tmp_path))
    with unnamed_file() as file:
        file.write(b"abc")
        file.seek(0)
        assert (file.read(), os.fstat(file.fileno()).st_nlink, list(tmp_path.iterdir())) == (b"abc", 0, [])
        assert os.fstat(file.fileno()).st_dev == tmp_path.stat().st_dev


def test_unbuffered_bytes_are_there_at_once(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("TMPDIR", str(tmp_path))
    with unnamed_file(buffered=False) as file:
        file.write(b"abc")
        assert os.fstat(file.fileno()).st_size == 3


def test_the_folder_is_the_first_that_can_be_written_to(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("TMPDIR", str(tmp_path / "missing"))
    monkeypatch.setenv("TEMP", str(tmp_path))
    assert temporary_folder() == tmp_path


def test_a_program_that_has_chosen_a_folder_for_tempfile_has_its_choice(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("TMPDIR", "/")
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    assert temporary_folder() == tmp_path


def test_no_folder_at_all(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(os, "access", lambda *_: False)
    with pytest.raises(FileNotFoundError, match="TMPDIR"):
        temporary_folder()


def test_nothing_of_ours_lets_tempfile_choose_the_folder() -> None:
    called = re.compile(r"tempfile\.(?!tempdir)\w+\((?![^\n]*dir=)")
    sources = {file.name: file.read_text(encoding="utf-8") for file in SOURCE.rglob("*.py")}
    assert [f"{name}: {call}" for name, source in sources.items() for call in called.findall(source)] == []


STRUCK = """
import os, random, signal, threading, time
from robochoc.system.temporary_files import PrivateFolder

chance, strikes = random.Random(1), 0

def strike():
    time.sleep(chance.random() * 0.0006)
    os.kill(os.getpid(), signal.SIGINT)

for _ in range(300):
    striker = threading.Thread(target=strike)
    try:
        try:
            striker.start()
            while True:
                with PrivateFolder() as folder:
                    (folder / "file").touch()
        finally:
            striker.join()
    except KeyboardInterrupt:
        strikes += 1
print(strikes)
"""


def test_a_private_folder_is_ones_own_and_gone_afterwards(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("TMPDIR", str(tmp_path))
    with PrivateFolder() as folder:
        (folder / "within").mkdir()
        assert (folder.parent, folder.stat().st_mode & 0o777) == (tmp_path, 0o700)
    assert list(tmp_path.iterdir()) == []


def test_ctrl_c_at_any_moment_leaves_no_private_folder_behind(tmp_path: Path) -> None:
    environment = {**os.environ, "TMPDIR": str(tmp_path)}
    done = subprocess.run(
        [sys.executable, "-c", STRUCK], env=environment, capture_output=True, text=True, timeout=HANG_S, check=False
    )
    assert (done.stdout, done.stderr, list(tmp_path.iterdir())) == ("300\n", "", [])


def test_a_private_folder_goes_where_no_thread_can_be_started(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(_: threading.Thread) -> None:
        raise RuntimeError("can't start new thread")

    monkeypatch.setenv("TMPDIR", str(tmp_path))
    monkeypatch.setattr(threading.Thread, "start", refuse)
    with PrivateFolder():
        pass
    assert list(tmp_path.iterdir()) == []


def test_a_forked_process_leaves_its_parents_folder_alone(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("TMPDIR", str(tmp_path))
    private, here = PrivateFolder(), os.getpid()
    monkeypatch.setattr(os, "getpid", lambda: here + 1)
    private.close()
    assert private.path.exists()
