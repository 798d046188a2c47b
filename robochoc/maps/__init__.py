"""Maps as data: occupancy grids, OctoMaps, the ground under a team, and the places of its values."""
