"""Coordination of several drones: the order of their moves, and a timetable in which they keep their distance."""
