"""Recordings of ROS messages: writes and reads MCAP files and ROS 1 bags, and reads ROS 2 bags in SQLite."""
