"""
Push a body of a running simulator for some seconds with a force along its own axes, then let it go.

    python examples/push.py forearm 5 0 --seconds 1
"""
from argparse import ArgumentParser
from contextlib import suppress
import json
from math import inf, isfinite
from time import monotonic

from geometry_msgs.msg import WrenchStamped
import rclpy
from rclpy.signals import SignalHandlerOptions
from sensor_msgs.msg import JointState
from std_msgs.msg import String


def main():
    parser = ArgumentParser(description=__doc__.strip().splitlines()[0])
    parser.add_argument('body')
    parser.add_argument('force', nargs=2, type=float, help='N, along the x and y axes of the body')
    parser.add_argument('--seconds', type=float, default=1.0)
    options = parser.parse_args()
    if not (all(map(isfinite, options.force)) and 0.0 <= options.seconds < inf):
        parser.error('the force must be finite, and seconds too and not negative')

    rclpy.init(signal_handler_options=SignalHandlerOptions.NO)      # Ctrl-C is Python's KeyboardInterrupt
    node = rclpy.create_node('push')
    publisher = node.create_publisher(WrenchStamped, 'simulator/wrench', 10)
    events, states = [], []
    node.create_subscription(String, 'simulator/events', lambda message: events.append(json.loads(message.data)), 10)
    heard = node.create_subscription(JointState, 'joint_states', states.append, 1)
    print('waiting for the simulator ...', flush=True)
    while not (publisher.get_subscription_count() and states):      # who hears this topic hears events too, made before
        rclpy.spin_once(node, timeout_sec=0.05)
    node.destroy_subscription(heard)
    wrench = WrenchStamped()
    wrench.header.frame_id = options.body
    wrench.wrench.force.x, wrench.wrench.force.y = options.force
    publisher.publish(wrench)
    print(f'pushing {options.body} with {options.force} N', flush=True)
    end = monotonic() + options.seconds
    try:
        while monotonic() < end:
            rclpy.spin_once(node, timeout_sec=min(0.1, max(0.0, end - monotonic())))    # Ctrl-C waits for its end
            for event in events:
                if event['kind'] == 'rejected' and event['data']['topic'].endswith('simulator/wrench'):
                    parser.error(f"the simulator refuses the push: {event['data']['reason']}")
    finally:                                                # after Ctrl-C too: a wrench acts until the next one
        wrench.wrench.force.x = wrench.wrench.force.y = 0.0
        publisher.publish(wrench)
        publisher.wait_for_all_acked(rclpy.duration.Duration(seconds=2))
    print('let go')
    node.destroy_node()
    rclpy.shutdown()


if __name__ == '__main__':
    with suppress(KeyboardInterrupt):
        main()
