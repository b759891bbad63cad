"""
CDR: the bytes of the few ROS messages that this package writes and reads itself, with no ROS installed.

The encoding is plain CDR, version 1 (OMG DDS-XTypes 1.3, section 7.4; DDSI-RTPS 2.3, section 10), which every ROS 2
middleware puts on the wire: four bytes of encapsulation, then the fields in order, each number aligned to its own size
counted from the end of the encapsulation. A string is a uint32 length (closing NUL included), UTF-8 bytes and the NUL;
a sequence is a uint32 count and its elements, with no alignment gap when it is empty. Bytes after the end are ignored:
rmw_fastrtps sizes its buffers generously and sends what happens to lie there.
"""
from __future__ import annotations

from dataclasses import dataclass
from struct import Struct, unpack_from
from typing import Sequence

import numpy as np

_ENCAPSULATION = b'\x00\x01\x00\x00'                         # little-endian plain CDR, no options
_STAMP = Struct('<iI')
_COUNT = Struct('<I')
_ENCODINGS = {                                               # first two bytes -> stamp, count, float64 as they follow
    b'\x00\x01': (_STAMP, _COUNT, np.dtype('<f8')),
    b'\x00\x00': (Struct('>iI'), Struct('>I'), np.dtype('>f8')),
}
_PLAIN_ARRAY = _ENCAPSULATION + bytes(8)                     # a Float64MultiArray without dimensions, data_offset 0


class CdrError(ValueError):
    """Bytes that are not the expected message, or a text that CDR cannot carry: one sentence."""


@dataclass(frozen=True, eq=False)
class JointStateMessage:
    """
    A decoded sensor_msgs/msg/JointState.

    stamp: ns. position (rad or m), velocity (rad/s or m/s), effort (N m or N): float64 arrays with the lengths that
    they have in the message, which may differ.
    """

    stamp: int
    frame_id: str
    names: tuple
    position: np.ndarray
    velocity: np.ndarray
    effort: np.ndarray


class JointStateLayout:
    """
    One sensor_msgs/msg/JointState of fixed names and frame, laid out once and patched in place for every tick.

    position, velocity, effort: float64 views (joints,) into the message, SI units. Alignment gaps are zero, so equal
    states give equal bytes. CdrError on a name or frame_id that holds a NUL or is no Unicode text.
    """

    def __init__(self, joint_names: Sequence[str], frame_id: str = ''):
        joints = len(joint_names)
        body = bytearray(_STAMP.size)
        _append_string(body, frame_id)
        _append_count(body, joints)
        for name in joint_names:
            _append_string(body, name)
        starts = [_append_float64_array(body, np.zeros(joints)) for _ in range(3)]

        # Four spare bytes in front put the body, and with it every float64, on a multiple of eight in memory.
        memory = np.frombuffer(bytearray(4) + _ENCAPSULATION + body, np.uint8)
        self._message = memory[4:]
        self._seconds, self._nanoseconds = memory[8:12].view('<i4').data, memory[12:16].view('<u4').data
        self._shape, self._start, self._strides = (3, joints), 4 + starts[0], (starts[1] - starts[0], 8)
        self.position, self.velocity, self.effort = np.ndarray(self._shape, '<f8', memory, 4 + self._start,
                                                               self._strides)

    def stamped(self, nanoseconds: int) -> bytes:
        """
        Put the time (int, ns) into header.stamp and return a copy of the message, encapsulation included.

        CdrError where the seconds do not fit into an int32.
        """
        seconds = nanoseconds // 1_000_000_000
        try:
            self._seconds[0], self._nanoseconds[0] = seconds, nanoseconds - seconds * 1_000_000_000
        except ValueError:
            raise CdrError(f'stamp {nanoseconds} ns: its seconds do not fit into the int32 of ROS time') from None
        return self._message.tobytes()

    def numbers_of(self, messages) -> np.ndarray:
        """Return position, velocity, effort (messages, 3, joints) of messages from stamped(), as bytes or as rows."""
        memory = messages if isinstance(messages, np.ndarray) else b''.join(messages)
        return np.ndarray((len(messages), *self._shape), '<f8', memory, self._start,
                          (self._message.size, *self._strides))


