"""Which commands act and which are refused, byte by byte."""
import json

import numpy as np
import pytest

from planar_chain_sim._kernel import plain_command
from planar_chain_sim.recording.cdr import decode_string, encode_float64_multi_array, JointStateLayout
from planar_chain_sim.ros.answers import Answers
from planar_chain_sim.ros.commands import Command, CommandError, CommandReader, HeldEffort

IN_ORDER, BY_NAME = 'std_msgs/msg/Float64MultiArray', 'sensor_msgs/msg/JointState'


def joint_state(**efforts):
    layout = JointStateLayout(list(efforts))
    layout.effort[:] = list(efforts.values())
    return layout.stamped(0)


@pytest.fixture
def reader():
    return CommandReader(['a', 'b', 'c'])


def test_the_common_command_is_taken_as_any_other(reader):
    """Twin: the kernel's short way and the reader, on every kind of number; what is not plain is left to the reader."""
    random = np.random.default_rng(5)
    for tick in range(300):
        values = (random.normal(size=3) * 10.0 ** random.integers(-308, 308, 3)).tolist()
        values[tick % 3] = [0.0, -0.0, 5e-324, 3.0, 1e22][tick % 5]
        data, effort = encode_float64_multi_array(values), np.full(3, 7.0)
        told = plain_command(data + bytes(tick % 4), effort, 2 ** 40 + tick, '/sim/commands')
        event = json.loads(decode_string(told))
        assert effort.tobytes() == np.array(values).tobytes() == np.array(event['data'].pop('effort')).tobytes()
        assert event == {'tick': 2 ** 40 + tick, 'kind': 'command', 'data': {'topic': '/sim/commands'}}
        command = reader.read(IN_ORDER, data)
        assert np.array(command.efforts).tobytes() == effort.tobytes()
    plain, effort = encode_float64_multi_array([1.0, 2.0, 3.0]), np.full(3, 7.0)
    for other in (plain[:-1], plain[:10], b'', b'\0\0' + plain[2:], plain[:4] + b'\1' + plain[5:],
                  *map(encode_float64_multi_array, (
                      [], [1.0, 2.0], [1.0, 2.0, 3.0, 4.0], [1.0, np.nan, 2.0], [1.0, 2.0, np.inf]))):
        assert plain_command(other, effort, 0, '/sim/commands') is None
    assert effort.tolist() == [7.0, 7.0, 7.0]


def parts(command):
    return list(command.joints), list(command.efforts)


def test_in_order(reader):
    assert parts(reader.read(IN_ORDER, encode_float64_multi_array([1.0, 2.0, 3.0]))) == ([0, 1, 2], [1.0, 2.0, 3.0])


def test_by_name_in_the_order_of_the_message_with_its_stamp(reader):
    layout = JointStateLayout(['c', 'a'])
    layout.effort[:] = -3.0, 9.0
    command = reader.read(BY_NAME, layout.stamped(1_000_000_007))
    assert parts(command) == ([2, 0], [-3.0, 9.0]) and command.ignored == () and command.stamp == 1_000_000_007


def test_unknown_names_are_told_and_the_rest_acts(reader):
    command = reader.read(BY_NAME, joint_state(x=7.0, b=5.0))
    assert parts(command) == ([1], [5.0])
    assert command.ignored == (('unknown joint', "names 'x', not among the joints a, b, c"),)
    assert parts(reader.read(BY_NAME, joint_state(x=7.0))) == ([], [])


def test_positions_alone_command_nothing_and_are_told(reader):
    data = joint_state(a=1.0)
    without_effort = data[:-16] + bytes(4)   # instead of count, gap and value
    command = reader.read(BY_NAME, without_effort)
    assert parts(command) == ([], [])
    assert command.ignored == (('no effort', "has a position without an effort for 'a', but only efforts act"),)


def message(names=(), position=(), velocity=(), effort=()):
    """Return a JointState as rclpy writes it; arrays may be of any lengths."""
    from rclpy.serialization import serialize_message
    from sensor_msgs.msg import JointState
    return serialize_message(JointState(name=list(names), position=list(position), velocity=list(velocity),
                                        effort=list(effort)))


def test_nan_is_no_command_for_a_joint_and_infinity_refuses_the_message(reader):
    """Invariant, on random messages: exactly the known joints with a number are commanded, with its bits."""
    random = np.random.default_rng(7)
    commanded = refused = 0
    for _ in range(600):
        names = list(random.permutation(['a', 'b', 'c', 'x', 'y']))[:random.integers(1, 6)]
        efforts = (random.normal(size=len(names)) * 10.0 ** random.integers(-300, 300, len(names))).tolist()
        efforts = [random.choice([value, np.nan, np.nan, -0.0, np.inf], p=[0.5, 0.2, 0.15, 0.1, 0.05])
                   for value in efforts]
        data = message(names, effort=efforts)
        if np.isinf(efforts).any():
            with pytest.raises(CommandError, match='inf, must be finite'):
                reader.read(BY_NAME, data)
            refused += 1
            continue
        command = reader.read(BY_NAME, data)
        wanted = {name: value for name, value in zip(names, efforts) if name in 'abc' and not np.isnan(value)}
        assert [('abc')[joint] for joint in command.joints] == list(wanted)
        assert np.array(command.efforts).tobytes() == np.array(list(wanted.values())).tobytes()
        told = [reason for reason, _ in command.ignored]
        assert told == (['unknown joint'] if {'x', 'y'} & set(names) else [])
        commanded += bool(wanted)
    assert commanded > 200 and refused > 50


