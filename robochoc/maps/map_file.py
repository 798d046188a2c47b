"""Maps, whatever format they are in: occupancy grids of ROS's map_server, and octrees of OctoMap."""

from __future__ import annotations

from pathlib import Path
from typing import TypeAlias

from robochoc.maps.map_content import beginning_of, told
from robochoc.maps.occupancy.grid import OccupancyGrid, read_occupancy_grid
from robochoc.maps.octomap.octree import is_octomap
from robochoc.maps.octomap.voxels import VoxelGrid, read_voxels

Map: TypeAlias = OccupancyGrid | VoxelGrid
_BEGINNING = 64


def read_map(path: Path) -> Map:
    """Return the map in a file. What begins as OctoMap's files do is one of them, else it is the YAML file of a grid.

    Raises:
        InvalidInputError: The file, or the image that it names, cannot be read, is no such file, or is too large.
    """
    with told(path):
        begin = beginning_of(path, _BEGINNING)
    return read_voxels(path) if is_octomap(begin) else read_occupancy_grid(path)
