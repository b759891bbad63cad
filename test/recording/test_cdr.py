"""CDR bytes: the layout compared with known bytes and with real ROS, the decoders with malformed data."""
import tracemalloc

from hypothesis import given, strategies as st
import numpy as np
import pytest

from planar_chain_sim.recording.cdr import (
    CdrError,
    decode_float64_multi_array,
    decode_joint_state,
    decode_string,
    encode_float64_multi_array,
    encode_string,
    JointStateLayout,
)
from planar_chain_sim.recording.message_types import MESSAGE_TYPES

decode_wrench_stamped = MESSAGE_TYPES['geometry_msgs/msg/WrenchStamped'].decode

# What rclpy of ROS 2 Jazzy writes for two joints 'a' and 'bcd', frame 'base', stamp 1.5 s; alignment gaps set to zero.
GOLDEN = bytes.fromhex(
    '00010000'                                                  # little-endian plain CDR
    '01000000' '0065cd1d'                                       # stamp: 1 s, 500000000 ns
    '05000000' '6261736500' '000000'                            # frame_id, gap
    '02000000' '02000000' '6100' '0000' '04000000' '62636400'   # names
    '02000000' '00000000' '000000000000f03f' '0000000000000040'  # position, with a gap up to a multiple of eight
    '02000000' '00000000' '0000000000000840' '0000000000001040'
    '02000000' '00000000' '0000000000001440' '000000000000f87f')
NUMBERS = (4, 8, 12, 24, 28, 36, 44, 68, 92), (52, 60, 76, 84, 100, 108)   # where its 4-byte and 8-byte numbers lie

DECODERS = {decode_joint_state: GOLDEN,
            decode_float64_multi_array: bytes.fromhex(
                '00010000' '01000000' '02000000' '7800' '0000' '03000000' '03000000' '00000000'
                '02000000' '00000000' '000000000000f03f' '0000000000000040'),
            decode_string: encode_string('an event'),
            decode_wrench_stamped: bytes.fromhex(
                '00010000' '01000000' '0065cd1d' '04000000' '61726d00'   # stamp and frame_id 'arm'
                '000000000000f03f' '0000000000000040' '0000000000000840'
                '0000000000001040' '0000000000001440' '0000000000001840')}


def golden_layout():
    layout = JointStateLayout(['a', 'bcd'], 'base')
    layout.position[:] = 1.0, 2.0
    layout.velocity[:] = 3.0, 4.0
    layout.effort[:] = 5.0, np.nan
    return layout


def check_equal(message, names, frame_id, stamp, position, velocity, effort):
    """Compare a decoded message bit for bit with the encoded values."""
    assert message.names == tuple(names)
    assert message.frame_id == frame_id
    assert message.stamp == stamp
    for got, wanted in ((message.position, position), (message.velocity, velocity), (message.effort, effort)):
        assert got.dtype == np.float64
        assert got.tobytes() == np.asarray(wanted, np.float64).tobytes()


def test_layout_is_the_golden_message():
    assert golden_layout().stamped(1_500_000_000) == GOLDEN


def test_decoded_golden_message():
    check_equal(decode_joint_state(GOLDEN), ['a', 'bcd'], 'base', 1_500_000_000, [1, 2], [3, 4], [5, np.nan])


def test_big_endian_message():
    swapped = bytearray(GOLDEN)
    swapped[1] = 0
    for size, starts in zip((4, 8), NUMBERS):
        for start in starts:
            swapped[start:start + size] = swapped[start:start + size][::-1]
    check_equal(decode_joint_state(bytes(swapped)), ['a', 'bcd'], 'base', 1_500_000_000, [1, 2], [3, 4], [5, np.nan])


def test_a_patched_layout_keeps_its_gaps_and_earlier_copies():
    layout = golden_layout()
    before = layout.stamped(1_500_000_000)
    layout.position[:] = 7.0, 8.0
    message = decode_joint_state(layout.stamped(-1))
    assert before == GOLDEN
    assert message.stamp == -1
    assert message.position.tolist() == [7.0, 8.0]
    layout.position[:] = 1.0, 2.0
    assert layout.stamped(1_500_000_000) == GOLDEN


def test_decoded_arrays_outlive_the_message():
    data = bytearray(GOLDEN)
    message = decode_joint_state(data)
    data[:] = bytes(len(data))
    assert message.position.tolist() == [1.0, 2.0]
    message.position[0] = 9.0


