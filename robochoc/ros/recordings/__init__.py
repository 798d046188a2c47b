"""Recordings of ROS messages, written and read: MCAP files, and bags of ROS 1."""
