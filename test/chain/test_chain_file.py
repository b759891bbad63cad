"""Chain files: every mistake gives one exact sentence."""
from pathlib import Path

import numpy as np
from oracles.two_rods import rod, TWO_RODS
import pytest

from planar_chain_sim import chain_from_dict, ChainError, load_chain
from planar_chain_sim.chain_file import chain_from_text

CONFIG = Path(__file__).parents[2] / 'config'
ABOVE_ZERO = 'a number >= 0'
KG_M2 = 'kg m^2 about the joint point'
BODY_KEYS = 'name, carrier, origin, angle, mass, center_of_mass, inertia, inertia_com, slide, rotation, visual'
JOINT_KEYS = ('joint, axis, damping, stiffness, rest, friction, preload, armature, effort_limit, lower, upper, '
              'restitution, position, velocity')
AN_EARLIER = "must be 'base' or the name of an earlier body"
ANGLES = "or a string such as '90 deg', 'pi/2', '-0.5*pi'"
AXIS = 'must be 1 (counter-clockwise) or -1 (clockwise)'
SINGULAR = 'which makes the mass matrix singular in every configuration because'
TO_MOVE = "must have mass, inertia or 'armature' to move"
NO_MASS = 'nothing on this body or outboard of it has mass'
THE_SAME = 'it moves no mass, beyond rounding, that the other joints do not move in the same way'

