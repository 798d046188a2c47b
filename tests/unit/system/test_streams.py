"""Output never waits for its reader, is complete and in order once it is read, and never holds up the end."""

from __future__ import annotations

import errno
import os
import subprocess
import sys
from pathlib import Path

import pytest

from robochoc.system import files
from robochoc.system.files import AppendableFile
from robochoc.system.streams import BackgroundWriter
from tests.support.limits import HANG_S
from tests.support.program import ROOT, unmeasured

LINES = [b"%06d %s\n" % (number, b"x" * (number % 300)) for number in range(4000)]


def all_of(descriptor: int) -> bytes:
    """Return what is read from a pipe until all writers have closed it."""
    with os.fdopen(descriptor, "rb") as read:
        return read.read()


def test_output_ahead_of_the_reader_arrives_complete_and_in_order() -> None:
    read, write = os.pipe()
    writer = BackgroundWriter(write, 1 << 20)
    assert all(writer.write(line) for line in LINES)
    assert not writer.finish(0.01), "nobody has read anything"
    assert os.get_blocking(write), "the pipe is shared with other processes"
    got = b""
    while len(got) < sum(map(len, LINES)):
        got += os.read(read, 1 << 16)
    assert got == b"".join(LINES)
    assert writer.finish(HANG_S)
    assert writer.write(b"more")
    writer.close()
    assert all_of(read) == b"more"


def test_a_reader_that_has_gone_is_an_error() -> None:
    read, write = os.pipe()
    writer = BackgroundWriter(write, 1 << 20)
    assert all(writer.write(line) for line in LINES)
    os.close(read)
    with pytest.raises(BrokenPipeError):
        writer.finish(HANG_S)
    with pytest.raises(BrokenPipeError):
        writer.write(b"more")
    writer.close()


def test_a_file_that_grows_into_a_pipe_names_a_reader_that_is_too_slow(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(files, "MAX_AHEAD", 1 << 18)
    monkeypatch.setattr(files, "READER_PATIENCE_S", 0.01)
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    reader = os.open(pipe, os.O_RDONLY | os.O_NONBLOCK)
    file = AppendableFile(pipe, b"")
    with pytest.raises(OSError, match="behind") as behind:
        list(map(file.append, LINES))
    assert behind.value.errno == errno.ENOBUFS
    with pytest.raises(OSError, match="has not read any data"):
        file.close()
    os.close(reader)  # the writer's thread ends, and closes the pipe


def test_unread_standard_error_delays_neither_a_run_nor_its_end() -> None:
    """Four megabytes of lines; then the reader gets what there was room for, and the number of other lines."""
    code = (
        "import sys\n"
        "from robochoc.cli import group, main\n"
        "from robochoc.system import streams\n"
        "streams.PATIENCE_S = float(sys.argv[1])\n"
        "def run():\n"
        "    for number in range(40_000): print(f'{number:0100}', file=sys.stderr)\n"
        "    print('done', flush=True)\n"
        "    sys.stdin.read()\n"
        "    print('end', file=sys.stderr)\n"
        "group.run = run\n"
        "main.main()\n"
    )
    environment = {**unmeasured(), "PYTHONPATH": str(ROOT)}
    for is_read, patience_s in ((True, HANG_S), (False, 0.1)):
        command, pipe = [sys.executable, "-c", code, str(patience_s)], subprocess.PIPE
        with subprocess.Popen(command, env=environment, stdin=pipe, stdout=pipe, stderr=pipe) as program:
            assert program.stdin
            assert program.stdout
            assert program.stderr
            assert program.stdout.readline() == b"done\n"
            if not is_read:
                program.stdin.close()
                assert program.wait(HANG_S) == 0
                continue
            lines = [program.stderr.readline() for _ in range(10_000)]
            program.stdin.close()
            lines += program.stderr.readlines()
            assert program.wait(HANG_S) == 0
            assert [int(line) for line in lines[:10_000]] == [*range(10_000)]
            assert b"lines were dropped" in lines[-2]
            assert lines[-1] == b"end\n"
