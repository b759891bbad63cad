"""Chain files: every number is read as it is written, and `Chain.source` loads back to the same bits."""
from dataclasses import replace
import math
from math import inf
from random import Random

from hypothesis import example, given, settings, strategies as st
import numpy as np
from oracles.two_rods import rod, TWO_RODS
import pytest

from planar_chain_sim import chain_from_dict, ChainError
from planar_chain_sim.chain import yaml_text
from planar_chain_sim.chain.section import angle_of
from planar_chain_sim.chain_file import chain_from_text

finite = st.floats(allow_nan=False, allow_infinity=False)
not_negative = st.floats(min_value=0.0, allow_nan=False, allow_infinity=False)
moderate = st.floats(-100.0, 100.0)
names = st.text(min_size=1, max_size=12).filter(str.isprintable)


def test_inertia_within_rounding_is_the_point_mass():
    """The parallel-axis theorem J = J_C + m c^2, and the 1e-9 relative by which it may be missed."""
    for inertia, about_joint, about_center in ((0.25, 0.25, 0.0), (0.25 * (1 - 0.9e-9), 0.25, 0.0),
                                               (0.25 * (1 + 5e-16), 0.25, 0.0), (0.375, 0.375, 0.125)):
        body, = chain_from_dict({'bodies': [rod(inertia=inertia, center_of_mass=[0.3, -0.4])]}).bodies
        assert (body.inertia, body.inertia_com) == (about_joint, about_center)
    body, = chain_from_dict({'bodies': [rod(inertia=None, inertia_com=0.125, center_of_mass=[0.3, -0.4])]}).bodies
    assert (body.inertia, body.inertia_com) == (0.375, 0.125)
    with pytest.raises(ChainError, match=r'must be at least mass \* \|center_of_mass\|\^2 = 0.25 '):
        chain_from_dict({'bodies': [rod(inertia=0.25 * (1 - 1.1e-9), center_of_mass=[0.3, -0.4])]})


def test_defaults_and_given_keys_arrive():
    chain = chain_from_text(TWO_RODS)
    assert (chain.name, chain.gravity, chain.source) == ('two_rods', -9.81j, TWO_RODS)
    assert chain.joint_names == ('shoulder', 'boom', 'elbow')
    upper, forearm = chain.bodies
    assert (upper.name, upper.carrier, upper.origin, upper.angle, upper.visual) == ('upper', -1, 0j, 0.0, {})
    assert (forearm.carrier, forearm.mass, forearm.center_of_mass, forearm.inertia) == (0, 2.0, 0.3 + 0.4j, 0.6)
    elbow = forearm.rotation
    assert (elbow.kind, elbow.axis, elbow.effort_limit, elbow.lower, elbow.upper) == ('rotation', 1.0, inf, -inf, inf)
    assert (elbow.damping, elbow.stiffness, elbow.rest, elbow.friction, elbow.armature) == (0.0,) * 5
    assert (elbow.position, elbow.velocity) == (0.0, 0.0)
    keys = {'damping': 1.0, 'stiffness': 2.0, 'rest': -3.0, 'friction': 4.0, 'armature': 5.0, 'effort_limit': 6.0,
            'lower': -7.0, 'upper': 8.0, 'position': -7.0, 'velocity': 9.0, 'axis': -1.0}
    body, = chain_from_dict({'bodies': [rod(origin=[1, 2], angle=3, rotation={'joint': 'j', **keys})]}).bodies
    assert {key: getattr(body.rotation, key) for key in keys} == keys
    assert (body.origin, body.angle) == (1 + 2j, 3.0)
    assert chain_from_dict({'bodies': [rod()]}).gravity == -9.81j


@pytest.mark.parametrize(('scalar', 'number'), [
    ('1e-3', 1e-3), ('+.5', 0.5), ('2.', 2.0), ('1.5E+2', 150.0), ('0x1f', 31.0), ('0o17', 15.0), ('012', 12.0),
    ('4.9406564584124654e-324', 5e-324), ('0.1', 0.1), ('123456789012345678901234567890', 1.2345678901234568e29),
])
def test_numbers_follow_yaml_1_2(scalar, number):
    text = TWO_RODS.replace('joint: elbow', f'joint: elbow\n      velocity: {scalar}')
    assert chain_from_text(text).joints[2].velocity == number


def angle_texts(random):
    """Return a text and the angle that Python makes of it."""
    def number():
        return random.choice(['2', '3.', '.5', '0.25', '7', '1e2', '12.5e-1', f'{random.uniform(0, 9):.6g}'])
    sign = random.choice(['', '-', '+'])
    if random.random() < 0.4:
        size, unit = number(), random.choice(['deg', 'rad', 'DEG'])
        blank = random.choice(['', ' '])
        return f'{sign}{size}{blank}{unit}', math.radians(float(size)) if unit != 'rad' else float(size), sign
    factors = ['pi'] + [number() for _ in range(random.randrange(3))]
    random.shuffle(factors)
    text = factors[0]
    for factor in factors[1:]:
        text += random.choice(['*', '/', ' * ', ' / ']) + factor
    return f'{sign}{text}', eval(text, {'pi': math.pi}), sign    # Python's own reading, of texts made here


def test_angles_as_texts_are_what_python_makes_of_them():
    random = Random(3)
    for _ in range(500):
        text, wanted, sign = angle_texts(random)
        wanted = -wanted if sign == '-' else wanted
        for quote in ('', "'"):
            chain = chain_from_text(TWO_RODS.replace('axis: 0.5', f'axis: {quote}{text}{quote}'))
            assert chain.bodies[1].slide.axis == wanted, text
    assert (angle_of('90 deg'), angle_of('pi/2'), angle_of('-0.5*pi')) == (math.pi / 2, math.pi / 2, -math.pi / 2)


