"""Digests of problems: problems with the same content are the same problem, whatever their names and paths."""

from __future__ import annotations

import hashlib
from collections.abc import Iterable
from pathlib import Path

from robochoc.formats.scenario_writer import team_files
from robochoc.model.problem import Team

_BYTES = 16


def digest_of_team(team: Team) -> str:
    """Return the digest of the content of the robots' files, which is the same for a read and a generated team."""
    return _digest(team_files(team).items())


def digest_of_files(path: Path) -> str:
    """Return the digest of the names and contents of a team's files, or of a single file. Raises `OSError`."""
    files = sorted(path.iterdir()) if path.is_dir() else [path]
    return _digest((file.name, file.read_bytes()) for file in files if file.is_file())


def _digest(files: Iterable[tuple[str, bytes]]) -> str:
    content = hashlib.blake2b(digest_size=_BYTES)
    for name, held in files:
        content.update(f"{name}\0{len(held)}\0".encode(errors="surrogateescape"))
        content.update(held)
    return content.hexdigest()
