"""Reachability on maps: cells, the free space of a robot, path lengths, and travel times of robots to cells."""
