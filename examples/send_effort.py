"""
Send constant efforts to a running simulator for some seconds and print where its joints are, as `ros2 topic pub` would.

    python examples/send_effort.py 0 20 0 0 0 --seconds 3
"""
from argparse import ArgumentParser
from contextlib import suppress
from math import inf, isfinite

import rclpy
from rclpy.signals import SignalHandlerOptions
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray


def main():
    parser = ArgumentParser(description=__doc__.strip().splitlines()[0])
    parser.add_argument('effort', nargs='+', type=float, help='N m or N, one for each joint, in joint order')
    parser.add_argument('--seconds', type=float, default=2.0)
    options = parser.parse_args()
    if not (all(map(isfinite, options.effort)) and 0.0 <= options.seconds < inf):
        parser.error('efforts must be finite, and seconds too and not negative')

    rclpy.init(signal_handler_options=SignalHandlerOptions.NO)      # Ctrl-C is Python's KeyboardInterrupt
    node = rclpy.create_node('send_effort')
    publisher = node.create_publisher(Float64MultiArray, 'simulator/commands', 10)
    states = []
    node.create_subscription(JointState, 'joint_states', states.append, 10)
    print('waiting for the simulator ...', flush=True)
    while not (states and publisher.get_subscription_count()):
        rclpy.spin_once(node, timeout_sec=0.1)
    names = states[-1].name
    if len(options.effort) != len(names):
        parser.error(f'{len(options.effort)} efforts were given, must be {len(names)}: one for each of '
                     f'{", ".join(names)}')
    publisher.publish(Float64MultiArray(data=options.effort))       # acts until the next command, or until we leave
    states.clear()
    while not states or stamp(states[-1]) - stamp(states[0]) < options.seconds:
        rclpy.spin_once(node, timeout_sec=0.1)
        del states[1:-1]
    for name, before, after, effort in zip(names, states[0].position, states[-1].position, states[-1].effort):
        print(f'{name}: {before:.3f} -> {after:.3f}, effort {effort:g}')
    node.destroy_node()
    rclpy.shutdown()


def stamp(state):
    """Return the time of a state, s."""
    return state.header.stamp.sec + 1e-9 * state.header.stamp.nanosec


if __name__ == '__main__':
    with suppress(KeyboardInterrupt):
        main()
