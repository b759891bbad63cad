"""
Push a body of a running simulator for some seconds with a force along its own axes, then let it go.

    python examples/push.py forearm 5 0 --seconds 1
"""
from argparse import ArgumentParser
from time import sleep

from geometry_msgs.msg import WrenchStamped
import rclpy


def main():
    parser = ArgumentParser(description=__doc__.strip().splitlines()[0])
    parser.add_argument('body')
    parser.add_argument('force', nargs=2, type=float, help='N, along the x and y axes of the body')
    parser.add_argument('--seconds', type=float, default=1.0)
    options = parser.parse_args()

    rclpy.init()
    node = rclpy.create_node('push')
    publisher = node.create_publisher(WrenchStamped, 'simulator/wrench', 10)
    while not publisher.get_subscription_count():       # until the simulator is found
        sleep(0.05)
    wrench = WrenchStamped()
    wrench.header.frame_id = options.body
    wrench.wrench.force.x, wrench.wrench.force.y = options.force
    publisher.publish(wrench)
    print(f'pushing {options.body} with {options.force} N')
    sleep(options.seconds)
    wrench.wrench.force.x = wrench.wrench.force.y = 0.0       # a wrench acts until the next one
    publisher.publish(wrench)
    publisher.wait_for_all_acked(rclpy.duration.Duration(seconds=2))
    print('let go')
    node.destroy_node()
    rclpy.shutdown()


if __name__ == '__main__':
    main()
