"""URDF written and read: other libraries see the same robot, it reads back the same; what is not planar is named."""
from dataclasses import replace
import io
from math import cos, pi, sin
from xml.etree import ElementTree

import numpy as np
from oracles.random_trees import random_state, random_tree
import pinocchio
import pytest
import yourdfpy

import planar_chain_sim as pcs
from planar_chain_sim.chain.chain import Chain
from planar_chain_sim.chain_file import chain_from_text
from planar_chain_sim.mechanics.body_lines import body_lines
from planar_chain_sim.robot_files.urdf_writer import urdf_of

CONFIGS = ('arczewski_example', 'cart_arm_telescope', 'chain_32_links', 'double_pendulum', 'four_link_robot',
           'seven_link_arm')


def bare(chain: Chain) -> Chain:
    """Return the chain without what URDF cannot say: springs and rotors."""
    return replace(chain, bodies=tuple(replace(body, **{
        kind: joint and replace(joint, stiffness=0.0, rest=0.0, armature=0.0, position=0.0, velocity=0.0)
        for kind, joint in (('slide', body.slide), ('rotation', body.rotation))}) for body in chain.bodies))


CHAINS = [bare(pcs.load_chain(f'{name}.yaml')) for name in CONFIGS] + [bare(random_tree(seed, 7)) for seed in range(8)]


@pytest.fixture(params=CHAINS, ids=lambda chain: chain.name)
def chain(request):
    return request.param


def pinocchio_state(model, chain, position, velocity, acceleration):
    """Return a state as Pinocchio wants it: a joint without stops is the pair of its cosine and sine."""
    q, v, a = pinocchio.neutral(model), np.zeros(model.nv), np.zeros(model.nv)
    for k, name in enumerate(chain.joint_names):
        joint = model.joints[model.getJointId(name)]
        if joint.nq == 2:
            q[joint.idx_q:joint.idx_q + 2] = cos(position[k]), sin(position[k])
        else:
            q[joint.idx_q] = position[k]
        v[joint.idx_v], a[joint.idx_v] = velocity[k], acceleration[k]
    return q, v, a


def test_pinocchio_computes_the_same_mass_matrix_and_efforts(chain):
    """Oracle: an independent library that reads URDF with its own parser; 1e-11 is 100 times what 7 joints round to."""
    model = pinocchio.buildModelFromXML(urdf_of(chain))
    model.gravity = pinocchio.Motion(np.array([chain.gravity.real, 0.0, chain.gravity.imag, 0.0, 0.0, 0.0]))
    data = model.createData()
    position, velocity, acceleration = random_state(chain, 3)
    q, v, a = pinocchio_state(model, chain, position, velocity, acceleration)
    order = [model.joints[model.getJointId(name)].idx_v for name in chain.joint_names]
    assert sorted(order) == list(range(model.nv))
    matrix = pinocchio.crba(model, data, q)
    matrix = np.triu(matrix) + np.triu(matrix, 1).T
    wanted = pcs.mass_matrix(chain, position)
    np.testing.assert_allclose(matrix[np.ix_(order, order)], wanted, rtol=0, atol=1e-11 * abs(wanted).max())
    effort = pinocchio.rnea(model, data, q, v, a)[order]
    damping = np.array([joint.damping for joint in chain.joints]) * velocity   # which rnea does not know
    wanted = pcs.inverse_dynamics(chain, position, velocity, acceleration)
    np.testing.assert_allclose(effort + damping, wanted, rtol=0, atol=1e-11 * abs(wanted).max())


def test_yourdfpy_sees_the_same_poses(chain):
    """Oracle: forward kinematics of a third library, to a wrist as far as round-off goes."""
    robot = yourdfpy.URDF.load(io.BytesIO(urdf_of(chain).encode()), load_meshes=False, build_scene_graph=True)
    position, _, _ = random_state(chain, 5)
    robot.update_cfg(dict(zip(chain.joint_names, position)))
    for body, lines in zip(chain.bodies, body_lines(chain, position)):
        place = robot.get_transform(body.name, 'world')[:3, 3]
        start = lines[0][0]
        np.testing.assert_allclose(place, [start.real, 0.0, start.imag], atol=1e-12 * (1 + abs(position).max()))


