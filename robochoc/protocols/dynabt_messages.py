"""The message of DynABT that is not ABT's (see `dynabt.py`)."""

from __future__ import annotations

from robochoc.protocols import abt_messages


class Nogood(abt_messages.Nogood, frozen=True):
    """A nogood: the receiver cannot take `value` while all in `lhs` and all constraints in `because` hold."""

    because: list[str]
