"""A ROS that runs: by DDS, rmw_zenoh or rosbridge, or by rospy or rclpy where these are installed."""
