"""The topic robot_description: publishes the chain's URDF, or receives the URDF that becomes the chain."""
from __future__ import annotations

from queue import Empty
from typing import Optional

from .messages import create_polled_subscription, SIDE_OUTPUTS
from ..recording.cdr import decode_string

TOPIC = SIDE_OUTPUTS['description']
LOOK_PERIOD = 0.02  # s


def await_description(node, stop) -> Optional[str]:
    """Return the text that comes on robot_description; None if something is put into `stop` before."""
    subscription = create_polled_subscription(node, TOPIC)
    node.get_logger().info(f'waiting for the URDF of a planar robot on {subscription.topic_name}')
    try:
        while True:
            with (handle := subscription.handle):
                taken = handle.take_message(subscription.msg_type, True)
            if taken is not None:
                return decode_string(taken[0])
            try:
                stop.put(stop.get(timeout=LOOK_PERIOD))  # for those who wait for it later
                return None
            except Empty:
                continue
    finally:
        node.destroy_subscription(subscription)


def warn_of_another(node, text: str) -> None:
    """Warn, once, if another text comes on robot_description than the one that the chain was read from."""
    def judge(message) -> None:
        if message.data != text:
            node.get_logger().warning(f'another text has come on {subscription.topic_name} and has no effect: the '
                                      'chain is read at the start, so start the node again for it', once=True)
    subscription = node.create_subscription(TOPIC.message, TOPIC.name, judge, TOPIC.qos)
