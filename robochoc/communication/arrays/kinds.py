"""Names for kinds of arrays, and how long a short axis is."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Integers = NDArray[np.integer]
"""Integers of any width."""
Floats = NDArray[np.float64]
Flags = NDArray[np.bool_]
Places = NDArray[np.intp] | NDArray[np.int32] | NDArray[np.int64] | Integers
"""Places in other arrays."""
Index = slice | Places
"""A choice of rows."""

FEW = 8
"""Up to so many values a loop over them is faster than numpy's along the short axis."""
