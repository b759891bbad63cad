"""Records topics as `ros2 bag record` does: the bytes as they come, with the times at which the middleware has them."""
from pathlib import Path
from threading import Event, Thread
import time

from oracles.bags import write_bag
import rclpy
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile
from rclpy.signals import SignalHandlerOptions

from planar_chain_sim.ros.messages import PolledGroup


class BagRecorder:
    """A context that records; `topics`: topic -> message class. messages: (topic, received in ns, bytes)."""

    def __init__(self, topics, latched=('/robot_description',)):
        self.context = rclpy.Context()
        rclpy.init(context=self.context, signal_handler_options=SignalHandlerOptions.NO)
        self.node = Node('recorder', context=self.context, enable_rosout=False)
        self.topics, self.messages, self._done = topics, [], Event()
        lasting = {True: DurabilityPolicy.TRANSIENT_LOCAL, False: DurabilityPolicy.VOLATILE}
        self.subscriptions = [
            self.node.create_subscription(kind, topic, lambda message: None, QoSProfile(
                depth=1000, durability=lasting[topic in latched]), callback_group=PolledGroup(), raw=True)
            for topic, kind in topics.items()]
        self._thread = Thread(target=self._record)

    def __enter__(self):
        self._thread.start()
        return self

    def __exit__(self, *exception):
        self._done.set()
        self._thread.join()
        self.node.destroy_node()
        self.context.try_shutdown()

    def heard(self, *publishers):
        """Whether all topics have a publisher, and these publishers a node beside the recorder that listens."""
        return all(subscription.get_publisher_count() for subscription in self.subscriptions) and all(
            publisher.get_subscription_count() >= 2 for publisher in publishers)

    def wait_for(self, text, patience=60.0):
        """Wait for a message that holds a text."""
        end = time.monotonic() + patience
        while not any(text.encode() in data for _, _, data in tuple(self.messages)):
            assert time.monotonic() < end, f'no message with {text!r} has come'
            time.sleep(0.01)

    def _record(self):
        while not self._done.is_set():
            for topic, subscription in zip(self.topics, self.subscriptions):
                with subscription.handle:
                    while (taken := subscription.handle.take_message(subscription.msg_type, True)) is not None:
                        self.messages.append((topic, taken[1]['received_timestamp'], taken[0]))
            time.sleep(0.002)

    def write(self, path: Path, **options):
        """Write a bag."""
        types = {topic: kind.__module__.split('.')[0] + '/msg/' + kind.__name__ for topic, kind in self.topics.items()}
        return write_bag(path, types, self.messages, **options)
