"""Compiled modules and their sources: which are taken, and what is seen of compiled objects."""

from __future__ import annotations

import os
import subprocess
import sys
from importlib.machinery import EXTENSION_SUFFIXES
from importlib.util import find_spec
from pathlib import Path
from types import ModuleType

import pytest

from robochoc.system.compiled_core import PurePython, attributes_of, docstring, is_compiled, kind_of_core

CORE = ("protocols.protocol", "protocols.satisfaction.abt", "solver.local_problem", "communication.host")


class Slotted:
    """As a compiled class: it names its attributes, and its objects have no `__dict__`."""

    __slots__ = ("first", "never", "second")
    __mypyc_attrs__ = ("first", "second", "never", "__dict__")

    def __init__(self) -> None:
        self.first, self.second = 1, "two"


class Extended(Slotted):
    """A plain subclass of one."""

    def __init__(self) -> None:
        super().__init__()
        self.third = None


def test_attributes_are_those_that_are_set() -> None:
    assert attributes_of(Slotted()) == {"first": 1, "second": "two"}
    assert attributes_of(Extended()) == {"first": 1, "second": "two", "third": None}


def test_a_compiled_module_has_its_docstring_in_its_source(tmp_path: Path) -> None:
    (tmp_path / "some.py").write_text('"""What it is."""\n')
    module = ModuleType("some")
    module.__file__ = str(tmp_path / f"some{EXTENSION_SUFFIXES[0]}")
    assert docstring(module) == "What it is."
    assert docstring(ModuleType("other", "Said.")) == "Said."
    assert not docstring(ModuleType("silent"))


def test_a_source_is_preferred_to_the_compiled_module_beside_it(tmp_path: Path) -> None:
    for name in (f"both{EXTENSION_SUFFIXES[0]}", "both.py", "plain.py"):
        (tmp_path / name).touch()
    found = PurePython.find_spec("robochoc.both", [str(tmp_path)])
    assert found is not None
    assert found.origin == str(tmp_path / "both.py")
    assert PurePython.find_spec("robochoc.plain", [str(tmp_path)]) is None
    assert PurePython.find_spec("robochoc.none", [str(tmp_path)]) is None
    assert PurePython.find_spec("others.both", [str(tmp_path)]) is None


@pytest.mark.parametrize(("pure", "forced"), [("1", True), ("0", False), ("", False)])
def test_robochoc_pure_is_for_all_modules_and_child_processes(pure: str, forced: bool) -> None:  # noqa: FBT001
    program = (
        "import subprocess, sys; from robochoc.system.compiled_core import kind_of_core; print(kind_of_core());"
        f" [print(sys.modules[name].__file__) for name in {[f'robochoc.{name}' for name in CORE]} if __import__(name)];"
        " subprocess.run([sys.executable, '-m', 'robochoc', '--version'], check=True)"
    )
    environment = {**os.environ, "ROBOCHOC_PURE": pure, "PYTHONUNBUFFERED": "1"}
    done = subprocess.run([sys.executable, "-c", program], env=environment, capture_output=True, text=True, check=True)
    kind, *files, version = done.stdout.splitlines()
    there = find_spec("robochoc.protocols.protocol")
    built = there is not None and Path(str(there.origin)).parent.glob(f"protocol{EXTENSION_SUFFIXES[0]}")
    compiled = bool(built and [*built]) and not forced
    assert kind == ("compiled core" if compiled else "pure Python")
    assert version.endswith(f"({kind})")
    assert [Path(file).suffix for file in files] == [".so" if compiled else ".py"] * len(CORE)


def test_this_process_says_what_it_runs() -> None:
    there = find_spec("robochoc.communication.host")
    assert there is not None
    assert (kind_of_core() == "compiled core") is is_compiled(there)