# (what is changed in TWO_RODS, into what, the line of the sentence, the sentence after it)
MISTAKES = [
    ('name: two_rods', 'name: 12', 1, "key 'name' is 12, must be a string (in quotes if it looks like a number)"),
    ('name: two_rods', 'title: a', 1, "key 'title' is unknown, must be one of name, gravity, bodies, hold"),
    ('bodies:', 'bodeis:', 3,
     "key 'bodeis' is unknown (did you mean 'bodies'?), must be one of name, gravity, bodies, hold"),
    ('[0, -9.81]', '9.81', 2, "key 'gravity' is 9.81, must be a list of two finite numbers [x, y] (m/s^2)"),
    ('[0, -9.81]', '[0, 1, 2]', 2, "key 'gravity' is [0, 1, 2], must be a list of two finite numbers [x, y] (m/s^2)"),
    ('[0, -9.81]', '[.nan, 1]', 2, "key 'gravity' is [nan, 1], must be a list of two finite numbers [x, y] (m/s^2)"),
    ('mass: 2.0', 'masss: 2.0', 14,
     f"body 'forearm' key 'masss' is unknown (did you mean 'mass'?), must be one of {BODY_KEYS}"),
    ('mass: 2.0', 'color: red', 14, f"body 'forearm' key 'color' is unknown, must be one of {BODY_KEYS}"),
    ('mass: 2.0', 'damping: 2.0', 14,
     "body 'forearm' key 'damping' is unknown here, must stand under 'slide' or 'rotation'"),
    ('axis: 0.5', 'dampnig: 0.5', 19,
     f"body 'forearm' key 'slide.dampnig' is unknown (did you mean 'damping'?), must be one of {JOINT_KEYS}"),
    ('    mass: 2.0\n', '', 12, f"body 'forearm' key 'mass' is missing, must be {ABOVE_ZERO} (kg)"),
    ('mass: 2.0', 'mass: -0.2', 14, f"body 'forearm' key 'mass' is -0.2, must be {ABOVE_ZERO} (kg)"),
    ('mass: 2.0', 'mass: heavy', 14, f"body 'forearm' key 'mass' is 'heavy', must be {ABOVE_ZERO} (kg)"),
    ('mass: 2.0', "mass: '2.0'", 14, f"body 'forearm' key 'mass' is '2.0', must be {ABOVE_ZERO} (kg)"),
    ('mass: 2.0', 'mass: true', 14, f"body 'forearm' key 'mass' is true, must be {ABOVE_ZERO} (kg)"),
    ('mass: 2.0', 'mass:', 14, f"body 'forearm' key 'mass' is empty, must be {ABOVE_ZERO} (kg)"),
    ('mass: 2.0', 'mass: {a: 1}', 14, f"body 'forearm' key 'mass' is a mapping, must be {ABOVE_ZERO} (kg)"),
    ('mass: 2.0', 'mass: [1, 2, 3, 4]', 14, f"body 'forearm' key 'mass' is a list of 4, must be {ABOVE_ZERO} (kg)"),
    ('mass: 2.0', 'mass: .nan', 14, "body 'forearm' key 'mass' is nan, must be a finite number >= 0 (kg)"),
    ('mass: 2.0', 'mass: 1e999', 14, "body 'forearm' key 'mass' is inf, must be a finite number >= 0 (kg)"),
    ('[0.3, 0.4]', '[0.3]', 15,
     "body 'forearm' key 'center_of_mass' is [0.3], must be a list of two finite numbers [x, y] (m)"),
    ('[0.3, 0.4]', '[1e200, 0.4]', 15, "body 'forearm' key 'center_of_mass' is too far out, "
     'must keep mass * |center_of_mass|^2 a finite number (kg m^2)'),
    ('    inertia_com: 0.1\n', '', 12, f"body 'forearm' key 'inertia' is missing, must be {ABOVE_ZERO} ({KG_M2}), "
     "or 'inertia_com' about the mass centre"),
    ('inertia_com: 0.1', 'inertia_com: -0.1', 16,
     f"body 'forearm' key 'inertia_com' is -0.1, must be {ABOVE_ZERO} (kg m^2 about the mass centre)"),
    ('inertia: 0.4', 'inertia: -0.4', 8, f"body 'upper' key 'inertia' is -0.4, must be {ABOVE_ZERO} ({KG_M2})"),
    ('inertia: 0.4', 'inertia: 0.2', 8, "body 'upper' key 'inertia' is 0.2, must be at least mass * "
     f"|center_of_mass|^2 = 0.25 ({KG_M2}; about the mass centre the key is 'inertia_com')"),
    ('inertia: 0.4', 'inertia: 0.4\n    inertia_com: 0.1', 9,
     "body 'upper' key 'inertia_com' is given together with 'inertia', must be exactly one of the two"),
    ('name: forearm', 'name: upper', 12,
     "body 'upper' key 'name' is 'upper', the name of an earlier body, must be a name of its own"),
    ('name: forearm', 'name: base', 12,
     "body 'base' key 'name' is 'base', the reserved name of the base, must be a name of its own"),
    ('name: forearm', 'angle: 0', 12, "bodies[1] key 'name' is missing, must be the name of the body, a string"),
    ('name: forearm', 'name: ""', 12, "body '' key 'name' is '', must be the name of the body, a string"),
    ('name: forearm', 'name: "a\\nb"', 12,
     "body 'a\\nb' key 'name' is 'a\\nb', must be the name of the body, a string of printable characters"),
    ('carrier: base', 'carrier: forearm', 5,
     f"body 'upper' key 'carrier' is 'forearm', a body that comes later, {AN_EARLIER}"),
    ('carrier: base', 'carrier: upper', 5, f"body 'upper' key 'carrier' is 'upper', the body itself, {AN_EARLIER}"),
    ('carrier: upper', 'carrier: uper', 13,
     f"body 'forearm' key 'carrier' is 'uper', no body of this chain (did you mean 'upper'?), {AN_EARLIER}"),
    ('carrier: upper', 'carrier: moon', 13,
     f"body 'forearm' key 'carrier' is 'moon', no body of this chain, {AN_EARLIER}"),
    ('    carrier: upper\n', '', 12, f"body 'forearm' key 'carrier' is missing, {AN_EARLIER}"),
    ('joint: elbow', 'joint: shoulder', 21, "body 'forearm' key 'rotation.joint' is 'shoulder', "
     "the name of a joint of body 'upper', must be a name of its own"),
    ('joint: elbow', 'joint: boom', 21, "body 'forearm' key 'rotation.joint' is 'boom', "
     "the name of a joint of body 'forearm', must be a name of its own"),
    ('joint: elbow', 'axis: 1', 21, "body 'forearm' key 'rotation.joint' is missing, "
     'must be the name of the joint, a string'),
    ('      axis: 0.5\n', '', 18, "body 'forearm' key 'slide.axis' is missing, "
     "must be a finite number (rad, the direction in the carrier's frame)"),
    ('axis: 1', 'axis: 2', 11, f"body 'upper' key 'rotation.axis' is 2.0, {AXIS}"),
    ('axis: 1', 'axis: z', 11, f"body 'upper' key 'rotation.axis' is 'z', {AXIS}"),
    ('axis: 1', 'damping: -1', 11, f"body 'upper' key 'rotation.damping' is -1, must be {ABOVE_ZERO} (N m s/rad)"),
    ('axis: 1', 'stiffness: -1', 11, f"body 'upper' key 'rotation.stiffness' is -1, must be {ABOVE_ZERO} (N m/rad)"),
    ('axis: 1', 'friction: -1', 11, f"body 'upper' key 'rotation.friction' is -1, must be {ABOVE_ZERO} (N m)"),
    ('axis: 1', 'armature: -1', 11, f"body 'upper' key 'rotation.armature' is -1, must be {ABOVE_ZERO} (kg m^2)"),
    ('axis: 1', 'effort_limit: -1', 11,
     f"body 'upper' key 'rotation.effort_limit' is -1, must be {ABOVE_ZERO} (N m)"),
    ('axis: 1', 'velocity: .inf', 11, "body 'upper' key 'rotation.velocity' is inf, must be a finite number (rad/s)"),
    ('axis: 1', 'lower: 1\n      upper: 1', 11, "body 'upper' key 'rotation.lower' is 1.0, must be below 'upper', 1.0"),
    ('axis: 1', 'upper: 1\n      position: 2', 12,
     "body 'upper' key 'rotation.position' is 2.0, must lie between the stops, -inf and 1.0"),
    ('axis: 1', 'lower: 1', 10, "body 'upper' key 'rotation.position' is 0.0, must lie between the stops, 1.0 and inf"),
    ('slide:\n      joint: boom\n      axis: 0.5', 'slide: 3', 17,
     "body 'forearm' key 'slide' is 3, must be a mapping"),
    ('slide:\n      joint: boom\n      axis: 0.5', 'visual: 3', 17,
     "body 'forearm' key 'visual' is 3, must be a mapping"),
    ('mass: 2.0', 'mass: 0.0', 17,
     f"body 'forearm' key 'slide' has the joint 'boom', {SINGULAR} {NO_MASS}, {TO_MOVE}"),
    ('joint: elbow', 'joint: elbow\n    rotation: {}', 22,
     "body 'forearm' key 'rotation' is given twice, on line 20 too, must be given once"),
    ('joint: elbow', 'joint: &a elbow', 21, "body 'forearm' has the anchor or alias 'a', must be written out in full"),
    ('joint: elbow', 'joint: *a', 21, "body 'forearm' has the anchor or alias 'a', must be written out in full"),
    ('axis: 1', 'axis: !!float 1', 11, "body 'upper' has the tag '!!float', must be plain YAML without tags"),
    ('axis: 1', '[a]: 1', 11, "body 'upper' has a list or mapping as a key, must be a string"),
    ('joint: elbow\n', 'joint: elbow\n---\na: b\n', 22, 'starts a second YAML document, must be one'),
    ('axis: 1', 'axis: [1', 12, "is not valid YAML (did not find expected ',' or ']'), must be a chain file"),
    ('    mass: 2.0', '\tmass: 2.0', 14, 'is indented with a tab, must be indented with spaces'),
    ('      joint: elbow', '  \tjoint: elbow', 21, 'is indented with a tab, must be indented with spaces'),
    ('axis: 0.5', 'axis: north', 19, "body 'forearm' key 'slide.axis' is 'north', must be a finite number (rad, "
     f"the direction in the carrier's frame), {ANGLES}"),
    ('axis: 1', 'position: 90 degrees', 11,
     f"body 'upper' key 'rotation.position' is '90 degrees', must be a number (rad), {ANGLES}"),
    ('axis: 0.5', 'axis: 0.5\n      position: 90 deg', 20,
     "body 'forearm' key 'slide.position' is '90 deg', must be a number (m)"),
    ('[0.3, 0.4]', '[pi, 0.4]', 15,
     "body 'forearm' key 'center_of_mass' is ['pi', 0.4], must be a list of two finite numbers [x, y] (m)"),
    ('mass: 2.0', 'mass: pi', 14, f"body 'forearm' key 'mass' is 'pi', must be {ABOVE_ZERO} (kg)"),
    ('axis: 1', 'lower: .inf', 11,
     "body 'upper' key 'rotation.lower' is inf, must be a finite number or -.inf (rad)"),
    ('axis: 1', 'effort_limit: .nan', 11,
     "body 'upper' key 'rotation.effort_limit' is nan, must be a finite number >= 0 or .inf (N m)"),
    ('axis: 1', 'position: 1e400*pi', 11, "body 'upper' key 'rotation.position' is '1e400*pi', must be a finite number "
     f'(rad), {ANGLES}'),
    ('axis: 1', 'axis: "\0"', 11, "holds the character '\\x00', must be printable text"),
    ('axis: 1', 'axis: ' + 40 * '[', 11, "body 'upper' is nested deeper than 32 levels, must be a chain file"),
]


