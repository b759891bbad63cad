"""Effort commands: what a message asks of which joint, what is refused, and the efforts held until the next one."""
from __future__ import annotations

from math import isfinite
from typing import NamedTuple, Optional, Sequence

import numpy as np

from ..recording.cdr import CdrError, decode_float64_multi_array, decode_joint_state

LONGEST_MESSAGE = 2 ** 20  # bytes; what is longer is refused unread, and no log takes it


class CommandError(ValueError):
    """A command message that is refused as a whole: one sentence, and the reason in two words."""

    def __init__(self, reason: str, sentence: str):
        super().__init__(sentence)
        self.reason = reason


class Command(NamedTuple):
    """
    What a message asks for: `efforts` (N m or N) of `joints` (indices), in its order.

    `stamp`: ns, of the state that it answers, None where its type has none. `unknown`: names that no joint has.
    """

    joints: Sequence[int]
    efforts: Sequence[float]
    stamp: Optional[int] = None
    unknown: tuple = ()


class CommandReader:
    """Reads the commands for joints of these names."""

    def __init__(self, joint_names: Sequence[str]):
        self._index = {name: k for k, name in enumerate(joint_names)}
        self._all = range(len(joint_names))

    def read(self, type_name: str, data: bytes) -> Command:
        """
        Return what a message (CDR) of one of these types commands: no joint where it carries no effort.

        `type_name`: std_msgs/msg/Float64MultiArray in joint order, or sensor_msgs/msg/JointState by name.
        CommandError on malformed bytes, a wrong length or a value that is not finite.
        """
        if len(data) > LONGEST_MESSAGE:
            raise CommandError('too long', f'it has {len(data)} bytes, must have at most {LONGEST_MESSAGE}')
        try:
            if type_name == 'std_msgs/msg/Float64MultiArray':
                return self._in_order(decode_float64_multi_array(data))
            return self._by_name(decode_joint_state(data))
        except CdrError as error:
            raise CommandError('malformed', str(error)) from None

    def _in_order(self, values) -> Command:
        if len(values) != len(self._all):
            raise CommandError('wrong length',
                               f'it has {len(values)} efforts, must have {len(self._all)}, one for every joint')
        return Command(self._all, _finite(values))

    def _by_name(self, message) -> Command:
        names, values = message.names, message.effort
        if not len(values):
            return Command((), (), message.stamp)  # positions and velocities alone are not for an effort interface
        if len(values) != len(names):
            raise CommandError('wrong length',
                               f'it has {len(values)} efforts for {len(names)} names, must have as many')
        values, index = _finite(values.tolist()), self._index
        joints = [index[name] for name in names if name in index]
        if len(joints) == len(names):
            return Command(joints, values, message.stamp)
        return Command(joints, [value for name, value in zip(names, values) if name in index], message.stamp,
                       tuple(name for name in names if name not in index))


def _finite(values: Sequence[float]) -> Sequence[float]:
    """Return the values; CommandError where one is not finite. For a few values NumPy takes longer."""
    if not isfinite(sum(values)):  # finite values may also have a sum that is not
        for place, value in enumerate(values):
            if not isfinite(value):
                raise CommandError('not finite', f'its effort {place} is {value}, must be finite')
    return values


class HeldEffort:
    """
    The newest commanded effort of every joint, N m or N, zero before the first command.

    effort: float64 (joints,) in joint order. commanded: whether it is somebody's command.
    """

    def __init__(self, joints: int):
        self.effort = np.zeros(joints)
        self._since = [None] * joints  # tick of the joint's last command
        self.commanded = False

    def hold(self, command: Command, tick: int) -> None:
        """Hold a command from `tick` on; a joint it does not name keeps its effort."""
        for joint, value in zip(command.joints, command.efforts):
            self.effort[joint] = value
            self._since[joint] = tick
        self.commanded = True

    def renew(self, tick: int) -> None:
        """Hold what has been put into `effort`, a command of every joint, from `tick` on."""
        self._since = [tick] * len(self._since)
        self.commanded = True

    def clear(self) -> None:
        """Hold zero effort at every joint."""
        self.effort[:] = 0.0
        self._since = [None] * len(self._since)
        self.commanded = False

    def expire(self, tick: int, ticks: float) -> list[int]:
        """Let joints have zero effort whose last command is `ticks` ticks old at `tick`; return which."""
        silent = [joint for joint, since in enumerate(self._since) if since is not None and tick - since >= ticks]
        for joint in silent:
            self.effort[joint] = 0.0
            self._since[joint] = None
        return silent
