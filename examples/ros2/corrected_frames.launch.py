"""`robot_state_publisher` for the calibrated URDF, and the frames of the calibrated model beside it.

    ros2 launch corrected_frames.launch.py folder:=results/ripley robot:=ripley of:="['tool']"

Not run under ROS: see README.md.
"""

from pathlib import Path
from typing import Any

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument, ExecuteProcess, OpaqueFunction
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node

HERE = Path(__file__).resolve().parent


def nodes(context: Any) -> list[Any]:
    def given(name: str) -> str:
        return str(LaunchConfiguration(name).perform(context))

    folder, robot = Path(given("folder")), given("robot")
    urdf = (folder / f"{robot}.calibrated.urdf").read_text()
    model = folder / f"{robot}.calibrated.model.json"
    arguments = ["--ros-args", "-p", f"model:={model}", "-p", f"of:={given('of')}"]
    return [
        Node(
            package="robot_state_publisher",
            executable="robot_state_publisher",
            parameters=[{"robot_description": urdf}],
        ),
        ExecuteProcess(cmd=["python3", str(HERE / "corrected_frames.py"), *arguments], output="screen"),
    ]


def generate_launch_description() -> LaunchDescription:
    return LaunchDescription(
        [
            DeclareLaunchArgument("folder", description="Folder of results of `calib run`"),
            DeclareLaunchArgument("robot", description="The robot's name, as in the file names"),
            DeclareLaunchArgument("of", default_value="['tool']", description="Links, bodies or points"),
            OpaqueFunction(function=nodes),
        ]
    )
