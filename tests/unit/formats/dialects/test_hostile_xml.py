"""Files that nobody should trust: one message each, soon."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from robochoc.formats import InvalidInputError
from robochoc.formats.dialects.dialect import ImportOptions
from robochoc.formats.dialects.registry import NAMES, dialects, find_dialect, read_foreign, recognise
from robochoc.formats.names_file import NAMES_FILE, original_names
from robochoc.formats.xml import read_tree
from tests.support.cases import looped

FRODO = '<presentation format="XCSP 2.1_FRODO"/><agents><agent name="a"/></agents>'
LAUGH = "&l{};"
LAUGHS = "".join(f"<!ENTITY l{n} '{10 * LAUGH.format(n - 1)}'>" for n in range(1, 10))
DOMAIN = '<domains><domain name="d" nbValues="1">{}</domain></domains>'
VARIABLE = '<variables><variable name="x" domain="d" agent="a"/></variables>'
RELATION = '<relations><relation name="r" semantics="soft" arity="1">{}</relation></relations>'
CONSTRAINT = '<constraints><constraint name="c" scope="x" reference="r"/></constraints></instance>'
PREDICATE = (
    "<predicates><predicate name='p'><parameters>int X</parameters><expression><functional>{}</functional>"
    "</expression></predicate></predicates>"
)

HOSTILE = {
    "billion laughs": (f'<!DOCTYPE instance [<!ENTITY l0 "ha">{LAUGHS}]><instance>{FRODO}&l9;</instance>', "a DOCTYPE"),
    "a file of this machine": (
        f'<!DOCTYPE instance [<!ENTITY f SYSTEM "file:///etc/passwd">]><instance>{FRODO}&f;</instance>',
        "a DOCTYPE",
    ),
    "an unknown entity": (f"<instance>{FRODO}&ha;</instance>", "is not well-formed XML"),
    "cut off": (f"<instance>{FRODO}<domains>", "is not well-formed XML"),
    "deep": (f"<instance>{FRODO}{'<domains>' * 9999}</instance>", "is not well-formed XML"),
    "huge range": (f"<instance>{FRODO}{DOMAIN.format('0..999999999999999999')}</instance>", "more than 100000 values"),
    "many digits": (f"<instance>{FRODO}{DOMAIN.format('9' * 100_000)}</instance>", "is not an integer"),
    "huge counts": (f"<instance>{FRODO}{DOMAIN.format('1')}<variables nbVariables='999999999999'/></instance>",
        "has no variable"),
    "huge cost": (f"<instance>{FRODO}{DOMAIN.format('1')}{VARIABLE}{RELATION.format('1e99:1')}</instance>",
        "the cost 1e99 is too large"),
    "huge arity": (
        f"<instance>{FRODO}{DOMAIN.format('1')}{VARIABLE}{RELATION.format('').replace('1', '9' * 12)}{CONSTRAINT}",
        "have 999999999999 values",
    ),
    "deep expression": (f"<instance>{FRODO}{PREDICATE.format('not(' * 900 + 'eq(X,1)' + ')' * 900)}</instance>",
        "nested too deep"),
    "not UTF-8": (f"<instance>{FRODO}\udcff</instance>", "is not UTF-8"),
    "control characters": (f"<instance>{FRODO}\x1b</instance>", "is not well-formed XML"),
    "another root": (f"<problem>{FRODO}</problem>", "the root element is <problem>"),
}  # fmt: skip


@looped("what", HOSTILE)
def test_one_message(what: str, tmp_path: Path) -> None:
    text, message = HOSTILE[what]
    path = tmp_path / "problem.xml"
    path.write_bytes(text.encode("utf-8", "surrogateescape"))
    recognise(path)
    with pytest.raises(InvalidInputError) as failure:
        read_foreign([path], ImportOptions(), "frodo")
    assert message in str(failure.value)
    assert len(failure.value.diagnostics) == 1


def test_millions_of_empty_elements(tmp_path: Path) -> None:
    path = tmp_path / "problem.xml"
    with path.open("wb") as file:
        file.write(f"<instance>{FRODO}".encode())
        for _ in range(40):
            file.write(b"<domain/>" * 100_000)
        file.write(b"</instance>")
    with pytest.raises(InvalidInputError, match="is larger than 32 MiB"):
        read_foreign([path], ImportOptions())


def test_what_is_no_file_is_not_recognised(tmp_path: Path) -> None:
    fifo = tmp_path / "fifo"
    os.mkfifo(fifo)
    assert recognise(fifo) is recognise(tmp_path) is recognise(tmp_path / "nowhere") is None
    with pytest.raises(InvalidInputError, match="has an unknown format"):
        read_foreign([fifo], ImportOptions())


@pytest.mark.skipif(not Path("/proc/self/status").is_file(), reason="no file whose size is stated as 0")
def test_a_file_that_is_larger_than_it_states_is_read_on() -> None:
    with pytest.raises(InvalidInputError, match="is larger than"):
        read_tree(Path("/proc/self/status"), 100)


def test_all_dialects_have_their_names() -> None:
    assert [one.name for one in dialects()] == [name for name in NAMES if find_dialect(name)]
    assert find_dialect("os") is None


@looped("content", [b"", b"[]", b'{"dialect": 1, "names": {}}', b"\xff", b"[" * 10_000, b'{"names":{"a":1}}'])
def test_names_that_are_none(content: bytes, tmp_path: Path) -> None:
    assert original_names(tmp_path) == {}
    (tmp_path / NAMES_FILE).write_bytes(content)
    with pytest.raises(InvalidInputError, match="does not contain the original names of a team"):
        original_names(tmp_path)
