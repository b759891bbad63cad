"""
A subscriber that joins again and again, as a process of its own: each time a new participant.

    python joiner.py TOPIC ROUNDS PERIOD BEGIN

Round k begins at BEGIN + k PERIOD, s by the monotonic clock, so that several of these processes join at once. A line
says each round that heard the topic.
"""
import sys
import time

import rclpy
from rclpy.node import Node
from rclpy.signals import SignalHandlerOptions
from sensor_msgs.msg import JointState


def _never_called(message):
    """Do nothing: rclpy requires a callback, but messages are taken by hand."""


def main():
    topic, rounds, period, begin = sys.argv[1], int(sys.argv[2]), float(sys.argv[3]), float(sys.argv[4])
    for k in range(rounds):
        time.sleep(max(begin + k * period - time.monotonic(), 0.0))
        context = rclpy.Context()
        rclpy.init(context=context, signal_handler_options=SignalHandlerOptions.NO)
        node = Node('joiner', context=context, enable_rosout=False)
        states = node.create_subscription(JointState, topic, _never_called, 10)
        until, taken = time.monotonic() + 0.6 * period, None
        while time.monotonic() < until or taken is None:
            taken = states.handle.take_message(JointState, True) or taken
            time.sleep(0.02)
        if taken is not None:
            print('heard it', flush=True)
        node.destroy_node()
        context.try_shutdown()


if __name__ == '__main__':
    main()
