"""A full disk: the error names the file that the user has asked for, whatever is written in its place meanwhile."""

from __future__ import annotations

import errno
import resource
import signal
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from robochoc.formats import write_team
from robochoc.journal.recorder import JournalFile
from robochoc.system import files
from robochoc.system.files import PendingFile, write_atomically
from tests.support.program import ROOT, unmeasured
from tests.support.small_teams import pair

ROOM = 100
HERE = {**unmeasured(), "PYTHONPATH": str(ROOT)}


@contextmanager
def room_for(size: int) -> Iterator[None]:
    """Let files have so many bytes: the system's answer to more is as that of a full disk, with another number."""
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    handler = signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, before[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)
        signal.signal(signal.SIGXFSZ, handler)


def pending(path: Path) -> None:
    """Write a file by its stream."""
    file = PendingFile(path)
    file.stream.write(bytes(2 * ROOM))
    file.keep()


def journal(path: Path) -> None:
    """Write a journal's file, whose second block does not fit."""
    file = JournalFile(path)
    try:
        file.write(bytes(ROOM))
        file.write(bytes(ROOM))
    finally:
        file.close()


@pytest.mark.parametrize("has_unnamed", [1, 0])
@pytest.mark.parametrize(
    "write",
    [pending, journal, lambda path: write_atomically(path, bytes(2 * ROOM)), lambda path: write_team(pair(), path)],
)
def test_an_error_of_a_full_disk_names_the_file(
    write: Callable[[Path], None], has_unnamed: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    if not has_unnamed:
        monkeypatch.setattr(files, "_unnamed", lambda *_: None)
    place = tmp_path / "place"
    with room_for(ROOM), pytest.raises(OSError, match="too large") as full:
        write(place)
    assert full.value.errno == errno.EFBIG
    assert full.value.filename == str(place)
    assert [file.name for file in tmp_path.iterdir()] == (["place"] if write is journal else [])


def test_a_command_whose_output_cannot_be_written_reports_an_error() -> None:
    command = [sys.executable, "-m", "robochoc", "protocols"]
    with Path("/dev/full").open("wb") as full:
        done = subprocess.run(command, stdout=full, stderr=subprocess.PIPE, text=True, check=False, env=HERE)
    assert (done.returncode, done.stderr) == (1, "robochoc: standard output: No space left on device\n")
