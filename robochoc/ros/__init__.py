"""The ROS Layer unit (Section 4.2): publishes decisions to robots, and reads the reports of robots."""
