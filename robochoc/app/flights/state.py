"""The state of a team as one file: the team and its last run, to be opened again elsewhere.

It is the archive of the team (`sketch.files.zipped`), which every version opens, with the run beside:

TEAM/...             the team's files, and how it was drawn
TEAM/run/1/...       the run: how it was started, its answer, what was said
"""

from __future__ import annotations

import io
import shutil
import zipfile
from pathlib import Path

import msgspec

from robochoc.app.flights.answer_check import check
from robochoc.app.flights.file_names import file_name
from robochoc.app.flights.flight_map import Change
from robochoc.app.runs.options import JOURNAL, RESULT
from robochoc.app.runs.run import CHANGE, MAX_RESULT, RECORD, SKETCH, Record, Run
from robochoc.app.sketch import opening
from robochoc.app.sketch.archives import bounded_archive
from robochoc.app.sketch.checks import errors_of
from robochoc.app.sketch.files import MAX_SKETCH, zipped
from robochoc.app.sketch.opening import DAMAGED
from robochoc.app.sketch.shape import is_sound
from robochoc.app.sketch.sketch import Sketch
from robochoc.app.store import FILES

MAX_BYTES = 256 << 20
"""Bytes of a run, unpacked."""
MOST_SAID = opening.MAX_BYTES * 3 // 4
"""Bytes of the messages of a run: of more, none are packed, so that the file can be opened again."""
MOST_AT_ONCE = {RECORD: MAX_SKETCH, SKETCH: MAX_SKETCH, CHANGE: MAX_SKETCH, RESULT: MAX_RESULT}
"""Bytes of a file of the run that is read at once. A larger one is none of ours."""
_FILES = (RECORD, SKETCH, RESULT, JOURNAL, CHANGE)
_AT_ONCE = 1 << 20
_PLACE = "run/1"
_FIRST = "00001"
_FRESH = "new"
"""The folder of a run that is being written."""


def team_archive(run: Run) -> bytes:
    """Return the team of a run as a ZIP archive of its folder; with its sketch, if it was drawn here.

    Raises:
        InvalidInputError: if the sketch has errors.
        OSError: if a file cannot be read.
    """
    sketch = run.sketch
    return zipped(sketch) if sketch.decisions else files_archive(run.team, sketch.name)


def files_archive(folder: Path, name: str) -> bytes:
    """Return the files of a team that was not drawn here as a ZIP archive. Raises `OSError` if one cannot be read."""
    content = io.BytesIO()
    with zipfile.ZipFile(content, "w", zipfile.ZIP_DEFLATED) as archive:
        for file in sorted(folder.rglob("*.xml")):
            _add(archive, f"{file_name(name)}/{file.relative_to(folder).as_posix()}", file)
    return content.getvalue()


def packed(run: Run) -> bytes:
    """Return a run and its team as one file, without its messages if `is_too_long`. Raises as `team_archive`."""
    content = io.BytesIO(team_archive(run))
    left_out = {JOURNAL} if is_too_long(run) else set()
    with zipfile.ZipFile(content, "a", zipfile.ZIP_DEFLATED) as archive:
        for name in _FILES:
            if name not in left_out and (file := run.artefact(name)):
                _add(archive, f"{file_name(run.sketch.name)}/{_PLACE}/{name}", file)
    return content.getvalue()


def is_too_long(run: Run) -> bool:
    """Return whether so much was said in a run that it is packed without."""
    journal = run.artefact(JOURNAL)
    return journal is not None and journal.stat().st_size > MOST_SAID


def _add(archive: zipfile.ZipFile, name: str, file: Path) -> None:
    """Add a file; it has no time, so that the same makes the same archive."""
    entry = zipfile.ZipInfo(name)
    entry.compress_type = zipfile.ZIP_DEFLATED
    with file.open("rb") as source, archive.open(entry, "w") as packed_file:
        shutil.copyfileobj(source, packed_file, _AT_ONCE)  # a piece at a time: it may be long


def unpack_run(file: Path, folder: Path) -> bool:
    """Put the run of a packed state into `folder`, a team's that has none yet.

    Args:
        file: What `packed` returned; or any other file: nothing is done then.
        folder: The team's folder.

    Returns:
        Whether there was a run, and it is whole.

    Raises:
        OSError: if it cannot be written.
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
    if (folder / FILES).is_dir():  # of a sketch, they are written when they are needed
        shutil.copytree(folder / FILES, run.team)
    check(run)
    run.save()
    return True


def _written(found: dict[str, bytes], runs: Path) -> Path:
    """Return the folder of a run of these files: all of them, or none. Raises `OSError` if they cannot be written."""
    fresh = runs / _FRESH
    fresh.mkdir(mode=0o700, parents=True)
    try:
        for name, piece in found.items():
            (fresh / name).write_bytes(piece)
        return fresh.rename(runs / _FIRST)  # only now it is seen: what has no record yet is removed
    except BaseException:
        shutil.rmtree(fresh, ignore_errors=True)
        raise


def _found(archive: zipfile.ZipFile) -> dict[str, bytes]:
    """Return the files of the run; none, if one is too large. Names are compared, never used as paths."""
    found: dict[str, bytes] = {}
    left = MAX_BYTES
    for entry in archive.infolist():
        _, _, inside = entry.filename.partition("/")
        name = inside.removeprefix(f"{_PLACE}/")
        if name == inside or name not in _FILES or name in found:
            continue
        most = min(left, MOST_AT_ONCE.get(name, left))
        with archive.open(entry) as stream:  # what an entry says of its own size need not be true
            found[name] = stream.read(most + 1)
        if len(found[name]) > most:
            return {}
        left -= len(found[name])
    return found


def _is_sound(found: dict[str, bytes]) -> bool:
    try:
        msgspec.json.decode(found[RECORD], type=Record)
        sketch = msgspec.json.decode(found[SKETCH], type=Sketch)
        change = msgspec.json.decode(found[CHANGE], type=Change) if CHANGE in found else None
    except (msgspec.DecodeError, RecursionError, UnicodeError):
        return False
    if not is_sound(sketch) or (change is not None and not change.is_sound):
        return False
    return not (sketch.decisions and errors_of(sketch))  # without any: the picture of a team that was not drawn here
