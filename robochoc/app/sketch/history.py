"""Undo and redo: the sketches that there were."""

from __future__ import annotations

import msgspec

from robochoc.app.sketch.sketch import Sketch

MAX_STEPS = 200
"""So many steps can be undone."""


class History(msgspec.Struct, frozen=True):
    """A sketch, those before it, and those that were undone. `after` has the next one last."""

    now: Sketch
    before: tuple[Sketch, ...] = ()
    after: tuple[Sketch, ...] = ()

    def edited(self, sketch: Sketch) -> History:
        """Return the history after an edit. What had been undone is gone."""
        if sketch == self.now:
            return self
        return History(sketch, (*self.before, self.now)[-MAX_STEPS:])

    def undone(self) -> History:
        """Return the history one step back."""
        if not self.before:
            return self
        return History(self.before[-1], self.before[:-1], (*self.after, self.now))

    def redone(self) -> History:
        """Return the history one step forth."""
        if not self.after:
            return self
        return History(self.after[-1], (*self.before, self.now), self.after[:-1])
