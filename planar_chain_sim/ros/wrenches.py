"""Wrenches on bodies: what a message on `~/wrench` changes."""
from __future__ import annotations

from math import isfinite

from .commands import Change, CommandError

ACROSS = (('out of plane', 'has a force along z or a torque about x or y, which has no effect'),)


class WrenchReader:
    """Reads the wrenches on the bodies of a chain."""

    def __init__(self, chain):
        self._names = [body.name for body in chain.bodies]

    def read(self, message: dict) -> Change:
        """
        Return the event 'wrench' for a decoded geometry_msgs/msg/WrenchStamped.

        Its frame is that of a body: x and y in the plane, the force at the body's joint point. Components out of the
        plane have no effect. CommandError: another frame, a value that is not finite.
        """
        body, force, torque = message['body'], message['force'], message['torque']
        (x, y, z), (about_x, about_y, moment) = force, torque
        if body not in self._names:
            raise CommandError('unknown body', f'its frame_id is {body!r:.80}, must be the name of a body: '
                               f'{", ".join(self._names[:32])}')
        if not isfinite(x + y + z + about_x + about_y + moment):
            for value in force + torque:   # a sum of finite ones may be infinite
                if not isfinite(value):
                    raise CommandError('not finite', f'its wrench on {body} has the value {value}, must be finite')
        wrench = {'body': body, 'force': [x, y], 'moment': moment, 'axes': 'body'}
        return Change('wrench', body, wrench, ACROSS if z or about_x or about_y else ())
