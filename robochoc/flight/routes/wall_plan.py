"""Walls that drones fly around, whatever the map is."""

from __future__ import annotations

from typing import TypeAlias

from robochoc.flight.routes.floor_plan import FloorPlan
from robochoc.flight.routes.voxel_plan import VoxelPlan

WallPlan: TypeAlias = FloorPlan | VoxelPlan
"""Walls in the plane, or in space. Both tell clearances, which lines are open, and ways."""
