"""The edges of Max-Sum between a variable in one block and a function that another block also computes."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np

from robochoc.communication.arrays.array_types import Integers
from robochoc.communication.arrays.border import Border

if TYPE_CHECKING:
    from robochoc.communication.arrays.maxsum import Factors, Ports

Edges = dict[int, Integers]
"""The indices of edges, by block."""


def shared_edges(
    border: Border, all_factors: list[Factors], all_sides: list[list[tuple[Ports, slice]]]
) -> Mapping[int, tuple[Edges, Edges]]:
    """Return, for each number of values, the edges whose Q is sent to, and received from, each other block.

    Two blocks list the edges between them in the same order: by robot, holder, and function.
    """
    found: dict[int, tuple[Edges, Edges]] = defaultdict(lambda: ({}, {}))
    if border.blocks is None:
        return found
    parts: dict[tuple[int, int, int], list[Integers]] = defaultdict(list)
    for factors, sides in zip(all_factors, all_sides, strict=True):
        blocks, robots = border.blocks[factors.rows], border.robots[factors.rows]
        for place, (ports, edges) in enumerate(sides):
            indices = np.arange(edges.start, edges.stop)
            keys = np.column_stack([robots[:, [place, -1]], factors.numbers, indices])
            is_own = blocks[:, place] == border.number
            for other in np.unique(blocks[blocks != border.number]).tolist():
                outgoing = is_own & (blocks == other).any(axis=1)
                parts[ports.group.size, 0, other].append(keys[outgoing])
                parts[ports.group.size, 1, other].append(keys[blocks[:, place] == other])
    for (size, way, other), lists in parts.items():
        keys = np.concatenate(lists)
        found[size][way][other] = keys[np.lexsort(keys[:, 2::-1].T), 3]
    return found