@pytest.mark.parametrize('joints', [0, 1, 2, 7, 40])
def test_round_trip(joints):
    names = [f'gelenk_{"ä" * index}' for index in range(joints)]
    layout = JointStateLayout(names, 'rämen')
    values = np.random.default_rng(joints).normal(size=(3, joints))
    layout.position[:], layout.velocity[:], layout.effort[:] = values
    messages = [layout.stamped(1_700_000_000_123_456_789)]
    check_equal(decode_joint_state(messages[0]), names, 'rämen', 1_700_000_000_123_456_789, *values)
    layout.velocity[:] = -1.0
    messages.append(layout.stamped(0))
    assert np.array_equal(layout.numbers_of(messages), [values, [values[0], [-1.0] * joints, values[2]]])


@pytest.mark.parametrize('values', [[], [1.0], [0.1, -np.inf, 3.0]])
def test_float64_multi_array_round_trip(values):
    assert list(decode_float64_multi_array(encode_float64_multi_array(values))) == values


def test_an_empty_sequence_has_no_gap():
    assert encode_float64_multi_array([]) == bytes.fromhex('00010000' '00000000' '00000000' '00000000')


@pytest.mark.parametrize('text', ['', 'a', '{"tick": 5}', 'größer'])
def test_string_round_trip(text):
    assert decode_string(encode_string(text)) == text


def test_a_string_of_length_zero_is_empty():
    assert decode_string(bytes.fromhex('0001000000000000')) == ''


@pytest.mark.parametrize('wrong', [
    lambda: encode_string('a\0b'), lambda: encode_string('\ud800'), lambda: JointStateLayout(['a\0']),
    lambda: JointStateLayout(['a'], '\0'), lambda: encode_float64_multi_array([[1.0]]),
    lambda: JointStateLayout(['a']).stamped(2 ** 31 * 10 ** 9)])
def test_what_cdr_cannot_carry(wrong):
    with pytest.raises(CdrError):
        wrong()


def test_a_wrench():
    golden = DECODERS[decode_wrench_stamped]
    wanted = {'body': 'arm', 'force': [1.0, 2.0, 3.0], 'torque': [4.0, 5.0, 6.0]}
    assert decode_wrench_stamped(golden) == wanted
    numbers = [golden[start:start + 8] for start in range(20, 68, 8)]
    swapped = bytes.fromhex('00000000' '00000001' '1dcd6500' '00000004') + golden[16:20]
    assert decode_wrench_stamped(swapped + b''.join(number[::-1] for number in numbers)) == wanted
    with pytest.raises(CdrError, match='no geometry_msgs/msg/WrenchStamped: it ends where 48 bytes are due'):
        decode_wrench_stamped(golden[:-1])


@pytest.mark.parametrize('data, reason', [
    (b'', 'nothing'), (b'\0\1\0', '000100'), (b'\0\3' + GOLDEN[2:], '0003'),
    (GOLDEN[:20], 'ends'), (GOLDEN[:-1], 'ends'),
    (GOLDEN[:28] + b'\xff\xff\xff\xff' + GOLDEN[32:], '4294967295'),       # length of a name
    (GOLDEN[:24] + b'\xff\xff\xff\xff' + GOLDEN[28:], '4294967295'),       # number of names
    (GOLDEN[:92] + b'\xff\xff\xff\x7f' + GOLDEN[96:], '2147483647'),       # number of efforts
    (GOLDEN[:33] + b'x' + GOLDEN[34:], 'NUL'), (GOLDEN[:32] + b'\xff' + GOLDEN[33:], 'UTF-8')])
def test_malformed_joint_state(data, reason):
    with pytest.raises(CdrError, match=reason) as caught:
        decode_joint_state(data)
    assert '\n' not in str(caught.value)


@pytest.mark.parametrize('start', [24, 28, 44, 68, 92])
def test_a_false_count_allocates_nothing(start):
    data = GOLDEN[:start] + b'\xff\xff\xff\x0f' + GOLDEN[start + 4:]
    tracemalloc.start()
    try:
        decode_joint_state(data)
    except CdrError:
        _, peak = tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()
    assert peak < 20_000   # bytes: the message is 116, the counts announce up to 2 GB


def decodes_or_refuses(decode, data):
    """Any data is a message no larger than itself or a CdrError."""
    try:
        message = decode(data)
    except CdrError:
        return
    arrays = {decode_joint_state: lambda: (message.position, message.velocity, message.effort),
              decode_float64_multi_array: lambda: (np.array(message),), decode_string: lambda: (),
              decode_wrench_stamped: lambda: (np.array(message['force']), np.array(message['torque']))}[decode]()
    assert sum(array.nbytes for array in arrays) <= len(data)
    assert isinstance(message, str) == (decode is decode_string)


@pytest.mark.parametrize('decode', DECODERS)
@given(data=st.binary(max_size=200), head=st.sampled_from([b'', b'\0\1\0\0', b'\0\0\0\0']))
def test_random_bytes(decode, data, head):
    decodes_or_refuses(decode, head + data)


