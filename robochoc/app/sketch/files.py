"""Teams of the application as files: a folder of XML that every command takes, and beside it how the team was drawn.

`sketch.json` holds the sketch, and a digest of it and of the XML files. Where any of these was changed by hand since,
the sketch may no longer say what the team is, and the team is opened as any other one: as what its XML files say.
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
from robochoc.app.sketch.shape import is_sound
from robochoc.app.sketch.sketch import Sketch
from robochoc.app.texts import say
from robochoc.formats import Diagnostic, InvalidInputError, encodable, write_team
from robochoc.formats.diagnostics import invalid_input
from robochoc.formats.folder import SKETCH_FILE
from robochoc.formats.scenario_writer import team_files
from robochoc.model.problem import Team
from robochoc.modelling.errors import ModelError

VERSION = 1
"""Of what is in `sketch.json`."""
MAX_SKETCH = 16 << 20
"""Bytes of `sketch.json`. A larger one is none of ours."""


class _Version(msgspec.Struct):
    """The version of a `sketch.json`; a newer one may have more fields than this version of robochoc knows."""

    version: int


class _Kept(msgspec.Struct, forbid_unknown_fields=True):
    """What stands in `sketch.json`."""

    version: int
    digest: str
    sketch: msgspec.Raw


def save(sketch: Sketch, folder: Path, *, replace: bool = False) -> None:
    """Write the team of a sketch into `folder`, with the sketch: all of it, or nothing.

    Args:
        sketch: The sketch.
        folder: The folder to be written.
        replace: Whether a team that is there already is replaced.

    Raises:
        InvalidInputError: if the sketch has errors, or the folder is there and is not replaced.
        OSError: if it cannot be written.
    """
    team = _checked_team(sketch)
    if not replace and folder.exists():
        raise invalid_input(folder, "it exists already", "choose another folder, or replace this one")
    write_team(team, folder, replace=replace, beside={SKETCH_FILE: kept(sketch, team_files(team))})


def zipped(sketch: Sketch) -> bytes:
    """Return what `save` writes as one ZIP archive. Raises `InvalidInputError` if the sketch has errors."""
    files = team_files(_checked_team(sketch))
    content = io.BytesIO()
    with zipfile.ZipFile(content, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, text in {**files, SKETCH_FILE: kept(sketch, files)}.items():
            archive.writestr(zipfile.ZipInfo(f"{sketch.name}/{name}"), text, zipfile.ZIP_DEFLATED)
    return content.getvalue()


def xml_sources(sketch: Sketch) -> dict[str, str]:
    """Return the XML files of a sketch as `save` writes them, by name. Raises `InvalidInputError` if it has errors."""
    return {name: content.decode() for name, content in team_files(_checked_team(sketch)).items()}


def sketch_in(folder: Path, xml: Mapping[str, bytes]) -> Sketch | tuple[str, ...]:
    """Return the sketch in a folder whose XML files are `xml`, if it is still true.

    If not, return which of the files do not say what the sketch says; none where there is no sketch at all.

    Raises:
        InvalidInputError: if there is a file of that name, and it is none of ours, or what it holds has errors.
    """
    path = folder / SKETCH_FILE
    if not path.exists():
        return ()
    if not path.is_file() or path.stat().st_size > MAX_SKETCH:
        raise _damaged(path, "it is no file, or too large")
    try:
        content = path.read_bytes()
        if msgspec.json.decode(content, type=_Version).version > VERSION:
            raise invalid_input(path, "a newer version of robochoc wrote it", "install that version")
        found = msgspec.json.decode(content, type=_Kept)
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
    """Return which files are others than those that would be written of a sketch; none if it is no sound one."""
    if not is_sound(sketch):
        return ()
    try:
        written = team_files(_checked_team(sketch))
    except InvalidInputError:
        return ()
    return tuple(sorted(name for name in {*written, *xml} if written.get(name) != xml.get(name)))


def _digest(files: Mapping[str, bytes]) -> str:
    """Return a digest of files: another one as soon as anything in them, or their names, differs."""
    told = sha256()
    for name in sorted(files):
        path = os.fsencode(name)
        told.update(f"{len(path)} {len(files[name])} ".encode() + path + files[name])
    return told.hexdigest()


def _checked_team(sketch: Sketch) -> Team:
    errors = errors_of(sketch)
    if errors:
        raise InvalidInputError(
            Diagnostic(encodable(trouble.element), 0, trouble.text, trouble.remedy) for trouble in errors
        )
    try:
        return saved_team(sketch)
    except ModelError as mistake:  # pragma: no cover - what checks should have seen
        raise invalid_input(sketch.name, str(mistake), "change what it is about") from None


def kept(sketch: Sketch, xml: Mapping[str, bytes]) -> bytes:
    """Return the content of `sketch.json`, beside XML files."""
    drawn = msgspec.json.encode(sketch, order="deterministic")
    told = _digest({**xml, SKETCH_FILE: drawn})
    return msgspec.json.encode(_Kept(VERSION, told, msgspec.Raw(drawn))) + b"\n"


def _damaged(path: Path, why: str) -> InvalidInputError:
    return invalid_input(path, f"it is damaged: {why}", "remove it: then the team opens as its XML files say")
