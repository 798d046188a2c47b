"""A ROS that runs: by rosbridge, or by rospy where that is installed."""
