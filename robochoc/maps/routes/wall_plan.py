"""Walls that drones fly around, for maps in two and in three dimensions."""

from __future__ import annotations

from typing import TypeAlias

from robochoc.maps.routes.floor_plan import FloorPlan
from robochoc.maps.routes.voxel_plan import VoxelPlan
from robochoc.maps.walls import VoxelFrame, Walls

WallPlan: TypeAlias = FloorPlan | VoxelPlan
"""Walls in two or three dimensions. Both find distances to walls, check straight lines, and find routes."""


def wall_plan_of(walls: Walls) -> WallPlan:
    """Return the plan for walls, with the robots' radius as distance."""
    frame = walls.frame
    if isinstance(frame, VoxelFrame):
        return VoxelPlan(walls.solid, frame, walls.radius)
    return FloorPlan(walls.solid, frame, walls.radius)