@pytest.mark.parametrize('key', ['position', 'velocity', 'rest', 'lower', 'upper'])
def test_rotation_takes_angles_and_a_slide_lengths(key):
    text = {'lower': '-90 deg', 'velocity': '90 deg/s'}.get(key, '90 deg')
    joint, = chain_from_dict({'bodies': [rod(rotation={'joint': 'pivot', key: text})]}).joints
    assert getattr(joint, key) == (-1 if key == 'lower' else 1) * math.pi / 2
    with pytest.raises(ChainError, match=f"is '{text}', must be a number"):
        chain_from_dict({'bodies': [rod(slide={'joint': 'rail', 'axis': 'pi/2', key: text})]})
    body, = chain_from_dict({'bodies': [rod(angle='-pi/3')]}).bodies
    assert body.angle == -math.pi / 3


@pytest.mark.parametrize('text', [
    '90 degrees', 'pi deg', '1/2', 'pi/0', '2pi pi', 'pi**2', 'pi+1', '(pi)', '--pi', 'pi/', '*pi', '1_0*pi', 'tau',
    '__import__', 'pi\u00b2', '\u0663*pi', '90\u00b0', 'deg', '90 deg/s', 'inf deg', 'nan*pi', '0x10*pi', 'pi;pi',
    '9' * 70 + ' deg', '1e999999 deg'])
def test_texts_that_are_no_angle(text):
    with pytest.raises(ChainError, match='must be a .*number'):
        chain_from_dict({'bodies': [rod(angle=text)]})


def test_infinite_limits_are_no_limits():
    text = TWO_RODS.replace('axis: 1', 'axis: 1\n      effort_limit: .inf\n      lower: -.inf\n      upper: .inf')
    assert chain_from_text(text) == chain_from_text(TWO_RODS)


@pytest.mark.parametrize('word', ['yes', 'on', 'No', '1_000', '0b1', '12:30', '2001-01-01', '=', '1e', '0o8', '.'])
def test_words_of_yaml_1_1_are_texts(word):
    assert chain_from_text(TWO_RODS.replace('joint: elbow', f'joint: {word}')).joint_names[2] == word


def test_pure_python_yaml_reads_the_same(monkeypatch):
    """Twin: the loader without the C library."""
    chain = chain_from_text(TWO_RODS)
    monkeypatch.setattr(yaml_text, 'LOADER', yaml_text.yaml.SafeLoader)
    assert chain_from_text(TWO_RODS) == chain
    with pytest.raises(ChainError, match='^x line 11: is not valid YAML .*, must be a chain file$'):
        chain_from_text(TWO_RODS.replace('axis: 1', 'axis: 1: 1'), 'x')


def test_visual_never_changes_the_motion():
    plain = chain_from_dict({'bodies': [rod()]}).bodies[0]
    drawn = chain_from_dict({'bodies': [rod(visual={'length': 1.0, 'color': 'red'})]})
    assert drawn.bodies[0].visual == {'length': 1.0, 'color': 'red'}
    assert {**vars(drawn.bodies[0]), 'visual': {}} == vars(plain)


def same_bits(left, right):
    """Compare by repr, which tells -0.0 from 0.0, but for the text they were loaded from."""
    return repr(replace(left, source='')) == repr(replace(right, source=''))


@settings(max_examples=150, deadline=None)
@given(gravity=st.tuples(moderate, moderate), numbers=st.tuples(finite, finite, finite, moderate, moderate, moderate),
       laws=st.tuples(not_negative, not_negative, not_negative), name=names,
       visual=st.fixed_dictionaries({}, optional={'length': not_negative, 'color': st.lists(
           st.floats(0.0, 1.0), min_size=3, max_size=4)}))
@example((-0.0, 0.0), (-0.0, 5e-324, 1e308, -0.0, 5e-324, 0.1), (5e-324, 1e308, -0.0), 'yes',
         {'length': 5e-324, 'color': 'red'})
@example((0.1, -9.81), (1e-5, 1e22, 1e16, 1 / 3, 2.5e-7, 1e-7), (1e16, 1e-16, 0.3), '0o17', {'color': '#0a1e7f'})
def test_source_of_data_loads_back_to_the_same_bits(gravity, numbers, laws, name, visual):
    joint = {'joint': name, **dict(zip(('rest', 'position', 'velocity'), numbers)),
             **dict(zip(('damping', 'friction', 'effort_limit'), laws))}
    body = rod(name=name + '!', rotation=joint, origin=numbers[3:5], angle=numbers[5], visual=visual)
    chain = chain_from_dict({'name': name, 'gravity': gravity, 'bodies': [body]})
    assert same_bits(chain_from_text(chain.source), chain)
    assert (chain.name, chain.joint_names, chain.bodies[0].visual) == (name, (name,), visual)
    rest_position_velocity = chain.joints[0].rest, chain.joints[0].position, chain.joints[0].velocity
    assert repr(rest_position_velocity) == repr(numbers[:3])


def test_numpy_numbers_and_tuples_are_taken():
    """Twin: the same chain from plain data."""
    numbers = {'mass': np.float32(1.5), 'inertia': np.array(2), 'origin': np.array([1, 2]),
               'center_of_mass': (0.5, np.int8(0))}
    chain = chain_from_dict({'name': np.str_('a'), 'gravity': np.array([0.0, -9.81]), 'bodies': (rod(**numbers),)})
    plain = {'mass': 1.5, 'inertia': 2.0, 'origin': [1.0, 2.0], 'center_of_mass': [0.5, 0.0]}
    assert same_bits(chain, chain_from_dict({'name': 'a', 'gravity': [0.0, -9.81], 'bodies': [rod(**plain)]}))
    assert type(chain.bodies[0].mass) is float and type(chain.name) is str
