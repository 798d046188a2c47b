"""Undo and redo of edits."""

from __future__ import annotations

import msgspec

from robochoc.app.sketch.sketch import Sketch

MAX_STEPS = 200
"""The maximum number of undo steps."""


class History(msgspec.Struct, frozen=True):
    """A sketch, the earlier sketches (`before`), and the undone ones. The last in `after` is the next one for redo."""

    now: Sketch
    before: tuple[Sketch, ...] = ()
    after: tuple[Sketch, ...] = ()

    def edited(self, sketch: Sketch) -> History:
        """Return the history after an edit, without redo steps."""
        if sketch == self.now:
            return self
        return History(sketch, (*self.before, self.now)[-MAX_STEPS:])

    def undone(self) -> History:
        """Return the history after an undo."""
        if not self.before:
            return self
        return History(self.before[-1], self.before[:-1], (*self.after, self.now))

    def redone(self) -> History:
        """Return the history after a redo."""
        if not self.after:
            return self
        return History(self.after[-1], (*self.before, self.now), self.after[:-1])
