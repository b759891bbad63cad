"""TF: the frames of all links, /tf for those that move and /tf_static for the others."""
from __future__ import annotations

from geometry_msgs.msg import TransformStamped

from ..errors import Mistake
from ..robot_files.link_frames import quaternion

PERIOD = 1.0 / 50.0  # s


def check_installed() -> None:
    """Raise Mistake if TF cannot be published."""
    try:
        import tf2_msgs.msg  # noqa: F401
    except ImportError:
        raise Mistake("parameter 'publish_tf' is true, which needs tf2_msgs (apt install ros-jazzy-tf2-msgs), "
                      'must be false where that is not installed') from None


def stamped(transforms, stamp: int) -> list:
    """Return Transforms as messages of a time, ns."""
    messages = []
    for transform in transforms:
        message = TransformStamped(child_frame_id=transform.child)
        message.header.frame_id = transform.parent
        message.header.stamp.sec, message.header.stamp.nanosec = divmod(stamp, 10**9)
        place, turn = message.transform.translation, message.transform.rotation
        place.x, place.y, place.z = map(float, transform.shift)
        turn.x, turn.y, turn.z, turn.w = map(float, quaternion(transform.turn))
        messages.append(message)
    return messages


class TransformPublisher:
    """Publishes the frames of `frames` (LinkFrames) at the state that `simulator` published last."""

    def __init__(self, simulator, frames, joint_names, publishers):
        from tf2_msgs.msg import TFMessage
        self._simulator, self._frames, self._names = simulator, frames, joint_names
        self._message, self._publisher, self._last = TFMessage, publishers['tf'], None
        stamp, _ = simulator.published_state
        publishers['tf_static'].publish(TFMessage(transforms=stamped(frames.fixed(), stamp)))

    def publish(self) -> None:
        """Publish the frames of the joints that move, once for each state."""
        stamp, position = self._simulator.published_state
        if stamp != self._last:
            self._last = stamp
            moving = self._frames.moving(dict(zip(self._names, position)))
            self._simulator.hold_ups.during(self._publisher.publish,
                                            self._message(transforms=stamped(moving, stamp)))
