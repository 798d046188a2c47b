"""The state of a team as one file, which can be opened elsewhere: the team and one run.

The file is the team's archive (`sketch.files.zipped`), which all versions can open, with the run added:

TEAM/...             the team's files, and its sketch
TEAM/run/1/...       the run: record, result and journal
"""

from __future__ import annotations

import io
import re
import shutil
import zipfile
from pathlib import Path

import msgspec

from robochoc.app.flights.answer_check import check
from robochoc.app.flights.flight_map import RunChange
from robochoc.app.runs.options import JOURNAL, RESULT
from robochoc.app.runs.run import CHANGE, MAX_RESULT, RECORD, SKETCH, Record, Run
from robochoc.app.sketch import open_from_disk
from robochoc.app.sketch.checks import errors_of
from robochoc.app.sketch.element_checks import is_sound
from robochoc.app.sketch.files import MAX_SKETCH, zipped
from robochoc.app.sketch.open_from_disk import bounded_archive
from robochoc.app.sketch.sketch import Sketch
from robochoc.app.store import FILES
from robochoc.system.archives import DAMAGED

MAX_BYTES = 256 << 20
"""The maximum number of bytes of an unpacked run."""
MAX_JOURNAL_BYTES = open_from_disk.MAX_BYTES * 3 // 4
"""The maximum size of a packed journal in bytes. A larger journal is left out, so that the file can be opened again."""
MOST_AT_ONCE = {RECORD: MAX_SKETCH, SKETCH: MAX_SKETCH, CHANGE: MAX_SKETCH, RESULT: MAX_RESULT}
"""The maximum size in bytes of files that are read as a whole. Larger files are rejected."""
_FILES = (RECORD, SKETCH, RESULT, JOURNAL, CHANGE)
_AT_ONCE = 1 << 20
_PLACE = "run/1"
_FIRST = "00001"
_FRESH = "new"
"""The name of the folder in which a run is being written."""


def team_archive(run: Run) -> bytes:
    """Return the team in a run as a ZIP archive of its folder, with the sketch unless the team is imported.

    Raises:
        InvalidInputError: if the sketch has errors.
        OSError: if a file cannot be read.
    """
    sketch = run.sketch
    return zipped(sketch) if sketch.decisions else files_archive(run.team, sketch.name)


def files_archive(folder: Path, name: str) -> bytes:
    """Return the files of an imported team as a ZIP archive. Raises `OSError` if a file cannot be read."""
    content = io.BytesIO()
    with zipfile.ZipFile(content, "w", zipfile.ZIP_DEFLATED) as archive:
        for file in sorted(folder.rglob("*.xml")):
            _add(archive, f"{file_name(name)}/{file.relative_to(folder).as_posix()}", file)
    return content.getvalue()


def packed(run: Run) -> bytes:
    """Return a run and its team as one file, without messages if `is_too_long`. Raises the errors of `team_archive`."""
    content = io.BytesIO(team_archive(run))
    left_out = {JOURNAL} if is_too_long(run) else set()
    with zipfile.ZipFile(content, "a", zipfile.ZIP_DEFLATED) as archive:
        for name in _FILES:
            if name not in left_out and (file := run.artefact(name)):
                _add(archive, f"{file_name(run.sketch.name)}/{_PLACE}/{name}", file)
    return content.getvalue()


def is_too_long(run: Run) -> bool:
    """Return whether the journal of a run is too large to be packed."""
    journal = run.artefact(JOURNAL)
    return journal is not None and journal.stat().st_size > MAX_JOURNAL_BYTES


def _add(archive: zipfile.ZipFile, name: str, file: Path) -> None:
    """Add a file without its modification time, so that equal contents give equal archives."""
    entry = zipfile.ZipInfo(name)
    entry.compress_type = zipfile.ZIP_DEFLATED
    with file.open("rb") as source, archive.open(entry, "w") as packed_file:
        shutil.copyfileobj(source, packed_file, _AT_ONCE)  # in pieces, since the file may be long


def unpack_run(file: Path, folder: Path) -> bool:
    """Unpack the run from a packed state into the folder of a team without runs.

    Args:
        file: A file that `packed` has made. Other files are ignored.
        folder: The team's folder.

    Returns:
        True if the file contained a complete run.

    Raises:
        OSError: if the run cannot be written.
    """
    try:
        with bounded_archive(file) as archive:
            found = _found(archive)
    except DAMAGED:
        return False
    if RECORD not in found or SKETCH not in found or not _is_sound(found):
        return False
    record = msgspec.json.decode(found[RECORD], type=Record)
    sketch = msgspec.json.decode(found[SKETCH], type=Sketch)
    record.opened, record.checked = True, None
    found[RECORD] = msgspec.json.encode(record)
    run = Run(_written(found, folder / "runs"), record, sketch)
    if (folder / FILES).is_dir():  # for a sketch, the files are written when they are needed
        shutil.copytree(folder / FILES, run.team)
    check(run)
    run.save()
    return True


def _written(found: dict[str, bytes], runs: Path) -> Path:
    """Write the files of a run atomically, and return its folder. Raises `OSError` if they cannot be written."""
    fresh = runs / _FRESH
    fresh.mkdir(mode=0o700, parents=True)
    try:
        for name, piece in found.items():
            (fresh / name).write_bytes(piece)
        return fresh.rename(runs / _FIRST)  # makes the run visible: folders without a record are removed
    except BaseException:
        shutil.rmtree(fresh, ignore_errors=True)
        raise


def _found(archive: zipfile.ZipFile) -> dict[str, bytes]:
    """Return the files of the run; empty if a file is too large. Names are compared, but never used as paths."""
    found: dict[str, bytes] = {}
    left = MAX_BYTES
    for entry in archive.infolist():
        _, _, inside = entry.filename.partition("/")
        name = inside.removeprefix(f"{_PLACE}/")
        if name == inside or name not in _FILES or name in found:
            continue
        most = min(left, MOST_AT_ONCE.get(name, left))
        with archive.open(entry) as stream:  # the size in the entry is untrusted
            found[name] = stream.read(most + 1)
        if len(found[name]) > most:
            return {}
        left -= len(found[name])
    return found


def _is_sound(found: dict[str, bytes]) -> bool:
    try:
        msgspec.json.decode(found[RECORD], type=Record)
        sketch = msgspec.json.decode(found[SKETCH], type=Sketch)
        change = msgspec.json.decode(found[CHANGE], type=RunChange) if CHANGE in found else None
    except (msgspec.DecodeError, RecursionError, UnicodeError):
        return False
    if not is_sound(sketch) or (change is not None and not change.is_sound):
        return False
    return not (sketch.decisions and errors_of(sketch))  # without decisions, it is the picture of an imported team


_OTHERS = re.compile(r"[^A-Za-z0-9_-]+")
_LONGEST = 60
_USUAL = "team"
_RESERVED = re.compile(r"(?i)(con|prn|aux|nul|com[0-9]|lpt[0-9])")
"""Device names on Windows, which cannot be file names."""


def file_name(name: str, ending: str = "") -> str:
    """Return a file name for `name` with ASCII letters, digits, `_` and `-` only, followed by `ending`."""
    plain = _OTHERS.sub("-", name).strip("-")[:_LONGEST].strip("-")
    return f"{_USUAL if not plain or _RESERVED.fullmatch(plain) else plain}{ending}"
