"""The protocols that can run as arrays."""

from __future__ import annotations

from types import MappingProxyType

from robochoc.communication.arrays.cycle_run import CycleRun
from robochoc.communication.arrays.dsa import ArrayDSA
from robochoc.communication.arrays.maxsum import ArrayMaxSum
from robochoc.communication.arrays.mgm import ArrayMGM
from robochoc.communication.arrays.mgm2 import ArrayMGM2
from robochoc.protocols.inference.maxsum import MaxSum
from robochoc.protocols.local_search.dsa import DSA
from robochoc.protocols.local_search.mgm import MGM
from robochoc.protocols.local_search.mgm2 import MGM2
from robochoc.protocols.protocol import Protocol
from robochoc.solver.errors import UnsupportedError

_ARRAY_RUNS: MappingProxyType[type[Protocol], type[CycleRun]] = MappingProxyType(
    {DSA: ArrayDSA, MGM: ArrayMGM, MGM2: ArrayMGM2, MaxSum: ArrayMaxSum}
)


def array_run_for(protocol: type[Protocol], *, cluster: bool = False) -> type[CycleRun]:
    """Return the array implementation of `protocol`. Raises `UnsupportedError` if there is none.

    `cluster`: true if it must be able to run in several blocks.
    """
    form = _ARRAY_RUNS.get(protocol)
    if form is None:
        able = ", ".join(kind.__name__.lower() for kind in _ARRAY_RUNS)
        raise UnsupportedError(
            f"{protocol.__name__} has no array implementation; use --runtime simulator, or one of {able}"
        )
    if cluster and not form.in_blocks:
        able = ", ".join(kind.__name__.lower() for kind, one in _ARRAY_RUNS.items() if one.in_blocks)
        raise UnsupportedError(f"{protocol.__name__} cannot run on a cluster; remove --cluster, or use one of {able}")
    return form
