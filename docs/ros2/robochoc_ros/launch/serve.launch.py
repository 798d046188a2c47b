"""Decide for others on request: `ros2 launch robochoc_ros serve.launch.py team:=/path/to/team`."""

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument, ExecuteProcess
from launch.substitutions import LaunchConfiguration


def generate_launch_description() -> LaunchDescription:
    """Return what is started, and the arguments that it takes."""
    arguments = [
        DeclareLaunchArgument("team", description="The folder with the robots' files, or a folder of teams."),
        DeclareLaunchArgument(
            "ros", default_value="dds", description="Where requests come from: dds, rclpy, rmw_zenoh."
        ),
        DeclareLaunchArgument("timeout", default_value="60", description="Seconds for one request, at most."),
    ]
    command = [
        "robochoc",
        "serve",
        LaunchConfiguration("team"),
        "--ros",
        LaunchConfiguration("ros"),
        "--timeout",
        LaunchConfiguration("timeout"),
    ]
    return LaunchDescription([*arguments, ExecuteProcess(cmd=command, output="screen")])
