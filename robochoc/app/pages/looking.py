"""What a page finds out in a thread: of a large team that takes its time. It is told, whatever comes of it."""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeVar

from nicegui import run

from robochoc.app.log import noted
from robochoc.app.sketch.troubles import NotReadyError
from robochoc.formats import InvalidInputError
from robochoc.modelling.errors import ModelError
from robochoc.solver.encoding import UnsupportedError

T = TypeVar("T")


class Wrong(str):
    """A sentence about why nothing was found."""

    __slots__ = ()


async def looked(look: Callable[..., T], *given: object) -> T | Wrong | None:
    """Return what `look` finds, in a thread. None: the application ends."""
    try:
        return await run.io_bound(look, *given)
    except (NotReadyError, ModelError, InvalidInputError, UnsupportedError) as mistake:
        return Wrong(mistake)
    except Exception as fault:  # noqa: BLE001 - told, and kept in the file of errors
        return Wrong(noted(fault, getattr(look, "__name__", "look")))
