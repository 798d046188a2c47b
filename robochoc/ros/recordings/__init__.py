"""Recordings of ROS messages: MCAP files and ROS 1 bags are written and read, ROS 2 bags in SQLite are read."""
