"""Makes a protocol MODULE:CLASS that no package declares available under a name, also to worker processes.

Workers find protocols by entry points, so each class is declared in a temporary package on the search path.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory

from robochoc.run.registry import GROUP

_PATH = "PYTHONPATH"


@contextmanager
def named_protocols(words: Sequence[str]) -> Iterator[list[str]]:
    """Provide the names of protocols, each given as a name or as MODULE:CLASS.

    The name of a class is its name in lower case, with hyphens. Modules are also searched in the current folder.
    """
    places = {_name(word): word for word in words if ":" in word}
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
            yield names
        finally:
            del sys.path[: len(added)]
            if before is None:
                del os.environ[_PATH]
            else:
                os.environ[_PATH] = before


def _declare(metadata: Path, name: str, place: str) -> None:
    """Write the metadata of a package that offers one protocol; the package is named after the module."""
    metadata.mkdir()
    package = place.partition(":")[0].partition(".")[0]
    metadata.joinpath("METADATA").write_text(f"Metadata-Version: 2.1\nName: {package}\nVersion: 0\n")
    metadata.joinpath("entry_points.txt").write_text(f"[{GROUP}]\n{name} = {place}\n")


def _name(word: str) -> str:
    return word.partition(":")[2].lower().replace("_", "-")
