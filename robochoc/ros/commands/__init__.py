"""Sinks that command the robots of ROS 2 packages by actions and services, and sources of what these robots report."""
