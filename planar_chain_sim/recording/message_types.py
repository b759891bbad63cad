"""
The messages a log can hold: definitions and type hashes, so that a log explains itself where ROS is not installed.

A definition is laid out as rosbag2 lays it out (rosbag2_storage_mcap, message_definition_cache): the message, then for
each type it uses, depth first, a line of 80 '=', a line 'MSG: package/Type' and that type. The hash is the RIHS01 of
REP-2016, which is blind to comments, so these definitions carry none.
"""
from __future__ import annotations

from typing import Callable, NamedTuple, Optional

from .cdr import Cursor, decode_float64_multi_array, decode_joint_state


class MessageType(NamedTuple):
    """
    How a log explains one type: its definition with all it uses (encoding 'ros2msg'), and its RIHS01 hash.

    `decode`: for a type that the node takes as an input, bytes -> what of it can have an effect, as plain data;
    CdrError where the bytes are no such message.
    """

    definition: str
    type_hash: str
    decode: Optional[Callable[[bytes], dict]] = None


def _efforts(data: bytes) -> dict:
    return {'effort': list(decode_float64_multi_array(data))}


def _joint_state(data: bytes) -> dict:
    state = decode_joint_state(data)
    return {'stamp': state.stamp, 'names': list(state.names), 'position': state.position.tolist(),
            'velocity': state.velocity.tolist(), 'effort': state.effort.tolist()}


def _wrench(data: bytes) -> dict:
    cursor = Cursor(data, 'geometry_msgs/msg/WrenchStamped')
    cursor.stamp()
    body, (x, y, z, about_x, about_y, about_z) = cursor.string(), cursor.float64s(6)
    return {'body': body, 'force': [x, y, z], 'torque': [about_x, about_y, about_z]}


def _with_parts(definition: str, *parts: str) -> str:
    separator = '\n' + '=' * 80 + '\nMSG: '
    return separator.join((definition,) + parts)


_TIME = 'builtin_interfaces/Time\nint32 sec\nuint32 nanosec\n'
_HEADER = 'std_msgs/Header\nbuiltin_interfaces/Time stamp\nstring frame_id\n'
_LAYOUT = 'std_msgs/MultiArrayLayout\nMultiArrayDimension[] dim\nuint32 data_offset\n'
_WRENCH = 'geometry_msgs/Wrench\nVector3 force\nVector3 torque\n'
_VECTOR3 = 'geometry_msgs/Vector3\nfloat64 x\nfloat64 y\nfloat64 z\n'
_TRANSFORM_STAMPED = 'geometry_msgs/TransformStamped\nstd_msgs/Header header\nstring child_frame_id\n' \
                     'Transform transform\n'
_TRANSFORM = 'geometry_msgs/Transform\nVector3 translation\nQuaternion rotation\n'
_QUATERNION = 'geometry_msgs/Quaternion\nfloat64 x 0\nfloat64 y 0\nfloat64 z 0\nfloat64 w 1\n'
_DIMENSION = 'std_msgs/MultiArrayDimension\nstring label\nuint32 size\nuint32 stride\n'

MESSAGE_TYPES = {
    'sensor_msgs/msg/JointState': MessageType(
        _with_parts('std_msgs/Header header\nstring[] name\nfloat64[] position\nfloat64[] velocity\nfloat64[] effort\n',
                    _HEADER, _TIME),
        'RIHS01_a13ee3a330e346c9d87b5aa18d24e11690752bd33a0350f11c5882bc9179260e', _joint_state),
    'std_msgs/msg/Float64MultiArray': MessageType(
        _with_parts('MultiArrayLayout layout\nfloat64[] data\n', _LAYOUT, _DIMENSION),
        'RIHS01_1025ddc6b9552d191f89ef1a8d2f60f3d373e28b283d8891ddcc974e8c55397f', _efforts),
    'geometry_msgs/msg/WrenchStamped': MessageType(
        _with_parts('std_msgs/Header header\nWrench wrench\n', _HEADER, _TIME, _WRENCH, _VECTOR3),
        'RIHS01_8dc3deaf06b2ab281f9f9a742a8961c328ca7cec16e3fd6586d3a5c83fa78f77', _wrench),
    'std_msgs/msg/String': MessageType(
        'string data\n',
        'RIHS01_df668c740482bbd48fb39d76a70dfd4bd59db1288021743503259e948f6b1a18'),
    'tf2_msgs/msg/TFMessage': MessageType(
        _with_parts('geometry_msgs/TransformStamped[] transforms\n', _TRANSFORM_STAMPED, _TRANSFORM, _QUATERNION,
                    _VECTOR3, _HEADER, _TIME),
        'RIHS01_e369d0f05a23ae52508854b66f6aa0437f3449d652e8cbf22d5abe85d020f087'),
    'rosgraph_msgs/msg/Clock': MessageType(
        _with_parts('builtin_interfaces/Time clock\n', _TIME),
        'RIHS01_692f7a66e93a3c83e71765d033b60349ba68023a8c689a79e48078bcb5c58564'),
}
# Those that the node receives; a log of it has their messages as they came.
INPUT_TYPES = frozenset(name for name, row in MESSAGE_TYPES.items() if row.decode)
