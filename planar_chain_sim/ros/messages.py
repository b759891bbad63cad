"""The node's topics, one row each; publishers, subscriptions and the log's channels are all made from these tables."""
from __future__ import annotations

from typing import NamedTuple

from rclpy.callback_groups import CallbackGroup
from rclpy.qos import QoSProfile
from rclpy.qos_overriding_options import QoSOverridingOptions
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray, String


class Topic(NamedTuple):
    """A topic: relative name, message class and queue depth; every one is reliable, volatile, keep_last(depth)."""

    name: str
    message: type
    depth: int

    @property
    def type_name(self) -> str:
        """Return the type as ROS writes it: package/msg/Type."""
        return f'{self.message.__module__.partition(".")[0]}/msg/{self.message.__name__}'


OUTPUTS = {
    'state': Topic('joint_states', JointState, 10),
    'events': Topic('~/events', String, 10),
}
# 64 deep: with a depth of 1, one of two controllers that command within one tick would lose its message.
INPUTS = {
    'commands': Topic('~/commands', Float64MultiArray, 64),
    'joint_commands': Topic('~/joint_commands', JointState, 64),
}


class PolledGroup(CallbackGroup):
    """
    Keeps its subscriptions out of every executor: the owner takes their messages itself, when it has a use for them.

    An executor would wake up for each message and cost more than the tick that uses it. Nor may it have their QoS
    events: while it waits for one of those, every message of the subscription wakes it too.
    """

    def can_execute(self, entity) -> bool:
        """Return False, by which an executor leaves the entity out of its wait set."""
        return False

    def beginning_execution(self, entity) -> bool:
        """Return False: no executor may run it."""
        return False

    def ending_execution(self, entity) -> None:
        """Do nothing, as nothing has begun."""


def create_publisher(node, topic: Topic):
    """Create the publisher of a row; its QoS can be overridden by parameters, as usual in ROS."""
    return node.create_publisher(topic.message, topic.name, QoSProfile(depth=topic.depth),
                                 qos_overriding_options=QoSOverridingOptions.with_default_policies())


def create_polled_subscription(node, topic: Topic):
    """Create the subscription of a row for take_message(); no executor serves it."""
    return node.create_subscription(topic.message, topic.name, lambda message: None, QoSProfile(depth=topic.depth),
                                    callback_group=PolledGroup(), raw=True,
                                    qos_overriding_options=QoSOverridingOptions.with_default_policies())
