"""Which commands act and which are refused, down to the bytes."""
import numpy as np
import pytest

from planar_chain_sim.recording.cdr import encode_float64_multi_array, JointStateLayout
from planar_chain_sim.ros.commands import CommandError, HeldEffort

IN_ORDER, BY_NAME = 'std_msgs/msg/Float64MultiArray', 'sensor_msgs/msg/JointState'


def joint_state(**efforts):
    layout = JointStateLayout(list(efforts))
    layout.effort[:] = list(efforts.values())
    return layout.to_bytes()


@pytest.fixture
def held():
    held = HeldEffort(['a', 'b', 'c'])
    assert held.take(IN_ORDER, encode_float64_multi_array([1.0, 2.0, 3.0]))
    return held


def test_before_the_first_command_effort_is_zero():
    assert HeldEffort(['a', 'b']).effort.tolist() == [0.0, 0.0]


def test_in_order(held):
    assert held.effort.tolist() == [1.0, 2.0, 3.0]


def test_by_name_others_keep_theirs(held):
    assert held.take(BY_NAME, joint_state(c=-3.0, a=9.0))
    assert held.effort.tolist() == [9.0, 2.0, -3.0] and held.unknown == ()


def test_unknown_names_are_told_and_the_rest_acts(held):
    assert held.take(BY_NAME, joint_state(x=7.0, b=5.0))
    assert held.effort.tolist() == [1.0, 5.0, 3.0] and held.unknown == ('x',)
    assert not held.take(BY_NAME, joint_state(x=7.0))
    assert held.take(BY_NAME, joint_state(b=6.0)) and held.unknown == ()


def test_positions_alone_command_nothing(held):
    data = joint_state(a=1.0)
    without_effort = data[:-16] + bytes(4)   # instead of count, gap and value
    assert not held.take(BY_NAME, without_effort)
    assert held.effort.tolist() == [1.0, 2.0, 3.0]


@pytest.mark.parametrize('values, sentence', [
    ([1.0, 2.0], 'it has 2 efforts, must have 3, one for every joint'),
    ([1.0, 2.0, 3.0, 4.0], 'it has 4 efforts, must have 3, one for every joint'),
    ([], 'it has 0 efforts, must have 3, one for every joint'),
    ([1.0, np.nan, 3.0], 'its effort 1 is nan, must be finite'),
    ([1.0, 2.0, -np.inf], 'its effort 2 is -inf, must be finite')])
def test_refused_in_order(held, values, sentence):
    with pytest.raises(CommandError) as refusal:
        held.take(IN_ORDER, encode_float64_multi_array(values))
    assert str(refusal.value) == sentence
    assert held.effort.tolist() == [1.0, 2.0, 3.0]


def test_refused_by_name_as_a_whole(held):
    with pytest.raises(CommandError, match='its effort 1 is nan, must be finite'):
        held.take(BY_NAME, joint_state(a=5.0, x=np.nan))
    ragged = bytearray(joint_state(a=5.0, b=6.0))
    ragged[-24] = 1                          # the count of the effort: one value for two names
    with pytest.raises(CommandError, match='it has 1 efforts for 2 names, must have as many'):
        held.take(BY_NAME, bytes(ragged))
    assert held.effort.tolist() == [1.0, 2.0, 3.0]


@pytest.mark.parametrize('type_name', [IN_ORDER, BY_NAME])
@pytest.mark.parametrize('data', [b'', b'\0\1', bytes(11), b'\0\1\0\0' + b'\xff' * 40])
def test_malformed_bytes_are_refused(held, type_name, data):
    with pytest.raises(CommandError):
        held.take(type_name, data)
    assert held.effort.tolist() == [1.0, 2.0, 3.0]
