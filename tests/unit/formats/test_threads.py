"""Robots of one machine read their files in threads (`AgentsContainer`): one at a time uses what libxml2 shares."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest
from lxml import etree

from robochoc.formats import schema as schemas
from robochoc.formats.schema import refused_by, schema_for
from tests.support.broken_case import TEAM, write_files
from tests.support.limits import HANG_S

ROUNDS = 20
PROGRAM = f"""
import os, sys, threading
from pathlib import Path
from robochoc.formats import InvalidInputError, read_robot

def said(path):
    start.wait()
    try:
        read_robot(path)
        answers[path] = "right"
    except InvalidInputError as invalid:
        answers[path] = str(invalid.diagnostics[0].message)

paths = [Path(path) for path in sys.argv[1:]]
for _ in range({ROUNDS}):
    if child := os.fork():  # each time the first schema of its process
        if status := os.waitpid(child, 0)[1]:
            sys.exit(f"status {{status}}")
        continue
    start, answers = threading.Barrier(len(paths)), {{}}
    threads = [threading.Thread(target=said, args=[path]) for path in paths]
    for each in (*(thread.start for thread in threads), *(thread.join for thread in threads)):
        each()
    print(*(f"{{path.stem}}: {{answers.get(path)}}" for path in paths), sep="; ", flush=True)
    os._exit(0)
"""


def test_files_that_are_read_at_the_same_time(tmp_path: Path) -> None:
    """A lost log made wrong files right, and types that two prepared at a time crashed the process."""
    wrong = TEAM["Robot3.xml"].replace('<variable name="V3" domain="D1"/>', '<variable name="V3"/>')
    folders = [tmp_path / str(number) for number in range(4)]
    for folder in folders:
        folder.mkdir()
        write_files(folder, {**TEAM, "Robot3.xml": wrong})
    names = ("Robot1", "Robot3")
    command = [sys.executable, "-c", PROGRAM, *(str(folder / f"{name}.xml") for folder in folders for name in names)]
    done = subprocess.run(command, capture_output=True, text=True, check=False, timeout=HANG_S)
    told = "; ".join(["Robot1: right; Robot3: <variable> lacks its attribute 'domain'"] * len(folders))
    assert (done.returncode, {*done.stdout.splitlines()}, done.stderr) == (0, {told}, "")


def test_a_schema_is_compiled_and_asked_by_one_at_a_time(monkeypatch: pytest.MonkeyPatch) -> None:
    class Watched:
        error_log = ()

        def __init__(self, **_: object) -> None:
            assert schemas._LIBXML2.locked()  # noqa: SLF001 - that is what this is about

        def validate(self, _: object) -> bool:
            assert schemas._LIBXML2.locked()  # noqa: SLF001
            return False

    monkeypatch.setattr(etree, "XMLSchema", Watched)
    assert refused_by(schema_for.__wrapped__("instance"), etree.Element("instance")) == []
    assert not schemas._LIBXML2.locked()  # noqa: SLF001
