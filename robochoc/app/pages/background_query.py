"""Run a slow query of a page in a thread; return its result or an error text."""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeVar

from nicegui import run

from robochoc.app.log import log_error
from robochoc.app.sketch.troubles import NotReadyError
from robochoc.system.errors import RobochocError

T = TypeVar("T")


class ErrorText(str):
    """A sentence that explains why a query has no result."""

    __slots__ = ()


async def run_query(query: Callable[..., T], *arguments: object) -> T | ErrorText | None:
    """Run a query in a thread; return its result or an error text, or None if the application is shutting down."""
    try:
        return await run.io_bound(query, *arguments)
    except (NotReadyError, RobochocError) as error:
        return ErrorText(error)
    except Exception as fault:  # noqa: BLE001 - shown, and written to the error log
        return ErrorText(log_error(fault, getattr(query, "__name__", "query")))
