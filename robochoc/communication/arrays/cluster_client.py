"""Connections to a Dask cluster (https://distributed.dask.org). Extra: `cluster`.

Dask itself unpickles received data, so only users who may run programs on the cluster should be able to reach the
scheduler.
"""

from __future__ import annotations

from pathlib import Path

import msgspec
from distributed import Client
from distributed.comm import resolve_address

from robochoc.communication.search_result import ClusterLostError


class SchedulerLostError(ClusterLostError):
    """The scheduler cannot be reached, or the connection to it was lost."""


class _SchedulerFile(msgspec.Struct):
    """The relevant part of a Dask scheduler's JSON file."""

    address: str


def connect(address: str | None, file: Path | None, name: str) -> Client:
    """Return a client of the scheduler at `address`, or of the one in the scheduler's JSON `file`.

    Raises:
        SchedulerLostError: if the scheduler cannot be reached.
    """
    try:
        address = _address_in(file) if file else address
        resolve_address(address)  # Dask reports an invalid address late, and in several lines
        return Client(address, set_as_default=False, name=name)
    except FileNotFoundError:
        hint = "; an address has a scheme, as in tcp://10.0.0.1:8786"
        raise SchedulerLostError(f"there is no scheduler file {file or address}{hint}") from None
    except (OSError, ValueError) as error:
        raise SchedulerLostError(f"the scheduler at {file or address} cannot be reached: {error}") from None


def _address_in(file: Path) -> str:
    """Return the address in a scheduler's file. Raises `OSError`, or `ValueError` if the file contains no address."""
    try:
        return msgspec.json.decode(file.read_bytes(), type=_SchedulerFile).address
    except msgspec.MsgspecError as wrong:
        raise ValueError(f"it is not a scheduler's file: {wrong}") from None
