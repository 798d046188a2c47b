"""The message of DynABT that is not ABT's (see `dynabt.py`)."""

from __future__ import annotations

from robochoc.protocols.satisfaction.messages.nogood import Nogood as PlainNogood


class Nogood(PlainNogood, frozen=True):
    """A nogood: the receiver cannot take `value` while all in `lhs` and all constraints in `because` hold."""

    because: list[str]
