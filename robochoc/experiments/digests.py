"""Digests of problems and protocols: the same content is the same problem or protocol, whatever its name and path."""

from __future__ import annotations

import hashlib
import sys
from collections.abc import Iterable
from pathlib import Path
from types import ModuleType

from robochoc.formats.scenario_writer import team_files
from robochoc.model.problem import Team
from robochoc.protocols.protocol import Protocol

_BYTES = 16


def digest_of_team(team: Team) -> str:
    """Return the digest of the content of the robots' files, which is the same for a read and a generated team."""
    return _digest(team_files(team).items())


def sha256_of_team(team: Team) -> str:
    """Return the SHA-256 of the team's canonical form: the names, lengths and contents of the robots' files."""
    return _hashed(hashlib.sha256(), team_files(team).items())


def digest_of_files(path: Path) -> str:
    """Return the digest of the names and contents of a team's files, or of a single file. Raises `OSError`."""
    files = sorted(path.iterdir()) if path.is_dir() else [path]
    return _digest((file.name, file.read_bytes()) for file in files if file.is_file())


def digest_of_protocol(protocol: type[Protocol]) -> str:
    """Return the digest of the Python files of another package's protocol; empty for a protocol of robochoc.

    All files of the packages that define the class and its base classes count, but not what these import.
    """
    packages = {base.__module__.partition(".")[0] for base in protocol.__mro__} - {"robochoc"}
    own = sorted(packages - sys.stdlib_module_names)
    files = [file for package in own for file in _python_files(sys.modules.get(package))]
    return _digest((file.name, file.read_bytes()) for file in files) if files else ""


def _python_files(module: ModuleType | None) -> list[Path]:
    """Return the files of a package, or the file of a module; none if it has no source files."""
    folders = [Path(folder) for folder in getattr(module, "__path__", ())]
    if folders:
        return sorted(file for folder in folders for file in folder.rglob("*.py") if file.is_file())
    file = Path(getattr(module, "__file__", None) or "")
    return [file] if file.is_file() else []


def _digest(files: Iterable[tuple[str, bytes]]) -> str:
    return _hashed(hashlib.blake2b(digest_size=_BYTES), files)


def _hashed(content: hashlib._Hash | hashlib.blake2b, files: Iterable[tuple[str, bytes]]) -> str:
    for name, held in files:
        content.update(f"{name}\0{len(held)}\0".encode(errors="surrogateescape"))
        content.update(held)
    return content.hexdigest()
