"""Opens a team from disk: its folder, an archive of the folder, or a file of another tool."""

from __future__ import annotations

import io
import os
import re
import stat
import zipfile
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path, PurePosixPath

from robochoc.app.sketch.files import MAX_SKETCH, sketch_in
from robochoc.app.sketch.sketch import Sketch
from robochoc.formats import Diagnostic, InvalidInputError, read_team, write_team
from robochoc.formats.diagnostics import invalid_input
from robochoc.formats.dialects.dialect import ImportOptions
from robochoc.formats.dialects.registry import first_bytes, read_foreign, recognise, unknown_format_error
from robochoc.formats.team_writer import SKETCH_FILE
from robochoc.model.problem import Team
from robochoc.system.archives import DAMAGED
from robochoc.system.lazy_dataclass import dataclass
from robochoc.system.temporary_files import PrivateFolder

MAX_FILES = 2_000
"""The maximum number of files in a team. Larger teams can be solved on the command line."""
MAX_BYTES = 64 << 20
"""The maximum number of bytes in all files of a team, or in a file of another tool."""
_PARTS = re.compile(r"(?:(?!late\d*/)[^/]+/)?((?:late\d*/)?[^/]+\.xml|sketch\.json)")
"""The files that are unpacked from an archive: the files of a team, which may be in a folder."""


@dataclass(frozen=True)
class ImportedTeam:
    """An imported team, which can be solved, flown and compared, but not edited.

    Attributes:
        path: The opened file or folder.
        team: The team.
        changed: For a team that was drawn here, the files that were changed later; otherwise empty.
        notes: The changes made by the import, in sentences.
    """

    path: Path
    team: Team
    changed: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()

    @property
    def name(self) -> str:
        """The team's name."""
        return self.team.name

    @property
    def robots(self) -> tuple[str, ...]:
        """The names of the team's robots."""
        return tuple(robot.name for robot in self.team.robots)

    @property
    def variables(self) -> int:
        """The number of variables."""
        return len(self.team.variables)

    @property
    def constraints(self) -> int:
        """The number of constraints."""
        return sum(1 for _ in self.team.constraints())

    def save(self, folder: Path, *, replace: bool = False) -> None:
        """Write the team's XML files into `folder`. Raises `InvalidInputError` as `files.save` does."""
        write_team(self.team, folder, replace=replace)


def open_team(path: Path, *more: Path) -> Sketch | ImportedTeam:
    """Return the team at `path`: the sketch if it was drawn here and is unchanged, otherwise an imported team.

    Args:
        path: A team's folder, a ZIP archive of such a folder, or a file that `robochoc import` reads.
        *more: Further files of the same problem, for formats with several files.

    Raises:
        InvalidInputError: if the format is unknown, the files are too large, or they have errors.
        OSError: if a file cannot be read.
    """
    if path.is_dir() and not more:
        return _folder(path)
    for file in (path, *more):
        if first_bytes(file) is None:
            raise invalid_input(file, "this is not a readable file", "choose a team's folder, or a file")
        if file.stat().st_size > MAX_BYTES:
            raise _too_large(file)
    if not more and zipfile.is_zipfile(path):
        return _archive(path)
    if recognise(path) is None:
        if path.suffix.lower() == ".xml":
            raise invalid_input(path, "the XML format is unknown", "to open a robot's file, open the team's folder")
        raise unknown_format_error(path)
    imported = read_foreign([path, *more], ImportOptions())
    return ImportedTeam(path, imported.team, notes=tuple(note.text for note in imported.notes))


def _folder(folder: Path) -> Sketch | ImportedTeam:
    xml = _xml_in(folder)
    found = sketch_in(folder, xml)
    if isinstance(found, Sketch):
        return found
    return ImportedTeam(folder, read_team(folder), changed=found)