class ClockLayout:
    """One rosgraph_msgs/msg/Clock, patched in place."""

    def __init__(self):
        self._message = bytearray(_ENCAPSULATION + bytes(_STAMP.size))

    def stamped(self, nanoseconds: int) -> bytes:
        """Put the time (int, ns) in, which must fit as in JointStateLayout, and return a copy of the message."""
        _STAMP.pack_into(self._message, len(_ENCAPSULATION), *divmod(nanoseconds, 1_000_000_000))
        return bytes(self._message)


class TransformsLayout:
    """
    One tf2_msgs/msg/TFMessage of fixed frames, laid out once and patched in place for every state.

    `pairs`: names of parent and child of each frame; CdrError on one that holds a NUL or is no Unicode text.
    """

    def __init__(self, pairs: Sequence[tuple[str, str]]):
        body, stamps, poses = bytearray(_COUNT.pack(len(pairs))), [], []
        for parent, child in pairs:
            _align(body, 4)
            stamps.append(len(body))
            body.extend(bytes(_STAMP.size))
            _append_string(body, parent)
            _append_string(body, child)
            _align(body, 8)
            poses.append(len(body))
            body.extend(bytes(7 * 8))
        # Four spare bytes in front, as in JointStateLayout.
        memory = np.frombuffer(bytearray(4) + _ENCAPSULATION + body + bytes(-len(body) % 8), np.uint8)
        self._message = memory[4:8 + len(body)]
        self._words, self._numbers = memory[8:].view('<i4'), memory[8:].view('<f8')
        self._stamps = np.array(stamps, int) // 4
        self._poses = np.array(poses, int)[:, None] // 8 + np.arange(7)

    def stamped(self, nanoseconds: int, poses: np.ndarray) -> bytes:
        """
        Put in the time (int, ns), as in JointStateLayout, and each frame's pose; return a copy of the message.

        `poses` (frames, 7): translation x, y, z, m, and rotation, a quaternion x, y, z, w.
        """
        self._words[self._stamps], self._words[self._stamps + 1] = divmod(nanoseconds, 1_000_000_000)
        self._numbers[self._poses] = poses
        return self._message.tobytes()


def decode_joint_state(data) -> JointStateMessage:
    """Decode a sensor_msgs/msg/JointState (bytes-like, encapsulation included); CdrError if it is none."""
    cursor = Cursor(data, 'sensor_msgs/msg/JointState')
    seconds, nanoseconds = cursor.stamp()
    return JointStateMessage(
        stamp=seconds * 1_000_000_000 + nanoseconds,
        frame_id=cursor.string(),
        names=tuple([cursor.string() for _ in range(cursor.count(4))]),
        position=cursor.float64_array(),
        velocity=cursor.float64_array(),
        effort=cursor.float64_array())


def decode_float64_multi_array(data) -> Sequence[float]:
    """Decode a std_msgs/msg/Float64MultiArray to its data, the layout unread; CdrError if it is none."""
    if data[:12] == _PLAIN_ARRAY and len(data) >= 16:        # as nearly all are, and one may come at every tick
        count, = _COUNT.unpack_from(data, 12)
        if count and len(data) >= 20 + 8 * count:            # a gap of four lies before the first value
            return unpack_from(f'<{count}d', data, 20)
    cursor = Cursor(data, 'std_msgs/msg/Float64MultiArray')
    for _ in range(cursor.count(12)):
        cursor.string()                                      # label
        cursor.count(0)                                      # size
        cursor.count(0)                                      # stride
    cursor.count(0)                                          # data_offset
    return cursor.float64_array().tolist()


def encode_float64_multi_array(values) -> bytes:
    """Encode a std_msgs/msg/Float64MultiArray with an empty layout; values (n,), CdrError on another shape."""
    values = np.asarray(values, np.float64)
    if values.ndim != 1:
        raise CdrError(f'std_msgs/msg/Float64MultiArray: the values have shape {values.shape}, must be (n,)')
    body = bytearray()
    _append_count(body, 0)                                   # no dimension is described
    _append_count(body, 0)                                   # data_offset
    _append_float64_array(body, values)
    return _ENCAPSULATION + body


