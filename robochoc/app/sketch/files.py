"""The application's teams as files: a folder of XML files, which all commands read, and the sketch.

`sketch.json` contains the sketch, and a digest of the sketch and the XML files. If a file was changed later, the sketch
may differ from the team, and the team is opened from its XML files as an imported team.
"""

from __future__ import annotations

import io
import os
import zipfile
from collections.abc import Mapping
from hashlib import sha256
from pathlib import Path

import msgspec

from robochoc.app.sketch.building import saved_team
from robochoc.app.sketch.checks import errors_of
from robochoc.app.sketch.element_checks import is_sound
from robochoc.app.sketch.sketch import Sketch
from robochoc.app.texts import say
from robochoc.formats import Diagnostic, InvalidInputError, encodable, write_team
from robochoc.formats.diagnostics import invalid_input
from robochoc.formats.scenario_writer import team_files
from robochoc.formats.team_writer import SKETCH_FILE
from robochoc.model.problem import Team
from robochoc.modelling.errors import ModelError

VERSION = 1
"""The format version of `sketch.json`."""
MAX_SKETCH = 16 << 20
"""The maximum size of `sketch.json` in bytes. Larger files are rejected."""


class _Version(msgspec.Struct):
    """The version in a `sketch.json`. Newer versions may have fields that are unknown to this version of robochoc."""

    version: int


class _SketchFile(msgspec.Struct, forbid_unknown_fields=True):
    """The content of `sketch.json`."""

    version: int
    digest: str
    sketch: msgspec.Raw


def save(sketch: Sketch, folder: Path, *, replace: bool = False) -> None:
    """Write a sketch and its team into `folder`, atomically.

    Args:
        sketch: The sketch.
        folder: The folder to write.
        replace: True to replace an existing team.

    Raises:
        InvalidInputError: if the sketch has errors, or the folder exists and must not be replaced.
        OSError: if a file cannot be written.
    """
    team = _checked_team(sketch)
    if not replace and folder.exists():
        raise invalid_input(folder, "the folder already exists", "choose another folder, or replace this one")
    write_team(team, folder, replace=replace, extra_files={SKETCH_FILE: sketch_file(sketch, team_files(team))})


def zipped(sketch: Sketch) -> bytes:
    """Return the files that `save` writes as one ZIP archive. Raises `InvalidInputError` if the sketch has errors."""
    files = team_files(_checked_team(sketch))
    content = io.BytesIO()
    with zipfile.ZipFile(content, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, text in {**files, SKETCH_FILE: sketch_file(sketch, files)}.items():
            archive.writestr(zipfile.ZipInfo(f"{sketch.name}/{name}"), text, zipfile.ZIP_DEFLATED)
    return content.getvalue()


def xml_sources(sketch: Sketch) -> dict[str, str]:
    """Return the XML files for a sketch, by name. Raises `InvalidInputError` if the sketch has errors."""
    return {name: content.decode() for name, content in team_files(_checked_team(sketch)).items()}


def sketch_in(folder: Path, xml: Mapping[str, bytes]) -> Sketch | tuple[str, ...]:
    """Return the sketch in a folder with the XML files `xml`, if all files are unchanged.

    Otherwise return the files that differ from the sketch, or an empty tuple if there is no sketch.

    Raises:
        InvalidInputError: if `sketch.json` is damaged, or the sketch has errors.
    """
    path = folder / SKETCH_FILE
    if not path.exists():
        return ()
    if not path.is_file() or path.stat().st_size > MAX_SKETCH:
        raise _damaged(path, f"it is not a regular file, or has more than {MAX_SKETCH >> 20} MiB")
    try:
        content = path.read_bytes()
        if msgspec.json.decode(content, type=_Version).version > VERSION:
            raise invalid_input(path, "it was written by a newer version of robochoc", "update robochoc")
        found = msgspec.json.decode(content, type=_SketchFile)
        sketch = msgspec.json.decode(found.sketch, type=Sketch)
    except (msgspec.DecodeError, RecursionError, UnicodeError) as damaged:
        raise _damaged(path, str(damaged)) from None
    if found.digest != _digest({**xml, SKETCH_FILE: bytes(found.sketch)}):
        return _differing(sketch, xml) or (SKETCH_FILE,)
    if not is_sound(sketch):
        raise _damaged(path, say("edit.unsound"))
    errors = errors_of(sketch)
    if errors:
        raise _damaged(path, errors[0].text)
    return sketch


def _differing(sketch: Sketch, xml: Mapping[str, bytes]) -> tuple[str, ...]:
    """Return the files that differ from the files for a sketch; empty if the sketch is not sound."""
    if not is_sound(sketch):
        return ()
    try:
        written = team_files(_checked_team(sketch))
    except InvalidInputError:
        return ()
    return tuple(sorted(name for name in {*written, *xml} if written.get(name) != xml.get(name)))


def _digest(files: Mapping[str, bytes]) -> str:
    """Return a digest of file names and contents."""
    digest = sha256()
    for name in sorted(files):
        path = os.fsencode(name)
        digest.update(f"{len(path)} {len(files[name])} ".encode() + path + files[name])
    return digest.hexdigest()


def _checked_team(sketch: Sketch) -> Team:
    errors = errors_of(sketch)
    if errors:
        raise InvalidInputError(
            Diagnostic(encodable(trouble.element), 0, trouble.text, trouble.remedy) for trouble in errors
        )
    try:
        return saved_team(sketch)
    except ModelError as mistake:  # pragma: no cover - the checks should have found the error
        raise invalid_input(sketch.name, str(mistake), "change the named element") from None


def sketch_file(sketch: Sketch, xml: Mapping[str, bytes]) -> bytes:
    """Return the content of `sketch.json` for a sketch and its XML files."""
    drawn = msgspec.json.encode(sketch, order="deterministic")
    digest = _digest({**xml, SKETCH_FILE: drawn})
    return msgspec.json.encode(_SketchFile(VERSION, digest, msgspec.Raw(drawn))) + b"\n"


def _damaged(path: Path, why: str) -> InvalidInputError:
    return invalid_input(path, f"the sketch is damaged: {why}", "remove it to open the team from its XML files")