def test_joints_are_of_the_kind_that_their_laws_make():
    chain = pcs.load_chain('cart_arm_telescope.yaml')
    body = replace(chain.bodies[1], rotation=replace(chain.bodies[1].rotation, lower=-2.0, friction=0.5))
    robot = ElementTree.fromstring(urdf_of(replace(chain, bodies=(chain.bodies[0], body, *chain.bodies[2:]))))
    joints = {joint.get('name'): joint for joint in robot.findall('joint')}
    assert {name: joint.get('type') for name, joint in joints.items()} == {
        'world_to_base_link': 'fixed', 'cart_slide': 'prismatic', 'arm_joint': 'revolute', 'motor_weld': 'fixed',
        'telescope_slide': 'prismatic', 'gripper_slide': 'prismatic', 'gripper_joint': 'continuous'}
    assert joints['world_to_base_link'].find('origin').get('rpy') == f'{pi / 2!r} 0.0 0.0'
    assert joints['arm_joint'].find('limit').attrib == {
        'lower': '-2.0', 'upper': '1000000000.0', 'effort': '50.0', 'velocity': '1000000000.0'}
    assert joints['arm_joint'].find('dynamics').attrib == {'damping': '0.2', 'friction': '0.5'}
    links = [link.get('name') for link in robot.iter('link')]
    assert links == ['world', 'base_link', 'cart', 'arm', 'motor', 'telescope', 'gripper_carriage', 'gripper']


def test_names_that_xml_or_urdf_cannot_have_twice_are_distinguished():
    chain = pcs.chain_from_dict({'bodies': [
        {'name': name, 'carrier': 'base', 'mass': 1, 'inertia': 1, 'rotation': {'joint': f'<"{name}&'}}
        for name in ('world', 'base_link', 'base_link_')]})
    robot = ElementTree.fromstring(urdf_of(chain))
    assert [link.get('name') for link in robot.iter('link')] == [
        'world', 'base_link', 'world_', 'base_link_', 'base_link__']
    assert chain_from_text(urdf_of(chain)).joint_names == chain.joint_names


def test_it_comes_back_the_same(chain):
    """Twin: out and in again; a body that slides and turns comes back as two, so motions are compared."""
    again = chain_from_text(urdf_of(replace(chain, gravity=-9.81j)))
    assert again.joint_names == chain.joint_names and again.gravity == -9.81j
    for old, new in zip(chain.joints, again.joints):
        assert (new.kind, new.damping, new.effort_limit, new.lower, new.upper) == (
            old.kind, old.damping, old.effort_limit, old.lower, old.upper)
    position, velocity, effort = random_state(chain, 1)
    wanted = pcs.forward_dynamics(replace(chain, gravity=-9.81j), position, velocity, effort)
    got = pcs.forward_dynamics(again, position, velocity, effort)
    condition = np.linalg.cond(pcs.mass_matrix(chain, position))
    np.testing.assert_allclose(got, wanted, rtol=0, atol=1e-14 * condition * (1 + abs(wanted).max()))
    assert chain_from_text(again.source) == again


ROBOT = """<robot name="r">
  <link name="base_link"/>
  <link name="a"><inertial><origin xyz="{center}"/><mass value="2"/>
    <inertia ixx="0.1" iyy="0.2" izz="0.3" ixy="0" ixz="0" iyz="0"/></inertial></link>
  <link name="b"><inertial><mass value="1"/>
    <inertia ixx="0.1" iyy="0.2" izz="0.3" ixy="0" ixz="0" iyz="0"/></inertial></link>
  <joint name="shoulder" type="revolute"><parent link="base_link"/><child link="a"/><axis xyz="{axis}"/>
    <limit lower="-1" upper="2" effort="30" velocity="1"/><dynamics damping="0.5" friction="0.25"/></joint>
  <joint name="elbow" type="{kind}"><parent link="a"/><child link="b"/><origin xyz="{origin}" rpy="{rpy}"/>
    <axis xyz="{second}"/><limit lower="0.1" upper="1" effort="20" velocity="1"/></joint>
</robot>"""
USUAL = {'axis': '0 1 0', 'kind': 'revolute', 'origin': '0 0.1 -1', 'rpy': '0 0 0', 'second': '0 -1 0',
         'center': '0 0 -0.5'}


