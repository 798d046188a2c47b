"""Connections to a Dask cluster (https://distributed.dask.org). Extra: `cluster`.

Dask itself unpickles received data, so only users who may run programs on the cluster should be able to reach the
scheduler.
"""

from __future__ import annotations

from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING

import msgspec

from robochoc.communication.search_result import ClusterLostError
from robochoc.solver.errors import UnsupportedError

if TYPE_CHECKING:
    from distributed import Client


class SchedulerLostError(ClusterLostError):
    """The scheduler cannot be reached, or the connection to it was lost."""


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
        SchedulerLostError: if the scheduler cannot be reached.
    """
    from distributed import Client  # noqa: PLC0415 - an extra
    from distributed.comm import resolve_address  # noqa: PLC0415 - the same

    try:
        address = place if "://" in place else _address_in(Path(place))
        resolve_address(address)  # Dask reports an invalid address late, and in several lines
        return Client(address, set_as_default=False, name=name)
    except FileNotFoundError:
        hint = "; an address has a scheme, as in tcp://10.0.0.1:8786"
        raise SchedulerLostError(f"there is no scheduler file {place}{hint}") from None
    except (OSError, ValueError) as error:
        raise SchedulerLostError(f"the scheduler at {place} cannot be reached: {error}") from None


def _address_in(file: Path) -> str:
    """Return the address in a scheduler's file. Raises `OSError`, or `ValueError` if the file contains no address."""
    try:
        return msgspec.json.decode(file.read_bytes(), type=_SchedulerFile).address
    except msgspec.MsgspecError as wrong:
        raise ValueError(f"it is not a scheduler's file: {wrong}") from None
