"""Connections to a Dask cluster (https://distributed.dask.org). Extra: `cluster`.

Dask itself unpickles received data, so only users who may run programs on the cluster should be able to reach the
scheduler.
"""

from __future__ import annotations

from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING
from urllib.parse import urlsplit

import msgspec

from robochoc.communication.search_result import ClusterLostError
from robochoc.formats.diagnostics import invalid_input
from robochoc.solver.errors import UnsupportedError

if TYPE_CHECKING:
    from distributed import Client


class SchedulerLostError(ClusterLostError):
    """The scheduler cannot be reached, or the connection to it was lost."""


class InvalidSchedulerError(UnsupportedError):
    """The address of a scheduler is invalid."""


class _SchedulerFile(msgspec.Struct):
    """The relevant part of a Dask scheduler's JSON file."""

    address: str


def require_dask() -> None:
    """Raise `UnsupportedError` if Dask is not installed."""
    if find_spec("distributed") is None:
        raise UnsupportedError("a cluster requires Dask, which is not installed: pip install 'robochoc[cluster]'")


def connect(place: str, name: str) -> Client:
    """Return a client of a scheduler.

    Args:
        place: The scheduler's address, such as `tcp://10.0.0.1:8786`, or the path of its JSON file, as `dask scheduler
            --scheduler-file` and dask-jobqueue write it.
        name: The name of the client.

    Raises:
        InvalidSchedulerError: if the address is invalid.
        InvalidInputError: if the file is missing or invalid.
        SchedulerLostError: if the scheduler cannot be reached.
    """
    from distributed import Client  # noqa: PLC0415 - an extra

    try:
        address = address_of(place)
        _check_address(address, place)
        return Client(address, set_as_default=False, name=name)
    except (OSError, ValueError) as error:
        raise SchedulerLostError(f"the scheduler at {place} cannot be reached: {error}") from None


def address_of(place: str) -> str:
    """Return the address of a scheduler: `place`, or the address in this file. Raises `InvalidInputError`."""
    if "://" in place:
        return place
    try:
        return msgspec.json.decode(Path(place).read_bytes(), type=_SchedulerFile).address
    except (OSError, msgspec.MsgspecError) as wrong:
        why = wrong.strerror if isinstance(wrong, OSError) else wrong
        hint = "name the JSON file of a Dask scheduler, or an address such as tcp://10.0.0.1:8786"
        raise invalid_input(place or "--cluster ''", f"is not a scheduler's file: {why}", hint) from None


def _check_address(address: str, place: str) -> None:
    """Raise `InvalidSchedulerError` for an invalid address, which Dask reports late, and in several lines.

    Raises `OSError` if the host is unknown.
    """
    from distributed.comm import resolve_address  # noqa: PLC0415 - an extra

    try:
        resolve_address(address)
        fault = "port 0" if urlsplit(address).port == 0 else ""
    except ValueError as wrong:
        fault = str(wrong)
    if fault:
        where = "" if address == place else f" in {place}"
        raise InvalidSchedulerError(
            f"{address!r}{where} is not the address of a scheduler ({fault});"
            " expected tcp://HOST:PORT, with a port from 1 to 65535"
        )
