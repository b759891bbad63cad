"""Effort commands: reading and checking of messages, and the efforts that act until the next command."""
from __future__ import annotations

from math import isfinite, isinf, isnan
from typing import NamedTuple, Optional, Sequence

import numpy as np

from ..recording.cdr import CdrError, decode_float64_multi_array, decode_joint_state

LONGEST_MESSAGE = 2 ** 20  # bytes; what is longer is refused unread, and no log takes it


class CommandError(ValueError):
    """A message that is refused as a whole: one sentence, and the reason in a few words."""

    def __init__(self, reason: str, sentence: str):
        super().__init__(sentence)
        self.reason = reason


def too_long(data: bytes) -> CommandError:
    """Return the error for a message of more than LONGEST_MESSAGE bytes."""
    return CommandError('too long', f'it has {len(data)} bytes, must have at most {LONGEST_MESSAGE}')


class Command(NamedTuple):
    """
    What a message asks for: `efforts` (N m or N) of `joints` (indices), in its order.

    `stamp`: ns, of the state that it answers, None where its type has none. `ignored`: what in it has no effect, as
    (reason, sentence).
    """

    joints: Sequence[int]
    efforts: Sequence[float]
    stamp: Optional[int] = None
    ignored: tuple = ()


class Change(NamedTuple):
    """
    What a message on another input asks for: the event `kind`, a row of EVENTS, with `data`.

    `what`: what it changes, such as the name of a body; of several changes of the same, only the newest acts.
    `ignored`: what in the message has no effect, as (reason, sentence).
    """

    kind: str
    what: str
    data: dict
    ignored: tuple = ()


class CommandReader:
    """
    Reads the commands for joints of these names.

    `commanded`: names of the joints, in order, that a JointState with fewer efforts than names has its efforts for.
    """

    def __init__(self, joint_names: Sequence[str], commanded: Sequence[str] = ()):
        self._names, self._commanded = tuple(joint_names), tuple(commanded)
        self._index = {name: k for k, name in enumerate(joint_names)}
        self._all = range(len(joint_names))

    def read(self, type_name: str, data: bytes) -> Command:
        """
        Return what a message (CDR) of one of these types commands: no joint where it carries no effort.

        `type_name`: std_msgs/msg/Float64MultiArray in joint order, or sensor_msgs/msg/JointState by name, where NaN is
        no command for that joint. CommandError on malformed bytes, a wrong length, a joint named twice or a value that
        is not finite.
        """
        if len(data) > LONGEST_MESSAGE:
            raise too_long(data)
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
        names, values, index = message.names, message.effort.tolist(), self._index
        joints = [index[name] for name in names if name in index]
        if len(set(joints)) == len(joints) == len(names) == len(values) > 0 and isfinite(sum(values)):
            return Command(joints, values, message.stamp)  # as nearly all are, and one may come at every tick
        if len(set(joints)) < len(joints):
            twice = next(name for name in names if name in index and names.count(name) > 1)
            raise CommandError('named twice', f'it names joint {twice!r} more than once, must name each once')
        _refuse(isinf, values)
        commanded = [(index[name], value) for name, value in zip(self._names_of_efforts(names, len(values)), values)
                     if name in index and not isnan(value)]
        joints, efforts = zip(*commanded) if commanded else ((), ())
        return Command(joints, efforts, message.stamp, tuple(self._without_effect(message, set(joints))))

    def _names_of_efforts(self, names: tuple, count: int) -> Sequence[str]:
        """
        Return the names that a message's efforts are for, in order; CommandError if they cannot be known.

        The topic-based hardware of ros2_control names all of its joints and sends efforts only for those with an effort
        interface.
        """
        if count in (0, len(names)):
            return names[:count]
        commanded = self._commanded
        if count > len(names):
            raise CommandError('wrong length', f'it has {count} efforts for {len(names)} names, must have as many')
        if not commanded:
            raise CommandError('wrong length',
                               f'it has {count} efforts for {len(names)} names, must have as many, or the parameter '
                               'commanded_joints must name the joints that the efforts are for, in order')
        if count != len(commanded) or tuple(name for name in names if name in commanded) != commanded:
            raise CommandError('wrong length',
                               f'it has {count} efforts for the names {", ".join(names[:32])}, which does not fit '
                               f'the parameter commanded_joints: {", ".join(commanded[:32])}')
        return commanded

    def _without_effect(self, message, commanded: set):
        """Yield (reason, sentence) of what in a JointState has no effect; NaN is not reported."""
        names = message.names
        if not names:
            yield 'empty', 'names no joint'
        unknown = [name for name in names if name not in self._index]
        if unknown:
            yield 'unknown joint', f'names {_listed(unknown)}, not among the joints {", ".join(self._names[:32])}'
        given = [(kind, values) for kind, values in (('position', message.position), ('velocity', message.velocity))
                 if len(values)]
        for kind, values in given:
            if len(values) == len(names):
                wanting = [name for name, value in zip(names, values.tolist()) if not isnan(value)
                           and name in self._index and self._index[name] not in commanded]
            else:
                wanting = [] if np.isnan(values).all() else names
            if wanting:
                yield 'no effort', f'has a {kind} without an effort for {_listed(wanting)}, but only efforts act'
                return
        if names and not given and not len(message.effort):
            yield 'no effort', f'has no effort for {_listed(names)}'


def _listed(names: Sequence[str]) -> str:
    """Return the first of the names, quoted."""
    return ', '.join(map(repr, names[:3])) + (' and others' if len(names) > 3 else '')


def _finite(values: Sequence[float]) -> Sequence[float]:
    """Return the values; CommandError where one is not finite. For a few values NumPy takes longer."""
    if not isfinite(sum(values)):  # finite values may also have a sum that is not
        _refuse(lambda value: not isfinite(value), values)
    return values


def _refuse(is_bad, values: Sequence[float]) -> None:
    """Raise CommandError where `is_bad` holds for a value."""
    for place, value in enumerate(values):
        if is_bad(value):
            raise CommandError('not finite', f'its effort {place} is {value}, must be finite')


class HeldEffort:
    """
    The newest commanded effort of every joint, N m or N, zero before the first command.

    effort: float64 (joints,) in joint order. commanded: whether any command has come since the last clear().
    """

    def __init__(self, joints: int):
        self.effort = np.zeros(joints)
        self._since: list = [None] * joints  # tick of the joint's last command
        self.commanded = False

    def hold(self, command: Command, tick: int) -> None:
        """Let a command act from `tick` on; a joint that it does not name keeps its effort."""
        for joint, value in zip(command.joints, command.efforts):
            self.effort[joint] = value
            self._since[joint] = tick
        self.commanded = True

    def renew(self, tick: int) -> None:
        """Note that all of `effort`, already set, is a command that acts from `tick` on."""
        self._since = [tick] * len(self._since)
        self.commanded = True

    def clear(self) -> None:
        """Set the effort of every joint to zero."""
        self.effort[:] = 0.0
        self._since = [None] * len(self._since)
        self.commanded = False

    def expire(self, tick: int, ticks: float) -> list[int]:
        """Set to zero the efforts whose command is at least `ticks` ticks old at `tick`; return their joints."""
        silent = [joint for joint, since in enumerate(self._since) if since is not None and tick - since >= ticks]
        for joint in silent:
            self.effort[joint] = 0.0
            self._since[joint] = None
        return silent