@pytest.mark.parametrize('decode', DECODERS)
@given(data=st.data())
def test_damaged_messages(decode, data):
    damaged = bytearray(DECODERS[decode])
    for bit in data.draw(st.lists(st.integers(0, 8 * len(damaged) - 1), max_size=4)):
        damaged[bit // 8] ^= 1 << bit % 8
    del damaged[data.draw(st.integers(0, len(damaged))):]
    decodes_or_refuses(decode, bytes(damaged))


@pytest.mark.parametrize('decode', DECODERS)
def test_every_truncation_is_refused(decode):
    whole = DECODERS[decode]
    decode(whole)
    for length in range(len(whole) - 3 if decode is decode_string else len(whole)):
        with pytest.raises(CdrError):
            decode(whole[:length])


@pytest.mark.ros
class TestAgainstRos:
    """Real rclpy serialization."""

    @pytest.fixture(autouse=True)
    def ros(self):
        """Import what only these tests need."""
        import geometry_msgs.msg
        import rclpy.serialization
        import sensor_msgs.msg
        import std_msgs.msg
        self.geometry, self.sensor, self.std = geometry_msgs.msg, sensor_msgs.msg, std_msgs.msg
        self.serialization = rclpy.serialization

    @pytest.mark.parametrize('joints', range(1, 41))
    def test_joint_state(self, joints):
        random = np.random.default_rng(joints)
        names = ['äß'[:index % 3] + 'j' * random.integers(0, 12) for index in range(joints)]
        frame_id = 'f' * random.integers(0, 9)
        position, velocity, effort = random.normal(size=(3, joints))
        layout = JointStateLayout(names, frame_id)
        layout.position[:], layout.velocity[:], layout.effort[:] = position, velocity, effort
        ours = layout.stamped(1_700_000_000_123_456_789)

        read = self.serialization.deserialize_message(ours, self.sensor.JointState)
        assert read.name == names
        assert read.header.frame_id == frame_id
        assert (read.header.stamp.sec, read.header.stamp.nanosec) == (1_700_000_000, 123_456_789)
        assert (read.position.tolist(), read.velocity.tolist(), read.effort.tolist()) == (
            position.tolist(), velocity.tolist(), effort.tolist())

        theirs = self.serialization.serialize_message(read)
        assert len(theirs) == len(ours)
        check_equal(decode_joint_state(theirs), names, frame_id, 1_700_000_000_123_456_789, position, velocity, effort)

    @pytest.mark.parametrize('lengths', [(0, 0, 0), (0, 0, 2), (1, 3, 0), (2, 1, 2)])
    def test_ragged_joint_state(self, lengths):
        arrays = [np.arange(1.0, length + 1.0) for length in lengths]
        message = self.sensor.JointState(name=['a', 'b'], position=arrays[0], velocity=arrays[1], effort=arrays[2])
        check_equal(decode_joint_state(self.serialization.serialize_message(message)), ['a', 'b'], '', 0, *arrays)

    @pytest.mark.parametrize('labels', [[], ['x'], ['row', 'column']])
    @pytest.mark.parametrize('values', [[], [1.0], [0.1, -2.5, 1e300]])
    def test_float64_multi_array(self, labels, values):
        message = self.std.Float64MultiArray(data=values)
        message.layout.dim = [self.std.MultiArrayDimension(label=label, size=3, stride=3) for label in labels]
        assert list(decode_float64_multi_array(self.serialization.serialize_message(message))) == values
        ours = encode_float64_multi_array(values)
        assert self.serialization.deserialize_message(ours, self.std.Float64MultiArray).data.tolist() == values

    @pytest.mark.parametrize('frame_id', ['', 'a', 'arm', 'größer', 'f' * 60])
    def test_wrench_stamped(self, frame_id):
        message = self.geometry.WrenchStamped()
        message.header.frame_id, message.header.stamp.sec = frame_id, 5
        numbers = np.random.default_rng(len(frame_id)).normal(size=6).tolist()
        for part, values in ((message.wrench.force, numbers[:3]), (message.wrench.torque, numbers[3:])):
            part.x, part.y, part.z = values
        data = self.serialization.serialize_message(message)
        assert decode_wrench_stamped(data) == {'body': frame_id, 'force': numbers[:3], 'torque': numbers[3:]}

    @pytest.mark.parametrize('text', ['', 'abc', 'größer', '{"tick": 12345}'])
    def test_string(self, text):
        assert decode_string(self.serialization.serialize_message(self.std.String(data=text))) == text
        assert self.serialization.deserialize_message(encode_string(text), self.std.String).data == text
