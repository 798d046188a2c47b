"""Connections to a running ROS: DDS, rmw_zenoh and rosbridge, and rospy or rclpy where these are installed.

Sinks and sources must not import `services`, which needs rosbags, so the services of each connection are in a separate
module.
"""
