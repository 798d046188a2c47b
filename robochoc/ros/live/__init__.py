"""Connections to a running ROS: DDS, rmw_zenoh and rosbridge, and rospy or rclpy where these are installed.

Sinks and sources do not import `services`, which needs rosbags: so each connection's services have their own module.
"""