@pytest.mark.parametrize(('old', 'new', 'line', 'problem'), MISTAKES)
def test_mistake_in_a_file_is_one_exact_sentence(old, new, line, problem):
    assert TWO_RODS.count(old) >= 1
    with pytest.raises(ChainError) as caught:
        chain_from_text(TWO_RODS.replace(old, new, 1), 'arm.yaml')
    assert str(caught.value) == f'arm.yaml line {line}: {problem}'


@pytest.mark.parametrize(('text', 'problem'), [
    ('', ": is empty, must be a mapping with the key 'bodies'"),
    ('# nothing\n', ": is empty, must be a mapping with the key 'bodies'"),
    ('- a', " line 1: is a list, must be a mapping with the key 'bodies'"),
    ('abc', " line 1: is a single value, must be a mapping with the key 'bodies'"),
    ('name: x', " line 1: key 'bodies' is missing, must be a list of at least one body"),
    ('bodies: []', " line 1: key 'bodies' is [], must be a list of at least one body"),
    ('bodies: {a: 1}', " line 1: key 'bodies' is a mapping, must be a list of at least one body"),
    ('bodies: [1]', " line 1: key 'bodies' has 1 as entry 0, must be a list of mappings"),
    ('bodies: [{name: a, carrier: base, mass: 1, inertia: 1}]',
     " line 1: key 'bodies' has no joint, must have a body with 'slide' or 'rotation'"),
    (b'name: \xff', ' line 1: is not UTF-8 text, must be a chain file in YAML'),
    (TWO_RODS.encode('utf-16'), ': is UTF-16 or UTF-32 text, must be UTF-8, in which an editor can save it'),
    (TWO_RODS.encode('utf-16-le'), ': is UTF-16 or UTF-32 text, must be UTF-8, in which an editor can save it'),
    (TWO_RODS.encode('utf-32'), ': is UTF-16 or UTF-32 text, must be UTF-8, in which an editor can save it'),
    (TWO_RODS.encode('utf-16-be'), ': is UTF-16 or UTF-32 text, must be UTF-8, in which an editor can save it'),
    (b'\x7fELF\x02\x01\0\0', ': is a binary file, must be a chain file in YAML'),
    (b'\x89MCAP0\r\n\0',
     ': is an MCAP log (resimulate and replay read it), must be a URDF, an MJCF or a chain file in YAML'),
    (b'a' * (2**24 + 1), ': is longer than 16 MiB, must be a chain file in YAML'),
    ('a: [' + 65537 * '1,' + ']', ' line 1: has one item too many, must be a list of at most 65536'),
    ('\n'.join(f'k{i}: 1' for i in range(257)),
     " line 257: key 'k256' is one too many, must be one of at most 256 in a mapping"),
])
def test_text_that_is_no_chain_is_one_exact_sentence(text, problem):
    with pytest.raises(ChainError) as caught:
        chain_from_text(text, 'arm.yaml')
    assert str(caught.value) == f'arm.yaml{problem}'


