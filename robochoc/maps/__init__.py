"""Maps: occupancy grids, OctoMaps, the ground under a team, reachability, and routes around walls."""
