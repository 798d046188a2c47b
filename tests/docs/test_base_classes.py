"""The table of base classes in docs/tutorials/write-a-protocol.md, against the classes."""

from __future__ import annotations

import importlib
import re

from robochoc.protocols.protocol import Protocol
from robochoc.run.registry import protocol_named
from tests.support.cases import cases
from tests.support.program import ROOT

PAGE = (ROOT / "docs" / "tutorials" / "write-a-protocol.md").read_text()
ROWS = re.findall(r"^\| (.*) \| `(robochoc\.protocols[\w.]+)\.(\w+)` \| (.*) \| (.*) \|$", PAGE, re.MULTILINE)


def names(cell: str) -> set[str]:
    return {*re.findall(r"`([\w-]+)`", cell)}


def test_the_table_names_what_a_subclass_has_to_write_and_protocols_that_do() -> None:
    assert len(ROWS) > 5
    with cases() as each:
        for algorithm, module, name, written, examples in ROWS:
            with each(name):
                base = getattr(importlib.import_module(module), name)
                of_another_base = Protocol.__abstractmethods__ if "in addition" in algorithm else frozenset()
                assert names(written.partition(";")[0]) == base.__abstractmethods__ - of_another_base
                assert all(issubclass(protocol_named(example), base) for example in names(examples))
