"""TF: the frames of all links, /tf for those that move and /tf_static for the others."""
from __future__ import annotations

import numpy as np

from ..errors import Mistake
from ..recording.cdr import TransformsLayout

PERIOD = 1.0 / 50.0  # s


def check_installed() -> None:
    """Raise Mistake if TF cannot be published."""
    try:
        import tf2_msgs.msg  # noqa: F401
    except ImportError:
        raise Mistake("parameter 'publish_tf' is true, which needs tf2_msgs (apt install ros-jazzy-tf2-msgs), "
                      'must be false where that is not installed') from None


class TransformPublisher:
    """Publishes the frames of `frames` (LinkFrames) at the state that `simulator` published last, the log's bytes."""

    def __init__(self, simulator, frames, joint_names, publishers):
        self._simulator, self._frames = simulator, frames.moving(joint_names)
        self._layout, self._publisher, self._last = TransformsLayout(self._frames.pairs), publishers['tf'], None
        fixed, (stamp, _) = frames.fixed(), simulator.published_state
        publishers['tf_static'].publish(TransformsLayout(fixed.pairs).stamped(stamp, fixed.poses(np.zeros(0))))

    def publish(self) -> None:
        """Publish the frames of the joints that move, once for each state."""
        stamp, position = self._simulator.published_state
        if stamp != self._last:
            self._last = stamp
            self._simulator.hold_ups.during(self._publisher.publish,
                                            self._layout.stamped(stamp, self._frames.poses(position)))