@pytest.mark.parametrize(('bodies', 'kind', 'joint', 'why'), [
    # the rows of equations.md 7 that are never solvable
    ([rod(mass=0, inertia=0)], 'rotation', 'pivot', NO_MASS),
    ([rod(inertia=0)], 'rotation', 'pivot', THE_SAME),
    ([rod(mass=0, slide={'joint': 'rail', 'axis': 0.3})], 'slide', 'rail', NO_MASS),
    ([rod(mass=0, inertia=0), rod(name='tip', carrier='rod', inertia=0.5, rotation={'joint': 'wrist'})],
     'rotation', 'pivot', THE_SAME),
    ([rod(mass=0, inertia=0), rod(name='tip', carrier='rod', mass=0, rotation={'joint': 'wrist'})],
     'rotation', 'pivot', THE_SAME),
    ([rod(mass=0, inertia=0, rotation=None, slide={'joint': 'rail', 'axis': 0.3}),
      rod(name='tip', carrier='rod', rotation=None, slide={'joint': 'boom', 'axis': 0.3})],
     'slide', 'rail', THE_SAME),
])
def test_chain_that_is_singular_everywhere_is_refused(bodies, kind, joint, why):
    with pytest.raises(ChainError) as caught:
        chain_from_dict({'bodies': bodies})
    assert str(caught.value) == (f"bodies[0].{kind}: body 'rod' key '{kind}' has the joint '{joint}', "
                                 f'{SINGULAR} {why}, {TO_MOVE}')


