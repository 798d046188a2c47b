"""The functions in `_kernels.c`: their library, and functions that replace those of numpy and Python.

They exist in wheels with a compiled core (`hatch_build.py`), and are not used if `ROBOCHOC_PURE` is set.
"""

from __future__ import annotations

import ctypes
import os
from collections.abc import Iterable
from functools import cache
from importlib.util import find_spec

import numpy as np
from numpy.typing import NDArray

from robochoc.communication.arrays.array_types import Integers
from robochoc.protocols.chance import key_and_step

_WIDE = np.dtype(np.int64)
_SEPARATOR = "\0"


@cache
def compiled_functions() -> ctypes.CDLL | None:
    """Return the compiled functions, or None if there are none."""
    if os.environ.get("ROBOCHOC_PURE", "0") not in {"", "0"} or ctypes.sizeof(ctypes.c_void_p) != _WIDE.itemsize:
        return None
    found = find_spec("robochoc.communication.arrays._kernels")
    return None if found is None or found.origin is None else ctypes.CDLL(found.origin)


def start_of(array: Integers) -> int:
    """Return the address of an array. Raises `ValueError` if its entries are not in one piece."""
    if not array.flags.c_contiguous:
        raise ValueError("the array is not contiguous")
    address: int = array.__array_interface__["data"][0]
    return address


def sort_order(numbers: Integers) -> Integers:
    """Return the indices of these numbers of 0 or more in ascending order; equal numbers keep their order."""
    functions = compiled_functions()
    if functions is None:
        return np.argsort(numbers, kind="stable")
    arrays = [numbers.astype(np.int64), *(np.empty(len(numbers), np.int64) for _ in range(3))]
    functions.sort_order(*(ctypes.c_int64(start_of(array)) for array in arrays), ctypes.c_int64(len(numbers)))
    return arrays[1]


def keys_and_steps(seed: int, names: Iterable[str], many: int) -> tuple[NDArray[np.uint64], NDArray[np.uint64]]:
    """Return the result of `key_and_step` for each of `many` names."""
    functions, listed = compiled_functions(), list(names)
    text = _SEPARATOR.join(listed)
    if functions is not None and many and text.count(_SEPARATOR) == many - 1:
        keys, steps = np.empty(many, np.uint64), np.empty(many, np.uint64)
        start, content = f"{seed} ".encode(), text.encode()
        sizes = (ctypes.c_int64(len(start)), ctypes.c_int64(len(content)))
        addresses = (ctypes.c_int64(start_of(array)) for array in (keys, steps))
        if not functions.draw_keys(start, sizes[0], content, sizes[1], *addresses):
            return keys, steps
    pairs = np.fromiter((word for name in listed for word in key_and_step(seed, name)), np.uint64, 2 * many)
    return np.ascontiguousarray(pairs[::2]), np.ascontiguousarray(pairs[1::2])
