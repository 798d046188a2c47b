"""From metres to the cells in which a mission's box is drawn."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from robochoc.flight.layout import Axis
from robochoc.flight.mission import Mission

_Array = npt.NDArray[np.float64]


def in_cells(mission: Mission, metres: _Array) -> _Array:
    """Return points (..., 3), given in metres, in the cells of the mission's box."""
    parts = [_cells(axis, metres[..., number] / mission.scale) for number, axis in enumerate(mission.axes)]
    return np.stack(parts, axis=-1)


def _cells(axis: Axis, values: _Array) -> _Array:
    """Return `Axis.at` of many values."""
    span = axis.last - axis.first
    return axis.low + (values - axis.first) * ((axis.high - axis.low) / span if span else 1.0)
