"""Effort commands: what a message asks of which joint, what is refused, and the efforts held until the next one."""
from __future__ import annotations

from typing import Sequence

import numpy as np

from ..recording.cdr import CdrError, decode_float64_multi_array, decode_joint_state


class CommandError(ValueError):
    """A command message that is refused as a whole: one sentence."""


class HeldEffort:
    """
    The newest commanded effort of every joint, N m or N, zero before the first command.

    effort: float64 (joints,) in joint order. unknown: names in the last by-name command that no joint has.
    """

    def __init__(self, joint_names: Sequence[str]):
        self.effort = np.zeros(len(joint_names))
        self.unknown = ()
        self._index = {name: k for k, name in enumerate(joint_names)}

    def take(self, type_name: str, data: bytes) -> bool:
        """
        Take a command as it came (CDR), return whether it commands any joint; one it does not name keeps its effort.

        `type_name`: std_msgs/msg/Float64MultiArray in joint order, or sensor_msgs/msg/JointState by name.
        CommandError, and nothing is changed, on malformed bytes, a wrong length or a value that is not finite.
        """
        self.unknown = ()
        try:
            if type_name == 'std_msgs/msg/Float64MultiArray':
                return self._take_in_order(decode_float64_multi_array(data))
            message = decode_joint_state(data)
            return self._take_by_name(message.names, message.effort)
        except CdrError as error:
            raise CommandError(str(error)) from None

    def clear(self) -> None:
        """Hold zero effort at every joint."""
        self.effort[:] = 0.0

    def _take_in_order(self, values) -> bool:
        if len(values) != len(self.effort):
            raise CommandError(f'it has {len(values)} efforts, must have {len(self.effort)}, one for every joint')
        _check_finite(values)
        self.effort[:] = values
        return True

    def _take_by_name(self, names, values) -> bool:
        if not len(values):
            return False  # positions and velocities alone are not for an effort interface
        if len(values) != len(names):
            raise CommandError(f'it has {len(values)} efforts for {len(names)} names, must have as many')
        _check_finite(values)
        known = [(self._index[name], value) for name, value in zip(names, values) if name in self._index]
        for joint, value in known:
            self.effort[joint] = value
        if len(known) < len(names):
            self.unknown = tuple(name for name in names if name not in self._index)
        return bool(known)


def _check_finite(values) -> None:
    finite = np.isfinite(values)
    if not finite.all():
        raise CommandError(f'its effort {int(finite.argmin())} is {values[finite.argmin()]}, must be finite')
