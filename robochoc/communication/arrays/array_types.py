"""Types of arrays, and the length of a short axis."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Integers = NDArray[np.integer]
"""Integers of any width."""
Floats = NDArray[np.float64]
Flags = NDArray[np.bool_]
Places = NDArray[np.intp] | NDArray[np.int32] | NDArray[np.int64] | Integers
"""Indices in other arrays."""
Index = slice | Places
"""A selection of rows."""

FEW = 8
"""The longest axis along which a Python loop is faster than numpy's."""