def test_what_the_topic_based_hardware_of_ros2_control_sends(reader):
    """
    Twin, on random robots: all joints of the tag are named, efforts come for those alone with an effort interface.

    With commanded_joints they go where they belong, NaN for those that no controller has claimed; without it such a
    message is refused, and the sentence says what to set.
    """
    random = np.random.default_rng(8)
    ragged = 0
    for _ in range(300):
        tag = list(random.permutation(['a', 'b', 'c', 'gripper']))[:random.integers(1, 5)]
        with_effort = [name for name in tag if random.random() < 0.6]
        efforts = [random.choice([float(random.normal()), np.nan]) for _ in with_effort]
        data = message(tag, position=[np.nan] * len(tag), effort=efforts)
        wanted = {name: value for name, value in zip(with_effort, efforts)
                  if name != 'gripper' and not np.isnan(value)}
        command = CommandReader(['a', 'b', 'c'], with_effort).read(BY_NAME, data)
        assert dict(zip(('abc'[joint] for joint in command.joints), command.efforts)) == wanted
        assert {reason for reason, _ in command.ignored} <= {'unknown joint'}
        if 0 < len(with_effort) < len(tag):
            ragged += 1
            with pytest.raises(CommandError, match='parameter commanded_joints must name the joints that the efforts '
                                                   'are for, in order'):
                reader.read(BY_NAME, data)
    assert ragged > 100


@pytest.mark.parametrize('names, efforts', [
    (['a', 'b', 'c'], [1.0]),                 # fewer than commanded_joints has
    (['c', 'b', 'a'], [1.0, 2.0]),            # in another order
    (['a', 'b', 'x'], [1.0, 2.0]),            # one of them is not there
    (['a'], [1.0, 2.0])])                     # more efforts than names
def test_a_short_effort_that_does_not_go_with_commanded_joints_is_refused(names, efforts):
    with pytest.raises(CommandError) as refusal:
        CommandReader(['a', 'b', 'c'], ['a', 'c']).read(BY_NAME, message(names, effort=efforts))
    assert refusal.value.reason == 'wrong length'


def test_a_joint_named_twice_is_refused_and_an_unknown_name_twice_is_not(reader):
    for efforts in ([1.0, 2.0, 3.0], [np.nan, 2.0, np.nan], [1.0, 1.0, 1.0]):
        with pytest.raises(CommandError, match="it names joint 'b' more than once, must name each once") as refusal:
            reader.read(BY_NAME, message(['b', 'a', 'b'], effort=efforts))
        assert refusal.value.reason == 'named twice'
    assert parts(reader.read(BY_NAME, message(['x', 'a', 'x'], effort=[1.0, 2.0, 3.0]))) == ([0], [2.0])


NAN2 = [np.nan, np.nan]


@pytest.mark.parametrize('data, reason', [
    (message(), 'empty'),
    (message(['a', 'b']), 'no effort'),
    (message(['a', 'b'], velocity=[0.0, 1.0]), 'no effort'),
    (message(['a', 'b'], position=[np.nan, 1.0], effort=[1.0, np.nan]), 'no effort'),   # of b, as a gripper has it
    (message(['a', 'b'], position=[1.0], effort=[1.0, np.nan]), 'no effort'),
    (message(['x'], effort=[1.0]), 'unknown joint'),
    # These are normal: messages before a controller is active, and efforts with additional positions or velocities.
    (message(['a', 'b'], effort=NAN2), None),
    (message(['a', 'b'], position=NAN2, velocity=NAN2), None),
    (message(['a', 'b'], position=NAN2, velocity=NAN2, effort=NAN2), None),
    (message(['a', 'b'], position=[1.0, 2.0], velocity=[3.0, 4.0], effort=[5.0, 6.0]), None)])
def test_what_moves_nothing_is_told_and_what_is_normal_is_not(reader, data, reason):
    assert [told for told, _ in reader.read(BY_NAME, data).ignored] == ([reason] if reason else [])


@pytest.mark.parametrize('values, reason, sentence', [
    ([1.0, 2.0], 'wrong length', 'it has 2 efforts, must have 3, one for every joint'),
    ([1.0, 2.0, 3.0, 4.0], 'wrong length', 'it has 4 efforts, must have 3, one for every joint'),
    ([], 'wrong length', 'it has 0 efforts, must have 3, one for every joint'),
    ([1.0, np.nan, 3.0], 'not finite', 'its effort 1 is nan, must be finite'),
    ([1.0, 2.0, -np.inf], 'not finite', 'its effort 2 is -inf, must be finite'),
    ([0.0] * 2**17, 'too long', 'it has 1048596 bytes, must have at most 1048576')])