def read(**changes):
    return chain_from_text(ROBOT.format(**{**USUAL, **changes}), 'r.urdf')


def test_axes_about_y_make_an_upright_plane():
    chain = read()
    a, b = chain.bodies
    assert chain.gravity == -9.81j and (a.name, b.name, a.carrier, b.carrier) == ('a', 'b', -1, 0)
    assert b.origin == -1j and a.center_of_mass == -0.5j       # the plane's x is the world's x, its y the world's z
    assert (a.rotation.axis, b.rotation.axis) == (-1.0, 1.0)   # about +y what is positive turns x towards -z
    assert a.inertia_com == 0.2 and b.inertia == 0.2
    assert (a.rotation.damping, a.rotation.friction, a.rotation.effort_limit) == (0.5, 0.25, 30.0)
    assert (a.rotation.lower, a.rotation.upper, b.rotation.position) == (-1.0, 2.0, 0.1)


def test_axes_about_z_lie_flat_and_tilted_ones_feel_part_of_gravity():
    flat = read(axis='0 0 1', second='0 0 1', origin='1 0 0.2', center='0.5 0 0')
    assert flat.gravity == 0 and flat.bodies[1].origin == 1.0 and flat.bodies[0].inertia_com == 0.3
    tilted = read(axis='0 -1 1', second='0 -1 1', origin='1 0 0', center='0.5 0 0')
    assert tilted.gravity == pytest.approx(-9.81j * sin(pi / 4))
    assert tilted.bodies[0].inertia_com == pytest.approx(0.25)


def test_a_slide_across_the_axes_and_a_turned_frame():
    chain = read(kind='prismatic', second='0 0 1', rpy='0 0.5 0')
    slide = chain.bodies[1].slide
    assert slide.axis == pytest.approx(pi / 2 - 0.5) and chain.bodies[1].angle == pytest.approx(-0.5)
    assert (slide.lower, slide.upper, slide.position, slide.effort_limit) == (0.1, 1.0, 0.1, 20.0)


@pytest.mark.parametrize('changes, sentence', [
    ({'second': '0 1 0.01'}, "joint 'shoulder' turns about another direction than 'elbow': the robot is not planar"),
    ({'rpy': '0.1 0 0'}, "joint 'shoulder' turns about another direction than 'elbow': the robot is not planar"),
    ({'kind': 'prismatic', 'second': '0 1 1'}, "joint 'elbow' slides askew to the plane of 'shoulder'"),
    ({'kind': 'floating'}, "joint 'elbow' is of type 'floating', must be one of fixed, continuous, revolute"),
    ({'kind': 'spherical'}, "joint 'elbow' is of type 'spherical', must be one of fixed, continuous, revolute"),
    ({'second': '0 0 0'}, "joint 'elbow' has the axis [0.0, 0.0, 0.0], must be a direction"),
    ({'axis': 'nan 1 0'}, "joint 'shoulder' has the axis [nan, 1.0, 0.0], must be a direction"),
    ({'axis': '0 1 o'}, "joint 'shoulder' has xyz '0 1 o', must be 3 numbers"),
    ({'origin': 'inf 0 0'}, "joint 'elbow' has a position that is not finite"),
    ({'center': '0 0'}, "link 'a' has xyz '0 0', must be 3 numbers"),
    ({'center': 'inf 0 0'}, "link 'a' has a mass centre that is not finite"),
    ({'origin': '0 0 0"/><mimic joint="shoulder'}, "'elbow' mimics 'shoulder', must move on its own or be welded"),
])
def test_what_is_no_planar_robot_is_refused_by_the_joint(changes, sentence):
    with pytest.raises(pcs.ChainError) as refusal:
        read(**changes)
    assert str(refusal.value).startswith('r.urdf: ') and sentence in str(refusal.value)
    assert ', must' in str(refusal.value) and str(refusal.value).isprintable()


