"""The ROS Layer unit (Section 4.2): it applies decisions to robots, and reads the robots' situation."""