def _xml_in(folder: Path) -> dict[str, bytes]:
    """Return the XML files in a team's folder, including those of robots that join later, by relative path."""
    found: dict[str, bytes] = {}
    total = 0
    for place in [folder, *folder.glob("late*")]:
        for file in place.glob("*.xml") if place.is_dir() else ():
            status = file.stat()
            total += status.st_size
            if len(found) >= MAX_FILES or total > MAX_BYTES:
                raise _too_large(folder)
            if stat.S_ISREG(status.st_mode):  # other kinds of files are reported when the team is read
                found[file.relative_to(folder).as_posix()] = file.read_bytes()
    return found


def _archive(path: Path) -> Sketch | ImportedTeam:
    with PrivateFolder() as place:
        folder = Path(place) / (path.stem or "team")
        folder.mkdir()
        try:
            _unpack(path, folder)
        except InvalidInputError:
            raise
        except DAMAGED as damaged:
            raise invalid_input(path, f"the archive is damaged: {damaged}", "create the archive again") from None
        try:
            found = _folder(folder)
        except InvalidInputError as invalid:
            raise InvalidInputError(_without(str(place), invalid)) from None
    return found if isinstance(found, Sketch) else ImportedTeam(path, found.team, found.changed)


def _unpack(path: Path, folder: Path) -> None:
    """Unpack a team's files from an archive into a folder, within size limits and never outside the folder."""
    taken: set[str] = set()
    left = MAX_BYTES
    with bounded_archive(path) as archive:
        for member in archive.infolist():
            match = _PARTS.fullmatch(member.filename)
            if match is None or member.is_dir() or ".." in PurePosixPath(member.filename).parts:
                continue
            if match[1] in taken or len(taken) > MAX_FILES:
                raise _too_large(path) if len(taken) > MAX_FILES else _two_teams(path, match[1])
            taken.add(match[1])
            most = min(left, MAX_SKETCH) if match[1] == SKETCH_FILE else left
            with archive.open(member) as source:
                content = source.read(most + 1)
            if len(content) > most:
                raise _too_large(path)
            left -= len(content)
            target = folder / match[1]
            target.parent.mkdir(exist_ok=True)
            target.write_bytes(content)
    if not taken:
        raise invalid_input(
            path, "the archive contains no XML files of a team", "choose an archive of one team's folder"
        )


def _too_large(path: Path) -> InvalidInputError:
    hint = "use 'robochoc solve'"
    return invalid_input(path, f"the team has more than {MAX_FILES:,} files or {MAX_BYTES >> 20} MiB", hint)


def _two_teams(path: Path, name: str) -> InvalidInputError:
    return invalid_input(path, f"the archive contains {name} more than once", "choose an archive of one team's folder")


def _without(place: str, invalid: InvalidInputError) -> list[Diagnostic]:
    """Return the errors with paths in the archive instead of paths in the temporary folder."""
    inside = f"{place}{os.sep}"
    return [
        replace(one, file=one.file.removeprefix(inside), message=one.message.replace(inside, ""))
        for one in invalid.diagnostics
    ]


MOST_LISTED = 2 << 20
"""The maximum size of an archive's list of files, which Python reads at once: enough for ten thousand files."""


class BoundedFile(io.FileIO):
    """A file that limits the size of each read.

    Attributes:
        most: The maximum number of bytes read at once. None: no limit.
    """

    most: int | None = MOST_LISTED

    def read(self, size: int | None = -1) -> bytes:
        """Read from the file. Raises `ValueError` if more than `most` bytes would be read."""
        if self.most is not None:
            here = self.tell()
            rest = self.seek(0, io.SEEK_END) - here
            self.seek(here)
            if (rest if size is None or size < 0 else min(size, rest)) > self.most:
                raise ValueError(f"its list of files has more than {self.most:,} bytes")
        return super().read(-1 if size is None else size)


@contextmanager
def bounded_archive(path: Path) -> Iterator[zipfile.ZipFile]:
    """Open an untrusted ZIP archive for reading.

    Raises:
        ValueError: if the archive's list of files is too long.
        OSError: if the archive cannot be read.
        zipfile.BadZipFile: if the archive is damaged; likewise other exceptions of `zipfile.ZipFile`.
    """
    with BoundedFile(path) as file, zipfile.ZipFile(file) as archive:
        file.most = None
        yield archive
