"""Reads maps in all supported formats: occupancy grids of ROS's map_server, and octrees of OctoMap."""

from __future__ import annotations

from pathlib import Path
from typing import TypeAlias

from robochoc.maps.file_content import as_input_errors, read_beginning
from robochoc.maps.occupancy.grid import OccupancyGrid, read_occupancy_grid
from robochoc.maps.octomap.octree import is_octomap
from robochoc.maps.octomap.voxels import VoxelGrid, read_voxels

Map: TypeAlias = OccupancyGrid | VoxelGrid
_BEGINNING = 64


def read_map(path: Path) -> Map:
    """Return the map in a file: an OctoMap, recognised by its first bytes, or the YAML file of an occupancy grid.

    Raises:
        InvalidInputError: The file or its image cannot be read, is not valid, or is too large.
    """
    with as_input_errors(path):
        begin = read_beginning(path, _BEGINNING)
    return read_voxels(path) if is_octomap(begin) else read_occupancy_grid(path)
