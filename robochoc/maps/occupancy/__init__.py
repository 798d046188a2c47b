"""Occupancy grids as ROS's map_server keeps them: a YAML file, and the image that it names."""
