"""RecordedFrames: the URDF and the frames of its links in a log, so that Foxglove draws the arm from the file alone."""
from __future__ import annotations

from math import ceil
from typing import Any, Callable, NamedTuple, Sequence

import numpy as np

from .cdr import encode_string, TransformsLayout
from .rosbag2_profile import Channel

RATE = 60.0   # Hz of simulated time: messages on /tf, at most


class FrameChannels(NamedTuple):
    """The channels of a log for the URDF, for frames that never change, and for those that move."""

    description: Channel = Channel('/robot_description', 'std_msgs/msg/String', 1, durability='transient_local')
    tf_static: Channel = Channel('/tf_static', 'tf2_msgs/msg/TFMessage', 1, durability='transient_local')
    tf: Channel = Channel('/tf', 'tf2_msgs/msg/TFMessage', 100)


class RecordedFrames:
    """
    Writes the URDF and the frames into a log of a run with ticks of `step` s.

    `urdf`: its text; `frames`: LinkFrames of it. ticks: number of ticks from one message on /tf to the next.
    """

    def __init__(self, urdf: str, frames: Any, joint_names: Sequence[str], step: float,
                 channels: FrameChannels = FrameChannels()):
        self._urdf, self._fixed, self._moving = urdf, frames.fixed(), frames.moving(joint_names)
        self._layout, self._tf_topic = TransformsLayout(self._moving.pairs), channels.tf.topic
        self.channels, self.ticks = channels, max(1, ceil(1.0 / (RATE * step) - 1e-9))

    def write_start(self, write: Callable, time: int) -> None:
        """Write the URDF and the fixed frames by the log's `write`; `time`: log time, ns."""
        # Of time 0, as they hold at all times, whichever clock stamps the states.
        static = TransformsLayout(self._fixed.pairs).stamped(0, self._fixed.poses(np.zeros(0)))
        write(self.channels.description.topic, encode_string(self._urdf), time, time)
        write(self.channels.tf_static.topic, static, time, time)

    def write_state(self, write: Callable, position: np.ndarray, time: int, stamp: int) -> None:
        """Write the frames that move at joint positions (joints,); `time`: log time, ns; `stamp`: of the state, ns."""
        write(self._tf_topic, self._layout.stamped(stamp, self._moving.poses(position)), time, stamp)
