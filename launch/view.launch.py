"""
Starts the simulator, robot_state_publisher and RViz; the last two if they are installed.

ros2 launch planar_chain_sim view.launch.py chain:=seven_link_arm.yaml rviz:=false
"""
from pathlib import Path
import sys

try:
    from ament_index_python.packages import get_package_prefix, PackageNotFoundError
    from launch import LaunchDescription
    from launch.actions import DeclareLaunchArgument, LogInfo, OpaqueFunction
    from launch.substitutions import LaunchConfiguration
    from launch_ros.actions import Node
    from launch_ros.parameter_descriptions import ParameterValue
except ImportError as error:
    print(f'view.launch.py: needs launch and launch_ros ({error}), must be run by ros2 launch where ROS 2 is installed '
          '(apt install ros-jazzy-launch-ros)', file=sys.stderr)
    sys.exit(2)

NAME = 'planar_chain_sim'


def installed(package):
    """Tell whether a ROS package is installed."""
    try:
        return bool(get_package_prefix(package))
    except PackageNotFoundError:
        return False


def description_of(chain):
    """Return the URDF of a chain file; a URDF is returned unchanged."""
    from planar_chain_sim.chain_file import find_chain_file, load_chain
    from planar_chain_sim.robot_files.urdf_writer import urdf_of
    if chain.endswith('.urdf'):
        return find_chain_file(chain).read_text()
    return urdf_of(load_chain(chain))


def start(context):
    """Return the nodes, and a line for each that is not installed."""
    chain, namespace, file = (LaunchConfiguration(name).perform(context)
                              for name in ('chain', 'namespace', 'parameters'))
    viewer = installed('robot_state_publisher')
    parameters = [{'chain_file': chain, 'publish_robot_description': not viewer,
                   'publish_tf': not viewer and not namespace and installed('tf2_msgs')}]
    actions = [Node(package=NAME, executable='simulator', namespace=namespace, output='screen',
                    parameters=parameters + ([file] if file else []))]
    if viewer:   # frames of several robots need different names
        actions.append(Node(package='robot_state_publisher', executable='robot_state_publisher', namespace=namespace,
                            parameters=[{'robot_description': ParameterValue(description_of(chain), value_type=str),
                                         'publish_frequency': 50.0,
                                         'frame_prefix': f'{namespace}/' if namespace else ''}]))
    else:
        actions.append(LogInfo(msg='robot_state_publisher is not installed (apt install '
                               'ros-jazzy-robot-state-publisher): the simulator publishes TF itself where it can'))
    if LaunchConfiguration('rviz').perform(context).lower() in ('true', '1'):
        if installed('rviz2'):
            view = str(Path(__file__).with_name('view.rviz'))
            actions.append(Node(package='rviz2', executable='rviz2', arguments=['-d', view]))
        else:
            actions.append(LogInfo(msg='rviz2 is not installed (apt install ros-jazzy-rviz2): nothing is drawn'))
    return actions


def generate_launch_description():
    """Return what ros2 launch starts."""
    return LaunchDescription([
        DeclareLaunchArgument('chain', default_value='four_link_robot.yaml', description='chain file, URDF or MJCF'),
        DeclareLaunchArgument('namespace', default_value='', description='of the nodes; prefix of the frames'),
        DeclareLaunchArgument('parameters', default_value='', description='YAML file with parameters of the simulator'),
        DeclareLaunchArgument('rviz', default_value='true', description='start RViz too'),
        OpaqueFunction(function=start)])