@pytest.mark.parametrize('bodies', [
    [rod(mass=0, inertia=0), rod(name='tip', carrier='rod', origin=[1, 0], rotation={'joint': 'wrist'})],
    [rod(mass=0, inertia=0.1)],
    [rod(inertia=0, center_of_mass=[0.5, 0], rotation={'joint': 'pivot', 'armature': 0.1}, mass=0)],
    [rod(inertia=0.25, center_of_mass=[0.5, 0])],
])
def test_degenerate_but_solvable_chain_is_taken(bodies):
    assert chain_from_dict({'bodies': bodies}).joint_count == len(bodies)


@pytest.mark.parametrize(('data', 'sentence'), [
    ([], "the chain is of type list, must be a mapping with the key 'bodies'"),
    (None, "the chain is of type NoneType, must be a mapping with the key 'bodies'"),
    ({1: 2}, 'the chain: has a key of type int, must be a mapping whose keys are strings'),
    ({'name': '\ud800'}, "name: holds the text '\\\\ud800', must be printable text"),
    ({'bodies': [rod(mass=np.float32(-1))]},
     f"bodies[0].mass: body 'rod' key 'mass' is -1.0, must be {ABOVE_ZERO} (kg)"),
    ({'bodies': [rod(mass=10**400)]},
     "bodies[0].mass: body 'rod' key 'mass' is inf, must be a finite number >= 0 (kg)"),
    ({'bodies': [rod(mass=object())]},
     'bodies[0].mass: is of type object, must be a mapping, a list, a string or a number'),
    ({'bodies': [rod(mass=np.True_)]}, f"bodies[0].mass: body 'rod' key 'mass' is true, must be {ABOVE_ZERO} (kg)"),
    ({'bodies': [rod(origin=np.zeros(3))]}, "bodies[0].origin: body 'rod' key 'origin' is [0.0, 0.0, 0.0], "
     'must be a list of two finite numbers [x, y] (m)'),
    ({'bodies': [rod(rotation={'joint': 'pivot', 'damping': 'x'})]}, "bodies[0].rotation.damping: body 'rod' "
     f"key 'rotation.damping' is 'x', must be {ABOVE_ZERO} (N m s/rad)"),
    ({'bodies': [rod(visual={'a': [1, b'x']})]},
     'bodies[0].visual.a[1]: is of type bytes, must be a mapping, a list, a string or a number'),
    ({'bodies': [rod(visual={str(i): i for i in range(257)})]},
     'bodies[0].visual: has 257 entries, must have at most 256 keys or 65536 items'),
])
def test_mistake_in_data_is_one_exact_sentence(data, sentence):
    with pytest.raises(ChainError) as caught:
        chain_from_dict(data)
    assert str(caught.value) == sentence


def test_data_that_holds_itself_is_one_sentence():
    visual = {}
    visual['again'] = visual
    with pytest.raises(ChainError, match='is nested deeper than 32 levels, must be a chain$'):
        chain_from_dict({'bodies': [rod(visual=visual)]})


@pytest.mark.parametrize('text', [
    TWO_RODS.replace('\n', '\r\n'), '\ufeff' + TWO_RODS, ('\ufeff' + TWO_RODS).replace('\n', '\r\n').encode(),
    TWO_RODS.replace('\n', '\r'), TWO_RODS.replace('mass: 2.0', 'mass:\t2.0 \t')])
def test_marks_and_line_ends_of_editors_are_taken(text):
    assert chain_from_text(text) == chain_from_text(TWO_RODS)


def test_chain_that_is_not_there_is_told_with_those_that_are(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(ChainError) as caught:
        load_chain('four_link.yaml')
    said, shipped = str(caught.value), sorted(path.name for path in CONFIG.glob('*.yaml'))
    assert said.startswith('four_link.yaml: was not found in the working directory, ')
    assert "(did you mean 'four_link_robot.yaml'?)" in said
    assert len(shipped) >= 6 and said.endswith(f'; the package has {", ".join(shipped)}')


@pytest.mark.parametrize(('path', 'reason'), [
    ('/no/such/chain.yaml', 'No such file or directory'),
    (str(Path(__file__).parent), 'Is a directory'),
    ('/dev/zero', 'Not a regular file'),
    ('/proc/self/mem', 'Input/output error'),
    ('/a\0b', 'its name holds a NUL'),
])
def test_file_that_cannot_be_read_is_one_exact_sentence(path, reason):
    with pytest.raises(ChainError) as caught:
        load_chain(path)
    name = path.replace('\0', '\\x00')
    assert str(caught.value) == f'{name}: cannot be read ({reason}), must be a chain file in YAML'