@pytest.mark.parametrize('text, sentence', [
    ('<robot', 'is not well-formed XML (unclosed token)'),
    ('<sdf version="1.7"><model name="m"/></sdf>', 'is an SDF, must be a URDF'),
    ('<html/>', "is XML with the root element 'html', must be the URDF of a robot"),
    ('<robot name="r"><link name="a"/></robot>', 'has no joint that moves'),
    ('<!DOCTYPE robot [<!ENTITY a "b">]><robot name="&a;"/>', 'has a DOCTYPE, must be URDF without one'),
    ('<robot name="&a;"/>', 'is not well-formed XML (undefined entity)'),
    ('<robot name="r"><link name="a"/>\n<link name="a"/></robot>', "has two links 'a', on lines 1 and 2"),
    ('<robot name="r"><link name="a"/><link name="b"/><joint name="j" type="fixed"><parent link="b"/><child link="c"/>'
     '</joint></robot>', "joint 'j' has the child 'c', which the robot does not have"),
    ('<robot name="r"><link name="a"/><link name="b"/><joint name="j" type="fixed"><parent link="b"/></joint></robot>',
     "joint 'j' has no child, must join two links"),
    ('<robot name="r"><link name="o"/><link name="a"/><link name="b"/>'
     '<joint name="j" type="continuous"><parent link="a"/><child link="b"/></joint>'
     '<joint name="k" type="continuous"><parent link="b"/><child link="a"/></joint></robot>', "'j', 'k' close a loop"),
    (40 * '<robot>' + 40 * '<link>', 'nested deeper than 64'),
])
def test_texts_that_are_no_robot_are_one_sentence(text, sentence):
    with pytest.raises(pcs.ChainError) as refusal:
        chain_from_text(text)
    assert sentence in str(refusal.value) and ', must' in str(refusal.value), refusal.value
    assert str(refusal.value).isprintable()


def torn(random, text):
    """Return the text with attributes and elements taken away or given another's value."""
    root = ElementTree.fromstring(text)
    for _ in range(int(random.integers(1, 4))):
        elements = list(root.iter())
        element = elements[random.integers(len(elements))]
        if element.attrib and random.random() < 0.7:
            key = str(random.choice(list(element.attrib)))
            value = random.choice(['', 'x', '1 2', 'nan', '-1', '1e999', None])
            element.attrib.pop(key) if value is None else element.set(key, value)
        elif len(element):
            element.remove(element[random.integers(len(element))])
    return ElementTree.tostring(root, encoding='unicode')


@pytest.mark.slow
@pytest.mark.filterwarnings('ignore:.*effort limit 0')
def test_a_torn_text_is_a_chain_or_a_sentence():
    refused = 0
    for seed in range(300):
        try:
            chain_from_text(torn(np.random.default_rng(seed), urdf_of(CHAINS[seed % 4])))
        except pcs.ChainError as error:
            refused += 1
            assert ', must' in str(error) and str(error).isprintable() and len(str(error)) < 600
    assert 100 < refused < 300


def test_every_executable_takes_a_urdf_file(tmp_path, capsys):
    from planar_chain_sim.recording import rollout
    from planar_chain_sim.recording.log_reader import read_log
    from planar_chain_sim.resimulation import command_line as resimulation
    chain = replace(CHAINS[4], gravity=-9.81j)
    (tmp_path / 'robot.urdf').write_text(urdf_of(chain))
    log = tmp_path / 'run.mcap'
    assert rollout.main([str(tmp_path / 'robot.urdf'), '--duration', '0.1', '--output', str(log)]) == 0
    assert resimulation.main([str(log)]) == 0, capsys.readouterr()
    assert chain_from_text(read_log(log).chain_text).joint_names == chain.joint_names
