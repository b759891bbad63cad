"""
Starts two arms in the namespaces left and right: for each a simulator and, where installed, a robot_state_publisher.

ros2 launch planar_chain_sim two_arms.launch.py left:=double_pendulum.yaml right:=seven_link_arm.yaml

The arms take their parameters from two_arms.yaml beside this file, or from parameters:=FILE. Frames bear the namespace,
left/world and right/world; here the right one stands a metre behind the left one.
"""
from pathlib import Path
import sys

try:
    from ament_index_python.packages import get_package_prefix, PackageNotFoundError
    from launch import LaunchDescription
    from launch.actions import DeclareLaunchArgument, GroupAction, IncludeLaunchDescription
    from launch.launch_description_sources import PythonLaunchDescriptionSource
    from launch.substitutions import LaunchConfiguration
    from launch_ros.actions import Node
except ImportError as error:
    print(f'two_arms.launch.py: needs launch and launch_ros ({error}), must be run by ros2 launch where ROS 2 is '
          'installed (apt install ros-jazzy-launch-ros)', file=sys.stderr)
    sys.exit(2)

FOLDER = Path(__file__).parent
ARMS = {'left': ('four_link_robot.yaml', '0.0'), 'right': ('seven_link_arm.yaml', '1.0')}   # chain, y of its world in m


def arm(name):
    """Return one arm: view.launch.py in a group of its own, so that its arguments stay its own."""
    return GroupAction([IncludeLaunchDescription(
        PythonLaunchDescriptionSource(str(FOLDER / 'view.launch.py')),
        launch_arguments={'chain': LaunchConfiguration(name), 'namespace': name, 'rviz': 'false',
                          'parameters': LaunchConfiguration('parameters')}.items())])


def places():
    """Return a publisher of each arm's place in the common frame world, none if tf2_ros is not installed."""
    try:
        get_package_prefix('tf2_ros')
    except PackageNotFoundError:
        return []
    return [Node(package='tf2_ros', executable='static_transform_publisher', namespace=name,
                 arguments=['--y', y, '--frame-id', 'world', '--child-frame-id', f'{name}/world'])
            for name, (_, y) in ARMS.items()]


def generate_launch_description():
    """Return what ros2 launch starts."""
    return LaunchDescription([
        *(DeclareLaunchArgument(name, default_value=chain, description=f'chain file, URDF or MJCF of the {name} arm')
          for name, (chain, _) in ARMS.items()),
        DeclareLaunchArgument('parameters', default_value=str(FOLDER / 'two_arms.yaml'), description='of both arms'),
        *map(arm, ARMS), *places()])
