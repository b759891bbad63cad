"""
A controller for lockstep, as a process of its own: answers each state once, after a random delay.

    python lockstep_controller.py NAMESPACE COUNT LONGEST_DELAY SEED [JOINT...]

With joints it commands those by name and echoes the state's stamp, without it commands all in joint order. It ends
after it has answered COUNT states.
"""
import os
import random
import sys
import time

import rclpy
from rclpy.node import Node
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray


def effort(position, velocity):
    """Return the effort of one joint: each on its own, so that who commands which does not matter."""
    return -3.0 * position - 0.5 * velocity


def main():
    namespace, count, longest, joints = sys.argv[1], int(sys.argv[2]), float(sys.argv[3]), sys.argv[5:]
    generator = random.Random(int(sys.argv[4]))
    rclpy.init()
    node = Node(f'controller_{sys.argv[4]}')
    kind, topic = (JointState, 'joint_commands') if joints else (Float64MultiArray, 'commands')
    publisher = node.create_publisher(kind, f'{namespace}/simulator/{topic}', 10)
    answered, done = [], False

    def answer(state):
        nonlocal done
        stamp = state.header.stamp.sec, state.header.stamp.nanosec
        done = len(answered) == count and stamp not in answered  # the last answer has arrived
        repeated = stamp in answered[-1:]
        if done or not publisher.get_subscription_count() or repeated and not joints:
            return  # an answer without a stamp that comes twice would be taken for the next state's
        time.sleep(generator.random() * longest)
        values = {name: effort(q, v) for name, q, v in zip(state.name, state.position, state.velocity)}
        if joints:
            publisher.publish(JointState(header=state.header, name=joints, effort=[values[name] for name in joints]))
        else:
            publisher.publish(Float64MultiArray(data=list(values.values())))
        if not repeated:
            answered.append(stamp)

    node.create_subscription(JointState, f'{namespace}/joint_states', answer, 10)
    while not done:
        rclpy.spin_once(node, timeout_sec=1.0)
    print(f'answered {count}', flush=True)
    os._exit(0)   # not with others at once by the DDS library, which can hang then


if __name__ == '__main__':
    main()
