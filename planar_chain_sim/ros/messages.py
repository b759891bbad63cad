"""The node's topics, one row each; publishers, subscriptions and the log's channels are made from these tables."""
from __future__ import annotations

from importlib import import_module
from typing import Any, Callable, NamedTuple, Optional

from rclpy.callback_groups import CallbackGroup
from rclpy.qos import DurabilityPolicy, QoSProfile
from rclpy.qos_overriding_options import QoSOverridingOptions

from .wrenches import WrenchReader


class Topic(NamedTuple):
    """
    A topic: name, type as ROS writes it, queue depth; every one is reliable and keep_last(depth).

    `latched`: transient_local, for late subscribers. `option`: the parameter that must be true for the topic to exist.
    `reader`: of an input that is no command: chain -> an object whose read() makes a Change of what `decode` of its
    MESSAGE_TYPES row returns, or raises CommandError.
    """

    name: str
    type_name: str
    depth: int
    latched: bool = False
    option: str = ''
    reader: Optional[Callable[[Any], Any]] = None

    @property
    def message(self) -> type:
        """Return the message class, imported when first asked for."""
        package, _, name = self.type_name.split('/')
        return getattr(import_module(f'{package}.msg'), name)

    @property
    def qos(self) -> QoSProfile:
        """Return the quality of service that the topic offers or asks for."""
        durability = DurabilityPolicy.TRANSIENT_LOCAL if self.latched else DurabilityPolicy.VOLATILE
        return QoSProfile(depth=self.depth, durability=durability)


# What the tick thread publishes and records ...
OUTPUTS = {
    'state': Topic('joint_states', 'sensor_msgs/msg/JointState', 10),
    'events': Topic('~/events', 'std_msgs/msg/String', 10),
    'clock': Topic('/clock', 'rosgraph_msgs/msg/Clock', 1, option='publish_clock'),
}
# ... and what the service thread publishes, which no log holds.
SIDE_OUTPUTS = {
    'diagnostics': Topic('/diagnostics', 'diagnostic_msgs/msg/DiagnosticArray', 10),
    'description': Topic('robot_description', 'std_msgs/msg/String', 1, latched=True,
                         option='publish_robot_description'),
    'markers': Topic('~/markers', 'visualization_msgs/msg/MarkerArray', 1, option='publish_markers'),
    'tf': Topic('/tf', 'tf2_msgs/msg/TFMessage', 100, option='publish_tf'),
    'tf_static': Topic('/tf_static', 'tf2_msgs/msg/TFMessage', 1, latched=True, option='publish_tf'),
}
# 64 deep: with a depth of 1, one of two controllers that command within one tick would lose its message.
COMMANDS = {
    'commands': Topic('~/commands', 'std_msgs/msg/Float64MultiArray', 64),
    'joint_commands': Topic('~/joint_commands', 'sensor_msgs/msg/JointState', 64),
}
# All inputs: each kind of Change needs its row in EVENTS, each type its row with `decode` in MESSAGE_TYPES.
INPUTS = {
    **COMMANDS,
    'wrench': Topic('~/wrench', 'geometry_msgs/msg/WrenchStamped', 64, reader=WrenchReader),
}


class PolledGroup(CallbackGroup):
    """
    Keeps its subscriptions out of every executor: the owner takes their messages itself, when it needs them.

    An executor would wake up for each message, which costs more than the tick that uses it. It must not wait for their
    QoS events either: then every message of the subscription would wake it, too.
    """

    def can_execute(self, entity) -> bool:
        """Return False, so that an executor leaves the entity out of its wait set."""
        return False

    def beginning_execution(self, entity) -> bool:
        """Return False: no executor may run it."""
        return False

    def ending_execution(self, entity) -> None:
        """Do nothing, as nothing has begun."""


def create_publisher(node, topic: Topic):
    """Create the publisher of a row; its QoS can be overridden by parameters, as usual in ROS."""
    return node.create_publisher(topic.message, topic.name, topic.qos,
                                 qos_overriding_options=QoSOverridingOptions.with_default_policies())


def create_polled_subscription(node, topic: Topic):
    """Create the subscription of a row for take_message(); no executor serves it."""
    return node.create_subscription(topic.message, topic.name, lambda message: None, topic.qos,
                                    callback_group=PolledGroup(), raw=True,
                                    qos_overriding_options=QoSOverridingOptions.with_default_policies())
