"""Wrenches on bodies: reading and checking of messages."""
from __future__ import annotations

from math import isfinite
from typing import Sequence

from .commands import CommandError, LONGEST_MESSAGE
from ..recording.cdr import CdrError, decode_wrench_stamped


class WrenchReader:
    """Reads the wrenches on bodies of these names."""

    def __init__(self, body_names: Sequence[str]):
        self._names = tuple(body_names)

    def read(self, data: bytes) -> tuple[dict, str]:
        """
        Return the data of the event 'wrench' for a geometry_msgs/msg/WrenchStamped (CDR), and what has no effect.

        Its frame is that of a body: x and y in the plane, the force at the body's joint point. Components out of the
        plane have no effect; the second value says so, or is ''. CommandError: malformed bytes, another frame, a value
        that is not finite.
        """
        if len(data) > LONGEST_MESSAGE:
            raise CommandError('too long', f'it has {len(data)} bytes, must have at most {LONGEST_MESSAGE}')
        try:
            frame_id, force, torque = decode_wrench_stamped(data)
        except CdrError as error:
            raise CommandError('malformed', str(error)) from None
        if frame_id not in self._names:
            raise CommandError('unknown body', f'its frame_id is {frame_id!r:.80}, must be the name of a body: '
                               f'{", ".join(self._names[:32])}')
        for value in (*force, *torque):
            if not isfinite(value):
                raise CommandError('not finite', f'its wrench on {frame_id} has the value {value}, must be finite')
        across = force[2] or torque[0] or torque[1]
        return ({'body': frame_id, 'force': list(force[:2]), 'moment': torque[2], 'axes': 'body'},
                'has a force along z or a torque about x or y, which has no effect' if across else '')
