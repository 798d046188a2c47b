"""The examples in the docstrings of protocols' modules."""

from __future__ import annotations

import doctest
import pkgutil
from importlib import import_module

import robochoc.protocols
from robochoc.run.registry import protocol_named, protocol_names
from robochoc.system.compiled_core import docstring
from tests.support.cases import cases


def test_each_example_shows_what_happens_and_each_protocol_has_one() -> None:
    parser, runner, shown = doctest.DocTestParser(), doctest.DocTestRunner(), set[str]()
    with cases() as each:
        for _, name, _ in pkgutil.walk_packages(robochoc.protocols.__path__, "robochoc.protocols."):
            module = import_module(name)
            with each(name):
                if runner.run(parser.get_doctest(docstring(module), {**vars(module)}, name, None, 0)).attempted:
                    shown.add(name)
                assert runner.summarize(verbose=False).failed == 0
    own = {protocol_named(name).__module__ for name in protocol_names()}
    assert {module for module in own if module.startswith("robochoc.")} <= shown
