"""The states of a log as arrays, decoded many at a time."""
from __future__ import annotations

from typing import Any

import numpy as np

from .cdr import CdrError, decode_joint_state, JointStateLayout
from .mcap_records import MESSAGE
from ..chain.chain import Chain
from ..errors import LogError

_HEAD = np.dtype([('channel', '<u2'), ('sequence', '<u4'), ('log_time', '<u8'), ('publish_time', '<u8')])


def message_heads(content: bytes, places: list) -> tuple:
    """Return the heads (messages,) of the messages at `places` in a chunk, and where the data of each begin and end."""
    octets, bounds = np.frombuffer(content, np.uint8), np.array(places)
    heads = octets[bounds[:, :1] + np.arange(MESSAGE.size)].view(_HEAD)[:, 0]
    return heads, bounds[:, 0] + MESSAGE.size, bounds[:, 1]


class StateDecoder:
    """Decodes the states of one log, given by its path, of a chain; LogError at one that cannot be."""

    def __init__(self, path: Any, chain: Chain) -> None:
        self._path, self._chain = path, chain
        self._layout: Any = None             # of nearly all messages
        self._template: Any = None           # such a message
        self._fixed: Any = None              # which of its bytes never change

    def numbers(self, content: bytes, start: np.ndarray, end: np.ndarray, sequence: np.ndarray) -> np.ndarray:
        """Return position, velocity, effort (states, 3, joints) of the messages from `start` to `end` in a chunk."""
        if self._layout is None:
            self._find_layout(self._decoded(content[start[0]:end[0]], sequence[0]).frame_id)
        if (end - start == self._template.size).all():
            rows = np.frombuffer(content, np.uint8)[start[:, None] + np.arange(self._template.size)]
            if (rows[:, self._fixed] == self._template[self._fixed]).all():
                return self._layout.numbers_of(rows)
        # Written by another tool.
        return np.array([(state.position, state.velocity, state.effort) for state in (
            self._decoded(content[first:last], number) for first, last, number in zip(start, end, sequence))])

    def _find_layout(self, frame_id: str) -> None:
        """Note which bytes all messages of this frame share."""
        self._layout = JointStateLayout(self._chain.joint_names, frame_id)
        messages = []
        for value in (0, -1):   # of all bits
            numbers = np.full(self._chain.joint_count, value, np.int64).view(np.float64)
            for row in (self._layout.position, self._layout.velocity, self._layout.effort):
                row[:] = numbers
            messages.append(np.frombuffer(self._layout.stamped(0), np.uint8))
        self._template = messages[0]
        self._fixed = messages[0] == messages[1]
        self._fixed[4:12] = False   # the stamp

    def _decoded(self, data: bytes, sequence: int) -> Any:
        try:
            state = decode_joint_state(data)
        except CdrError as error:
            raise self._error(f'its state of tick {sequence} cannot be read ({error})') from None
        if state.names != self._chain.joint_names:
            raise self._error(f'its state of tick {sequence} names other joints than its chain')
        for quantity in ('position', 'velocity', 'effort'):
            if getattr(state, quantity).size != len(state.names):
                raise self._error(f'its state of tick {sequence} lacks values of {quantity}')
        return state

    def _error(self, why: str) -> LogError:
        return LogError(f'log {str(self._path)!r}: {why}')
