"""Flights of drones: missions, routes that keep a distance, and the simulated quadrotor. Nothing of ROS."""
