"""The search for the master that leads, for programs that only read from it, such as observers."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from typing import TypeVar

from robochoc.communication.network.masters import listens
from robochoc.communication.network.transport import CannotConnectError
from robochoc.run.networked.address import Address
from robochoc.run.networked.directory_query import NoAnswerError

Result = TypeVar("Result")
_ROUND_S = 0.5


def at_leader(places: Sequence[Address], patience_s: float, request: Callable[[Address], Result]) -> Result:
    """Return the result of `request` at the first master that answers. Only a leading master listens.

    Args:
        places: The addresses of the masters, by priority.
        patience_s: With several masters, the longest wait until one of them listens, in seconds.
        request: Sends a request to the master at an address.

    Raises:
        CannotConnectError: if no master listens, or `request` raises it at the last one.
        NoAnswerError: if `request` raises it at the last master that listens.
    """
    if len(places) == 1:
        return request(places[0])
    until = time.monotonic() + patience_s
    while True:
        listening = [place for place in places if listens(str(place))]
        for place in listening:
            try:
                return request(place)
            except (CannotConnectError, NoAnswerError):
                if place == listening[-1]:
                    raise
        if time.monotonic() > until:
            names = ", ".join(map(str, places))
            raise CannotConnectError(f"no master leads: none of {names} listened for {patience_s:g} s")
        time.sleep(_ROUND_S)
