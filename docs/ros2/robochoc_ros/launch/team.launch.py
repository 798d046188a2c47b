"""Have a team decide, and publish its waypoints: `ros2 launch robochoc_ros team.launch.py team:=/path/to/team`."""

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument, ExecuteProcess
from launch.substitutions import LaunchConfiguration


def generate_launch_description() -> LaunchDescription:
    """Return what is started, and the arguments that it takes."""
    arguments = [
        DeclareLaunchArgument("team", description="The folder with the robots' files."),
        DeclareLaunchArgument("ros", default_value="dds", description="Where waypoints go: dds, rclpy, rmw_zenoh."),
        DeclareLaunchArgument("protocol", default_value="auto", description="As for robochoc solve."),
        DeclareLaunchArgument("frame", default_value="map", description="The frame of all places."),
    ]
    command = [
        "robochoc",
        "solve",
        LaunchConfiguration("team"),
        "--ros",
        LaunchConfiguration("ros"),
        "--protocol",
        LaunchConfiguration("protocol"),
        "--frame",
        LaunchConfiguration("frame"),
        "--tf",
        "--diagnostics",
    ]
    return LaunchDescription([*arguments, ExecuteProcess(cmd=command, output="screen")])
