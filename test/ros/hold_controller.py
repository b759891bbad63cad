"""
A controller as a user writes one: a process of its own that holds a chain at a pose by publishing efforts.

    python hold_controller.py CHAIN_FILE SECONDS POSITION...

On each joint_states it publishes on /simulator/commands the efforts which, by inverse dynamics, give the accelerations
of a critically damped return to the pose. It ends after SECONDS of stamped time and tells how many it published and the
worst error of the second half.
"""
import sys

import numpy as np
import rclpy
from rclpy.node import Node
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray

from planar_chain_sim import inverse_dynamics, load_chain

BANDWIDTH = 6.0  # rad/s, slow enough for a controller that comes some 50 ms late


def main():
    chain, seconds, pose = load_chain(sys.argv[1]), float(sys.argv[2]), np.array(sys.argv[3:], dtype=float)
    rclpy.init()
    node = Node('hold_controller')
    publisher = node.create_publisher(Float64MultiArray, '/simulator/commands', 10)
    begun, published, worst, done = None, 0, 0.0, False

    def control(state):
        nonlocal begun, published, worst, done
        if not publisher.get_subscription_count():
            return   # nobody would hear it
        now = state.header.stamp.sec + state.header.stamp.nanosec * 1e-9
        begun = begun or now
        position, velocity = np.array(state.position), np.array(state.velocity)
        wanted = BANDWIDTH**2 * (pose - position) - 2.0 * BANDWIDTH * velocity
        publisher.publish(Float64MultiArray(data=inverse_dynamics(chain, position, velocity, wanted).tolist()))
        published += 1
        if now - begun > seconds / 2.0:
            worst = max(worst, float(np.abs(pose - position).max()))
        done = now - begun >= seconds

    node.create_subscription(JointState, '/joint_states', control, 1)
    while not done:
        rclpy.spin_once(node)
    print(f'published {published} commands, worst error {worst}', flush=True)
    rclpy.shutdown()


if __name__ == '__main__':
    main()
