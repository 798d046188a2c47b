"""Optional members of a protocol that control how a replay shows its state.

A replay shows a robot's state after each of its steps (`replay/inspection.py`). It finds agent views, nogood stores,
contexts and partial assignments by themselves. A protocol overrides these members only where that is not enough.
Looking changes nothing: none of them may check constraints or change state.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import ClassVar

from robochoc.model.message import Value
from robochoc.system.compiling import mypyc_attr


@mypyc_attr(allow_interpreted_subclasses=True)
class Inspectable:
    """The base of `Protocol`: optional members that show its state."""

    numbered_values: ClassVar[bool] = False
    """Whether robots never see others' values, but numbers of assignments; `view` holds these numbers then."""

    @property
    def checked_against(self) -> Mapping[str, Value] | None:
        """The values of others that own values are checked against; None: all that this robot knows."""
        return None

    @property
    def kept_nogoods(self) -> Iterable[Mapping[str, Value]]:
        """The nogoods outside a `NogoodStore`: assignments that cannot all hold, the own one included."""
        return ()

    def value_notes(self, index: int) -> Mapping[str, float]:  # noqa: ARG002 - for those that have notes
        """Return this robot's notes on its value at `index`, by name: `{"LB": 3, "UB": 7}`."""
        return {}

    def tried(self, index: int) -> bool:  # noqa: ARG002 - as above
        """Return whether the value at `index` has been tried without success for the current view."""
        return False
