"""Makes a protocol MODULE:CLASS that no package declares available under a name, also to worker processes.

Workers find protocols by entry points, so each class is declared in a temporary package on the search path.
"""

from __future__ import annotations

import os
import re
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory

from robochoc.run.registry import GROUP, UnknownProtocolError, installed_protocol, protocol_names
from robochoc.system.installed import all_entry_points

_PATH = "PYTHONPATH"
_PLACE = re.compile(r"[\w.]+:[\w.]+")


@contextmanager
def named_protocols(words: Sequence[str]) -> Iterator[list[str]]:
    """Provide the names of protocols, each given as a name or as MODULE:CLASS.

    The name of an installed class is the one under which it is installed, and that of any other class its name in
    lower case, with hyphens. Modules are also searched in the current folder.

    Raises:
        UnknownProtocolError: if a word is not valid, a class cannot be used, or its name is that of another protocol.
    """
    for word in words:
        if word.endswith(".py") or os.sep in word:
            example = f"{Path(word).stem}:CLASS"
            raise UnknownProtocolError(f"{word} is a file: name its protocol as {example}, in the file's folder")
    installed = {entry.value: entry.name for entry, _ in all_entry_points(GROUP)}
    words = [installed.get(word, word) for word in words]
    places = _places([word for word in words if ":" in word])
    names = [_name(word) if ":" in word else word for word in words]
    if not places:
        yield names
        return
    before = os.environ.get(_PATH)
    with TemporaryDirectory(prefix="robochoc-") as folder:
        for number, (name, place) in enumerate(places.items()):
            _declare(Path(folder, f"outside{number}-0.dist-info"), name, place)
        added = [folder, str(Path.cwd())]
        os.environ[_PATH] = os.pathsep.join([*added, *filter(None, [before])])
        sys.path[:0] = added
        try:
            for name, place in places.items():
                if fault := installed_protocol(name).broken:
                    raise UnknownProtocolError(f"{place} {fault}")
            yield names
        finally:
            del sys.path[: len(added)]
            if before is None:
                del os.environ[_PATH]
            else:
                os.environ[_PATH] = before


def _places(words: Sequence[str]) -> dict[str, str]:
    """Return the places of protocols, MODULE:CLASS, by the names of the protocols."""
    places: dict[str, str] = {}
    for word in words:
        if not _PLACE.fullmatch(word):
            raise UnknownProtocolError(f"{word!r} is not of the form MODULE:CLASS")
        name = _name(word)
        other = _place_of(name) if name in protocol_names() else places.get(name, word)
        if other != word:
            raise UnknownProtocolError(f"{word} would be called {name!r}, as {other} already is: rename the class")
        places[name] = word
    return places


def _place_of(name: str) -> str:
    """Return the place of an installed protocol, and its package."""
    offer = installed_protocol(name)
    return f"{offer.place} ({offer.package})"


def _declare(metadata: Path, name: str, place: str) -> None:
    """Write the metadata of a package that offers one protocol; the package is named after the module."""
    metadata.mkdir()
    package = place.partition(":")[0].partition(".")[0]
    metadata.joinpath("METADATA").write_text(f"Metadata-Version: 2.1\nName: {package}\nVersion: 0\n")
    metadata.joinpath("entry_points.txt").write_text(f"[{GROUP}]\n{name} = {place}\n")


def _name(word: str) -> str:
    return word.partition(":")[2].lower().replace("_", "-")