def test_refused_in_order(reader, values, reason, sentence):
    with pytest.raises(CommandError) as refusal:
        reader.read(IN_ORDER, encode_float64_multi_array(values))
    assert (refusal.value.reason, str(refusal.value)) == (reason, sentence)


def test_refused_by_name_as_a_whole(reader):
    with pytest.raises(CommandError, match='its effort 1 is inf, must be finite'):
        reader.read(BY_NAME, joint_state(a=5.0, x=np.inf))
    ragged = bytearray(joint_state(a=5.0, b=6.0))
    ragged[-24] = 1                          # the count of the effort: one value for two names
    with pytest.raises(CommandError, match='it has 1 efforts for 2 names, must have as many'):
        reader.read(BY_NAME, bytes(ragged))


@pytest.mark.parametrize('type_name', [IN_ORDER, BY_NAME])
@pytest.mark.parametrize('data', [b'', b'\0\1', bytes(11), b'\0\1\0\0' + b'\xff' * 40])
def test_malformed_bytes_are_refused(reader, type_name, data):
    with pytest.raises(CommandError) as refusal:
        reader.read(type_name, data)
    assert refusal.value.reason == 'malformed'


def test_held_until_the_next_and_zero_before_the_first():
    held = HeldEffort(3)
    assert held.effort.tolist() == [0.0, 0.0, 0.0] and not held.commanded
    held.hold(Command((0, 1, 2), (1.0, 2.0, 3.0)), 0)
    held.hold(Command((1,), (5.0,)), 4)
    assert held.effort.tolist() == [1.0, 5.0, 3.0] and held.commanded
    held.clear()
    assert held.effort.tolist() == [0.0, 0.0, 0.0] and not held.commanded


def test_a_joint_that_is_not_commanded_any_more_expires_alone():
    held = HeldEffort(3)
    held.hold(Command((0, 1), (1.0, 2.0)), 10)
    held.hold(Command((1,), (4.0,)), 12)
    assert held.expire(19, 10) == [] and held.effort.tolist() == [1.0, 4.0, 0.0]
    assert held.expire(20, 10) == [0] and held.effort.tolist() == [0.0, 4.0, 0.0]
    assert held.expire(30, 10) == [1] and held.expire(99, 10) == []
    assert held.effort.tolist() == [0.0, 0.0, 0.0]


def test_lockstep_takes_the_first_answer_to_the_waiting_state():
    answers = Answers((0, 1))
    answers.await_for(stamp=7, published=100, since=0)
    for command, received, why in ((Command((0, 1), (1.0, 1.0), stamp=6), 150, 'other stamp'),
                                   (Command((0, 1), (1.0, 1.0), stamp=9), 150, 'other stamp'),
                                   (Command((0, 1), (1.0, 1.0), stamp=0), 150, 'no stamp'),
                                   (Command((0, 1), (1.0, 1.0)), 99, 'early answer')):
        admitted = answers.admit(command, received)
        assert parts(admitted) == ([], []) and [reason for reason, _ in admitted.ignored] == [why]
    assert parts(answers.admit(Command((1, 2), (2.0, 3.0), stamp=7), 150)) == ([1, 2], [2.0, 3.0])
    assert answers.missing == {0} and not answers.complete
    second = answers.admit(Command((0, 1), (4.0, 5.0)), 150)
    assert parts(second) == ([0], [4.0]), 'the first answer stands'
    assert [reason for reason, _ in second.ignored] == ['second answer'] and answers.complete
    answers.await_for(8, 200, 0)
    assert parts(answers.admit(Command((2,), (6.0,), stamp=1), 201)) == ([2], [6.0]), 'nobody waits for joint 2'
    assert answers.missing == {0, 1}
    answers.note_repeated(50)
    assert parts(answers.admit(Command((0,), (7.0,)), 60)) == ([0], [7.0]), 'the clock was set back meanwhile'
    answers.note_repeated(90)
    assert answers.published == 50
    answers.clear()
    assert answers.missing == {0, 1}
    assert parts(answers.admit(Command((0,), (8.0,)), -5)) == ([0], [8.0]), 'past 2038 DDS has no time'


def test_an_answer_from_before_a_reset_is_none_to_the_state_after_it():
    """Both states have the same stamp; an answer that was sent in time for the first one no longer acts."""
    answers = Answers((0,))
    answers.await_for(stamp=7, published=100, since=0)
    assert parts(answers.admit(Command((0,), (1.0,), stamp=7), 99)) == ([0], [1.0]), 'by its stamp alone'
    answers.await_for(stamp=7, published=200, since=0)
    old = answers.admit(Command((0,), (2.0,), stamp=7), 199)
    assert parts(old) == ([], []) and [reason for reason, _ in old.ignored] == ['early answer']
    assert parts(answers.admit(Command((0,), (3.0,), stamp=7), 201)) == ([0], [3.0])
    answers.await_for(stamp=8, published=300, since=0)
    assert parts(answers.admit(Command((0,), (4.0,), stamp=8), 299)) == ([0], [4.0]), 'a clock that was set back'


def test_a_topic_that_is_none_is_refused():
    with pytest.raises(TypeError):
        plain_command(b'', np.zeros(2), 0, None)
