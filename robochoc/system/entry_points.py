"""Entry points of installed packages, read without `importlib.metadata`.

That module needs 20 ms (a fourth of a small run) to be imported, together with `email`, `csv` and `zipfile`, and to
read the entry points of 90 packages. This module reads the same files in 2 ms. If packages are not folders on
`sys.path` (zip files, other finders), `importlib.metadata` is used. The format is described in the Python Packaging
User Guide, "Entry points specification". A test compares the two readers.
"""

from __future__ import annotations

import os
import re
import sys
from collections.abc import Iterator, Sequence
from importlib.machinery import PathFinder
from pkgutil import resolve_name
from typing import TYPE_CHECKING, NamedTuple, Protocol

if TYPE_CHECKING:
    from importlib.metadata import Distribution

_FILE = "entry_points.txt"
_INFO = (".dist-info", ".egg-info")


class EntryPoint(Protocol):
    """The part of the interface of `importlib.metadata.EntryPoint` that is used."""

    @property
    def name(self) -> str:
        """The name of the entry point."""

    @property
    def value(self) -> str:
        """The module and the attribute: `robochoc.protocols.satisfaction.abt:ABT`."""

    @property
    def dist(self) -> Distribution | None:
        """The package that contains the entry point."""

    def load(self) -> object:
        """Import the module, and return the attribute. Any exception may be raised."""


class FoundEntryPoint(NamedTuple):
    """An entry point in the metadata folder `folder` of a package."""

    name: str
    value: str
    folder: str

    @property
    def dist(self) -> Distribution:
        """The package that contains the entry point. Its name and version are read on access."""
        from importlib.metadata import Distribution  # noqa: PLC0415 - see the module's docstring

        return Distribution.at(self.folder)

    def load(self) -> object:
        """Import the module, and return the attribute. Any exception may be raised."""
        return resolve_name(self.value.partition("[")[0].strip())


def entry_points(group: str) -> Sequence[EntryPoint]:
    """Return all entry points in `group`. If packages have the same name, only the first one on `sys.path` counts."""
    if _unusual():
        from importlib.metadata import entry_points as all_entry_points  # noqa: PLC0415 - see the module's docstring

        return tuple(all_entry_points(group=group))
    return tuple(entry for folder in _folders() for entry in _in_folder(folder, group))


def _unusual() -> bool:
    """Return whether packages may be in places other than folders on `sys.path`."""
    others = (finder for finder in sys.meta_path if finder is not PathFinder)
    return any(hasattr(finder, "find_distributions") for finder in others) or any(map(os.path.isfile, sys.path))


def _folders() -> Iterator[str]:
    """Yield the metadata folders of packages, in the order of `sys.path`."""
    known = set()
    for place in sys.path:
        try:
            with os.scandir(place or os.curdir) as entries:
                found = sorted(entry.path for entry in entries if entry.name.endswith(_INFO))
        except OSError:
            continue
        for folder in found:
            package = re.sub(r"[-_.]+", "-", os.path.basename(folder).partition("-")[0].removesuffix(_INFO[1])).lower()  # noqa: PTH119 - as strings: there are many
            if package not in known:
                known.add(package)
                yield folder


def _in_folder(folder: str, group: str) -> Iterator[FoundEntryPoint]:
    try:
        with open(f"{folder}{os.sep}{_FILE}", "rb", buffering=0) as file:  # noqa: PTH123 - a path takes six times as long
            content = file.read()
        text = content.decode() if group.encode() in content else ""
    except (OSError, ValueError):
        return
    section = ""
    for line in map(str.strip, text.splitlines()):
        if line.startswith("[") and line.endswith("]"):
            section = line[1:-1]
        elif section == group and line and not line.startswith("#"):
            name, _, value = line.partition("=")
            yield FoundEntryPoint(name.strip(), value.strip(), folder)
