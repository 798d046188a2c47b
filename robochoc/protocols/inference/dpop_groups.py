"""Tables in DPOP over the variables that constraints name, and their division into independent groups (see `dpop`).

A constraint may name some of a robot's variables only. Its table then does not distinguish all values of the robot: a
`Partition` gives the code of each value, the same for values that are not distinguished. Tables with different
partitions are joined over their common refinement, which contains only combinations that the robot really has.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from robochoc.protocols.message import Value

Partition = NDArray[np.intp] | None
"""The code of each value of a robot, in the order of first occurrence. None: all values are distinguished."""


def partition_of(values: Sequence[Value], places: Sequence[int]) -> Partition:
    """Return the partition of a robot's `values` by the variables at `places`.

    Raises:
        ValueError: if a value has too few parts.
    """
    codes: dict[Value, int] = {}
    try:
        found = [codes.setdefault(tuple([value[place] for place in places]), len(codes)) for value in values]
    except IndexError:
        raise ValueError(f"a value has too few parts: it needs {max(places) + 1}") from None
    return None if len(codes) == len(values) else np.array(found, np.intp)


def length_of(partition: Partition, size: int) -> int:
    """Return the number of codes for a robot with `size` values."""
    return size if partition is None else int(partition.max()) + 1
