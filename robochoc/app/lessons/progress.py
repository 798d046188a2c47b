"""The user's progress in the lessons, saved in a small file in the folder of the teams."""

from __future__ import annotations

from pathlib import Path

import msgspec

from robochoc.app.lessons.lesson import COUNT, lesson

_FILE = "lessons.json"
_MOST_BYTES = 1 << 16


class LessonProgress:
    """The number of answered steps in each lesson, saved in `folder`; empty if the saved file cannot be read."""

    def __init__(self, folder: Path) -> None:
        self._file = folder / _FILE
        self._done = self._read()

    def done(self, number: int) -> int:
        """Return the number of answered steps at the beginning of a lesson."""
        return min(max(self._done.get(number, 0), 0), len(lesson(number).steps))

    def is_over(self, number: int) -> bool:
        """Return whether all steps of a lesson are answered."""
        return self.done(number) == len(lesson(number).steps)

    def next(self) -> int:
        """Return the first lesson that is not completed, or lesson 1 if all are completed."""
        return next((number for number in range(1, COUNT + 1) if not self.is_over(number)), 1)

    def answered(self, number: int, step: int) -> None:
        """Save that a step, counted from 0, is answered."""
        if step < self.done(number):
            return
        self._done[number] = step + 1
        self._write()

    def restart(self, number: int) -> None:
        """Delete the progress of a lesson."""
        if self._done.pop(number, 0):
            self._write()

    def _read(self) -> dict[int, int]:
        try:
            if self._file.stat().st_size > _MOST_BYTES:
                return {}
            return msgspec.json.decode(self._file.read_bytes(), type=dict[int, int])
        except (OSError, msgspec.DecodeError):
            return {}

    def _write(self) -> None:
        fresh = self._file.with_suffix(".new")
        try:
            fresh.write_bytes(msgspec.json.encode(self._done))
            fresh.replace(self._file)
        except OSError:  # a full disk, for example, does not stop the lesson
            fresh.unlink(missing_ok=True)
