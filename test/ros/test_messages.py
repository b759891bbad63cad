"""The tables of topics, and subscriptions that wake up no executor."""
import subprocess
import sys
from threading import Thread
import time

from live import PATIENCE
import pytest
import rclpy
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.signals import SignalHandlerOptions
from std_msgs.msg import Float64MultiArray

from planar_chain_sim.recording.message_types import MESSAGE_TYPES
from planar_chain_sim.ros.messages import create_polled_subscription, INPUTS, OUTPUTS

COUNT = 300
SENDER = """
import rclpy, time
from std_msgs.msg import Float64MultiArray
rclpy.init()
publisher = rclpy.create_node('sender').create_publisher(Float64MultiArray, '/polled/commands', 64)
while True:
    publisher.publish(Float64MultiArray(data=[1.0]))
    time.sleep(0.001)
"""


class CountingExecutor(SingleThreadedExecutor):
    """Counts how often it wakes up: it asks for its nodes whenever it is about to wait again."""

    waits = 0

    def get_nodes(self):
        self.waits += 1
        return super().get_nodes()


@pytest.fixture
def context():
    context = rclpy.Context()
    rclpy.init(context=context, signal_handler_options=SignalHandlerOptions.NO)
    yield context
    context.try_shutdown()


def test_every_topic_can_be_recorded():
    for topic in (*OUTPUTS.values(), *INPUTS.values()):
        assert topic.type_name in MESSAGE_TYPES
    assert all(MESSAGE_TYPES[topic.type_name].decode for topic in INPUTS.values()), 'Log.commands has them'


def test_the_executor_sleeps_while_commands_come(context):
    node = Node('polled', context=context)
    subscription = create_polled_subscription(node, INPUTS['commands'])
    executor = CountingExecutor(context=context)
    executor.add_node(node)
    stopping = False

    def spin():
        while not stopping:
            executor.spin_once()

    thread = Thread(target=spin)
    thread.start()
    # From another process: within one, messages take a short cut that wakes nobody.
    sender = subprocess.Popen([sys.executable, '-c', SENDER])
    try:
        taken, before, end = 0, 0, time.monotonic() + PATIENCE
        while taken < COUNT:
            with subscription.handle:
                while subscription.handle.take_message(Float64MultiArray, True) is not None:
                    taken += 1
                    before = before or executor.waits
            assert sender.poll() is None and time.monotonic() < end
            time.sleep(0.001)
        woken = executor.waits - before
    finally:
        sender.kill()
        sender.wait()
        stopping = True
        executor.create_task(lambda: None)
        thread.join()
        executor.shutdown()
        node.destroy_node()
    assert woken <= 20, f'woken {woken} times by {taken} messages'
