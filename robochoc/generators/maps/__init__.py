"""Families of problems on a map: a robot's values are the cells that it can reach, at the cost of travel times."""