def decode_clock(data) -> int:
    """Decode a rosgraph_msgs/msg/Clock to its time, ns; CdrError if it is none."""
    seconds, nanoseconds = Cursor(data, 'rosgraph_msgs/msg/Clock').stamp()
    return seconds * 1_000_000_000 + nanoseconds


def decode_string(data) -> str:
    """Decode a std_msgs/msg/String to its text; CdrError if it is none."""
    return Cursor(data, 'std_msgs/msg/String').string()


def encode_string(text: str) -> bytes:
    """Encode a std_msgs/msg/String; CdrError on a text that holds a NUL or is no Unicode text."""
    encoded = _encoded_text(text)
    return _ENCAPSULATION + _COUNT.pack(len(encoded)) + encoded


def _align(body: bytearray, size: int) -> None:
    body.extend(bytes(-len(body) % size))


def _append_count(body: bytearray, count: int) -> None:
    _align(body, 4)
    body.extend(_COUNT.pack(count))


def _encoded_text(text: str) -> bytes:
    """Return the bytes of a string with the NUL that ends it; CdrError."""
    try:
        encoded = text.encode()
    except UnicodeEncodeError:
        raise CdrError(f'text {text!r}: it is no Unicode text, so a ROS string cannot carry it') from None
    if b'\0' in encoded:
        raise CdrError(f'text {text!r}: it holds a NUL, which ends a ROS string')
    return encoded + b'\0'


def _append_string(body: bytearray, text: str) -> None:
    encoded = _encoded_text(text)
    _append_count(body, len(encoded))
    body.extend(encoded)


def _append_float64_array(body: bytearray, values: np.ndarray) -> int:
    """Append a float64 sequence and return where its first element lies."""
    _append_count(body, len(values))
    if len(values):
        _align(body, 8)
    start = len(body)
    body.extend(values.astype('<f8').tobytes())
    return start


class Cursor:
    """A place in a CDR message; each read checks the remaining bytes first, so a false count allocates nothing."""

    def __init__(self, data, type_name: str):
        data = memoryview(data).cast('B')
        self._type_name = type_name
        if len(data) < 4 or bytes(data[:2]) not in _ENCODINGS:
            raise self._malformed(f'it begins with {bytes(data[:4]).hex() or "nothing"}, must be 00010000 or 00000000')
        self._stamp, self._count, self._float64 = _ENCODINGS[bytes(data[:2])]
        self._body = data[4:]
        self._offset = 0

    def stamp(self) -> tuple:
        """Read builtin_interfaces/Time: seconds, nanoseconds."""
        return self._stamp.unpack_from(self._body, self._take(8, 4))

    def count(self, element_size: int) -> int:
        """Read a uint32; that many elements of at least element_size bytes must fit into the remaining bytes."""
        number, = self._count.unpack_from(self._body, self._take(4, 4))
        if number * element_size > len(self._body) - self._offset:
            raise self._malformed(f'it ends before the {number} elements announced at byte {self._offset}')
        return number

    def string(self) -> str:
        """Read a string; a length of zero is taken for an empty one, as some writers leave out the NUL."""
        length = self.count(1)
        start = self._take(length, 1)
        encoded = bytes(self._body[start:start + length])
        if length and encoded[-1]:
            raise self._malformed(f'the string at byte {start + 4} does not end in NUL')
        try:
            return encoded[:-1].decode()
        except UnicodeDecodeError:
            raise self._malformed(f'the string at byte {start + 4} is not UTF-8') from None

    def float64s(self, count: int) -> tuple:
        """Read this many float64 fields."""
        start = self._take(8 * count, 8)
        return unpack_from(f'{self._count.format[0]}{count}d', self._body, start)

    def float64_array(self) -> np.ndarray:
        """Read a float64 sequence into an array of its own."""
        length = self.count(8)
        start = self._take(8 * length, 8) if length else self._offset
        return np.frombuffer(self._body, self._float64, length, start).astype(np.float64)

    def _take(self, size: int, alignment: int) -> int:
        start = self._offset + -self._offset % alignment
        if start + size > len(self._body):
            raise self._malformed(f'it ends where {size} bytes are due at byte {start + 4}')
        self._offset = start + size
        return start

    def _malformed(self, detail: str) -> CdrError:
        return CdrError(f'no {self._type_name}: {detail}')
