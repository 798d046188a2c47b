"""Families of problems on a map: a robot's values are the cells that it can get to, and ways cost time."""
