"""The choice between the core's modules compiled by mypyc and the same modules in plain Python.

A wheel built with a C compiler contains both kinds (`hatch_build.py`). The compiled modules are used unless
`ROBOCHOC_PURE` is set to a value other than 0. Child processes inherit the choice.
"""

from __future__ import annotations

import sys
from collections.abc import Mapping, Sequence
from importlib.machinery import EXTENSION_SUFFIXES, ModuleSpec, PathFinder, SourceFileLoader
from importlib.util import find_spec, spec_from_file_location
from pathlib import Path
from types import ModuleType
from typing import Any

_COMPILED_MODULE = "robochoc.protocols.protocol"
"""The name of one of the compiled modules."""

PURE = "pure Python"


class PurePython:
    """A module finder that loads robochoc's modules from their sources even if compiled modules exist."""

    @staticmethod
    def find_spec(name: str, path: Sequence[str] | None = None, target: ModuleType | None = None) -> ModuleSpec | None:
        """Return the specification of the module's source, or None for modules left to the usual finders."""
        if not name.startswith("robochoc."):
            return None
        found = PathFinder.find_spec(name, path, target)
        if found is None or not is_compiled(found):
            return None
        source = _source(found.origin or "")
        return spec_from_file_location(name, source, loader=SourceFileLoader(name, str(source)))


def prefer_sources() -> None:
    """Load those robochoc modules that this process has not yet imported from their sources."""
    sys.meta_path.insert(0, PurePython)


def is_compiled(found: ModuleSpec) -> bool:
    """Return whether a module is compiled by mypyc."""
    return (found.origin or "").endswith(tuple(EXTENSION_SUFFIXES))


def kind_of_core() -> str:
    """Return `compiled core`, or `PURE`."""
    found = find_spec(_COMPILED_MODULE)
    return "compiled core" if found is not None and is_compiled(found) else PURE


def attributes_of(thing: object) -> Mapping[str, Any]:
    """Return the attributes of an object, like `vars`, but also for compiled classes without `__dict__`."""
    names: Sequence[str] = getattr(type(thing), "__mypyc_attrs__", ())
    if not names:
        return getattr(thing, "__dict__", {})
    found = {name: getattr(thing, name) for name in names if name != "__dict__" and hasattr(thing, name)}
    return {**found, **getattr(thing, "__dict__", {})}


def docstring(module: ModuleType) -> str:
    """Return the docstring of a module. Compiled modules have no docstring, so it is read from the source."""
    file = getattr(module, "__file__", None) or ""
    if module.__doc__ or not file.endswith(tuple(EXTENSION_SUFFIXES)):
        return module.__doc__ or ""
    import ast  # noqa: PLC0415 - start-up

    return ast.get_docstring(ast.parse(_source(file).read_text(encoding="utf-8"))) or ""


def _source(compiled: str) -> Path:
    """Return the path of the source next to a compiled module."""
    path = Path(compiled)
    return path.with_name(f"{path.name.partition('.')[0]}.py")
