"""Flights of drones: missions, coordination of several drones, and the simulated quadrotor. Independent of ROS."""
