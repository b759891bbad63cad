"""
A client that publishes efforts for /simulator/commands as fast as possible, as a process of its own.

    python flooding_client.py COUNT

The first effort counts up to COUNT - 1. It says when it has published all, and stays until it is killed.
"""
import sys
import time

import rclpy
from std_msgs.msg import Float64MultiArray


def main():
    rclpy.init()
    publisher = rclpy.create_node('flooding_client').create_publisher(Float64MultiArray, '/simulator/commands', 10)
    while not publisher.get_subscription_count():
        time.sleep(0.001)
    message = Float64MultiArray(data=[0.0] * 5)
    for k in range(int(sys.argv[1])):
        message.data[0] = float(k)
        publisher.publish(message)
    print('flooded', flush=True)
    while True:
        time.sleep(60.0)


if __name__ == '__main__':
    main()
